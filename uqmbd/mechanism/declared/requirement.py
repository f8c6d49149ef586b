"""Requirements: relations that a mechanism has to satisfy, and their margins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import sympy

from uqmbd.arguments import Bounds, typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.declared.output import Output
from uqmbd.mechanism.declared.recorded import require_recordable
from uqmbd.mechanism.declared.scope import Described, require_known, unseen_numbers
from uqmbd.mechanism.expressions import (
    EventTime,
    FirstTime,
    Maximum,
    Minimum,
    MotionSymbol,
    Summary,
    check_dimensions,
    check_scalar,
    is_scalar,
    random_variables,
    shown,
    t,
)
from uqmbd.names import ANY, check_name, unwritable

__all__ = ["Requirement", "requirement_of"]

BELOW = (sympy.LessThan, sympy.StrictLessThan)
ABOVE = (sympy.GreaterThan, sympy.StrictGreaterThan)


@typechecked
@dataclass(frozen=True)
class Requirement:
    """A limit that a mechanism has to stay within.

    Attributes
    ----------
    name, description : str
        As the user wrote them.
    relation : str
        As it reads.
    over_time : bool
        Whether it has to hold at all times; else it is one statement on a realisation.
    at_the_end : bool
        Whether that is made at the end of the motion only, as of an integral.
    open : {-1, 0, 1}
        If a first time or event does not occur, the margin exceeds that at the end of the motion (1), or is below it
        (-1).

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
    >>> stone = mechanism.body("stone", mass=1)
    >>> mechanism.require("in reach", stone.position[0] > -10, "it stays above the ground")
    >>> (one,) = mechanism.requirements.values()
    >>> one.name, one.words, one.over_time
    ('in reach', 'it stays above the ground', True)
    """

    name: str
    description: str
    relation: str
    over_time: bool
    at_the_end: bool = False
    open: Annotated[int, Bounds(-1, 1)] = 0

    @property
    def words(self) -> str:
        """The description, or the relation."""
        return self.description or self.relation


def requirement_of(mechanism: Described, name: str, relation: Any, description: Any) -> tuple[Requirement, Output]:
    """Return a requirement of a mechanism and its margin, or raise where something is wrong; see `Mechanism.require`.

    The margin is the difference of its sides: the requirement is violated where it is below zero.
    """
    where = f"requirement {check_name(name, 'requirement')!r}"
    if name == ANY:
        raise StudyError(f"{where}: that name belongs to the event that any requirement is violated; choose another.")
    if name in mechanism.requirements:
        raise StudyError(f"{where}: there is a requirement of that name already; every requirement needs its own.")
    if not isinstance(description, str):
        raise StudyError(f"{where}: the description is {shown(description)}; expected a text.")
    if mark := unwritable(description):
        raise StudyError(f"{where}: the description is {shown(description)}; it cannot contain {mark}.")
    margin = _over_time(_margin(where, relation))
    value = require_recordable(where, margin)
    if not value.free_symbols:
        raise StudyError(
            f"{where}: the relation {relation} contains neither a quantity of the mechanism nor a random variable."
        )
    if value.free_symbols == {t}:
        raise StudyError(
            f"{where}: the relation {relation} contains time alone, so the mechanism has no effect on it; expected "
            "one of a quantity of the mechanism, or of a random variable."
        )
    require_known(mechanism, where, value, "output")
    timeless = is_scalar(value) or not value.free_symbols - random_variables(value)
    if is_scalar(value):
        check_scalar(where, value)
    check_dimensions(where, value, unseen=unseen_numbers(mechanism))
    late = bool(value.atoms(Summary, MotionSymbol))
    return Requirement(name, description, str(relation), not timeless, late, _bounds(value)), Output(name, value, "")


def _margin(where: str, relation: Any) -> sympy.Expr:
    """Return the difference of the sides of a relation, positive where it is satisfied."""
    expected = "expected a relation such as slider.position[0] <= 0.47 or uqmbd.eigenfrequency(1) >= 2"
    if isinstance(relation, np.ndarray):
        raise StudyError(f"{where}: the relation is {shown(relation)}; {expected}.")
    if relation in (True, False, sympy.true, sympy.false):
        always = "always" if relation in (True, sympy.true) else "never"
        raise StudyError(f"{where}: the relation is {always} satisfied, for every motion; {expected}.")
    if isinstance(relation, (sympy.Equality, sympy.Unequality)):
        raise StudyError(
            f"{where}: the relation is {relation}, and a random quantity equals a value with probability zero; "
            f"{expected}, or two requirements for a band."
        )
    if isinstance(relation, (sympy.And, sympy.Or, sympy.Not)):
        raise StudyError(
            f"{where}: it consists of several relations, {shown(relation)}; state a requirement for each of them. The "
            "probability that any of them is violated is a result, too."
        )
    if not isinstance(relation, (*BELOW, *ABOVE)):
        raise StudyError(f"{where}: it was given {shown(relation)}; {expected}.")
    return relation.rhs - relation.lhs if isinstance(relation, BELOW) else relation.lhs - relation.rhs


def _over_time(margin: sympy.Expr) -> sympy.Expr:
    """Return a margin over time, where it is that of the largest or smallest value alone: the same at all times.

    That ``maximum(x) <= c`` is that ``x <= c`` at all times, which tells until when it held, too.
    """
    extremes = sorted(margin.atoms(Maximum, Minimum), key=str)
    if len(extremes) != 1:
        return margin
    (extreme,) = extremes
    slope, rest = _linear(margin, extreme)
    falls = bool(slope.is_negative if isinstance(extreme, Maximum) else slope.is_positive)
    if not (slope.is_number and falls) or is_scalar(rest) or rest.free_symbols - random_variables(rest):
        return margin
    found: sympy.Expr = rest + slope * extreme.summed
    return found


def _bounds(margin: sympy.Expr) -> int:
    """Return which side a margin is known to be on where a time in it is later than the motion: 1 above, -1 below.

    0: it has several, or is not linear in the one that it has.
    """
    firsts = sorted(margin.atoms(EventTime, FirstTime), key=str)
    slope = _linear(margin, firsts[0])[0] if len(firsts) == 1 else sympy.Integer(0)
    return int(sympy.sign(slope)) if slope.is_number else 0


def _linear(margin: sympy.Expr, part: sympy.Expr) -> tuple[sympy.Expr, sympy.Expr]:
    """Return the slope of a margin over a part of it, and its remainder without that part."""
    held = sympy.Dummy(real=True)
    inner = margin.xreplace({part: held})
    return inner.diff(held), inner.xreplace({held: sympy.Integer(0)})
