"""Start conditions: equations in positions or velocities that apply only at the start of a motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.components import AngleSymbol, ReactionSymbol, StateSymbol, at_initial_values
from uqmbd.mechanism.declared.holonomic import RATES
from uqmbd.mechanism.declared.recorded import require_recordable
from uqmbd.mechanism.declared.scope import Described, require_known, unseen_numbers
from uqmbd.mechanism.expressions import check_dimensions, flatten, is_scalar, numbers, random_variables, shown, units_of
from uqmbd.mechanism.geometry import Space
from uqmbd.units import without_quantities

__all__ = ["StartCondition", "start_condition"]


USAGE = "write mechanism.start(expression, value), or mechanism.start(sympy.Eq(expression, value))"
LONG = 60
"""Largest number of characters of a condition in messages."""


@dataclass(frozen=True)
class StartCondition:
    """Condition ``expression = value`` at the start of every realisation."""

    text: str  # name of the condition in messages
    stated: sympy.Expr  # left side minus right side
    of_velocities: bool  # True: condition in velocities, linear in velocities; False: condition in positions
    space: Space

    @property
    def residual(self) -> sympy.Expr:
        """Residual of the condition; the current parameter values give the initial values of auxiliary states."""
        return at_initial_values(self.stated, self.space)

    @property
    def kind(self) -> str:
        """Kind of the condition, as text: in positions or in velocities."""
        return "velocity" if self.of_velocities else "position"


def start_condition(mechanism: Described, condition: Any, value: Any) -> StartCondition:
    """Return a start condition from the arguments of `Mechanism.start`; raise if they are invalid."""
    where = f"mechanism {mechanism.name!r}: start"
    left, right = _sides(where, condition, value)
    text = f"{_short(left)} = {_short(right)}"
    where = f"mechanism {mechanism.name!r}: start condition {text}"
    for side in (left, right):
        late = sorted((s for s in side.free_symbols if _late(s)), key=str)
        if late or is_scalar(side):
            raise StudyError(
                f"{where}: the condition contains {late[0] if late else side}, which is a result of "
                "the initial state. A start condition may contain positions, angles, velocities, "
                "angular velocities and random variables."
            )
        require_known(mechanism, where, side, "start")
    stated = left - right
    check_dimensions(where, stated, unseen=unseen_numbers(mechanism))
    residual = at_initial_values(stated, mechanism.space)
    states = {s for s in residual.free_symbols if isinstance(s, sympy.Symbol) and not random_variables(s)}
    rates = [s for s in states if _is_rate(s)]
    if not any(isinstance(s, (StateSymbol, AngleSymbol)) for s in states):
        raise StudyError(
            f"{where}: the condition contains neither a position nor a velocity, so it has no effect. Use an "
            "expression such as joint.angle, body.position[0] or body.velocity[0]."
        )
    if rates and any(sympy.diff(residual, a).free_symbols & set(rates) for a in rates):
        raise StudyError(
            f"{where}: the condition is not linear in the velocities; expected a linear expression, e.g. "
            "body.velocity[0] - 3."
        )
    return StartCondition(text, stated, bool(rates), mechanism.space)


def _sides(where: str, condition: Any, value: Any) -> tuple[sympy.Expr, sympy.Expr]:
    """Return the left and the right side of a condition."""
    if isinstance(condition, (bool, sympy.logic.boolalg.BooleanAtom)):
        given = "" if value is None else f" and {shown(value)}"
        raise StudyError(
            f"{where}: the condition is {bool(condition)}{given}; expected an equation: {USAGE}. Python evaluates == "
            f"at once, and sympy.Eq is {bool(condition)} if its sides are {'equal' if condition else 'never equal'}, "
            f"such as x and {'x' if condition else 'x + 1'}."
        )
    if isinstance(condition, sympy.Equality):
        if value is not None:
            raise StudyError(f"{where}: both an equation and the value {shown(value)} are given; {USAGE}.")
        left, right = condition.lhs, condition.rhs
    elif isinstance(condition, sympy.logic.boolalg.Boolean) and not isinstance(condition, sympy.Expr):
        raise StudyError(f"{where}: the condition is {shown(condition)}; expected an equation: {USAGE}.")
    else:
        if value is None:
            raise StudyError(f"{where}: the condition is {shown(condition)}, without a value; {USAGE}.")
        left, right = condition, value
    expression = require_recordable(where, left)
    right = without_quantities(f"{where}: the value", right, units_of(expression))
    if len(flatten(right)) != 1:
        raise StudyError(
            f"{where}: the value is {shown(right)}; expected one number, or one expression in random variables."
        )
    return expression, numbers(where, "the value", right, 1, "or an expression in random variables")[0]


def _late(symbol: sympy.Basic) -> bool:
    return isinstance(symbol, ReactionSymbol) or (
        isinstance(symbol, StateSymbol) and symbol.quantity in ("a", "angular_acceleration")
    )


def _is_rate(symbol: sympy.Basic) -> bool:
    return isinstance(symbol, StateSymbol) and symbol.quantity in RATES


def _short(expression: sympy.Expr) -> str:
    text = sympy.sstr(expression, full_prec=False)
    return text if len(text) <= LONG else f"{text[: LONG - 3]}..."
