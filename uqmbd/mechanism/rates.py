"""Time derivatives of what moves with a mechanism, as expressions for outputs."""

from __future__ import annotations

from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.body import Body, StateSymbol
from uqmbd.mechanism.components import AngleSymbol
from uqmbd.mechanism.expressions import t
from uqmbd.randomness import RandomVariable

__all__ = ["time_derivative"]


def time_derivative(expression: Any) -> sympy.Expr:
    """Return the time derivative of an expression in positions, velocities, angles, time and random variables.

    Parameters
    ----------
    expression : sympy.Expr
        As of an output of a mechanism.

    Returns
    -------
    sympy.Expr
        For an output, in the units of the expression over s.

    Raises
    ------
    uqmbd.StudyError
        If it contains what has no rate that is known: an acceleration, a reaction, a command of a controller.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("falling", uqmbd.Translational(gravity=(0, -10)))
    >>> stone = mechanism.body("stone", mass=1, velocity=(3, 4))
    >>> energy = stone.velocity.dot(stone.velocity) / 2
    >>> mechanism.output("power", uqmbd.time_derivative(energy), units="W")
    >>> uqmbd.simulate(mechanism, [0, 0.2])["power"].values.round(9).tolist()
    [-40.0, -20.0]
    """
    whole = sympy.sympify(expression)
    found: list[sympy.Expr] = []
    for symbol in sorted(whole.free_symbols, key=str):
        if not isinstance(symbol, RandomVariable):
            part = whole.diff(symbol)
            if part != 0:
                found.append(part * _rate(symbol, whole))
    return sympy.Add(*found)


def _rate(symbol: Any, whole: sympy.Expr) -> sympy.Expr:
    if symbol == t:
        return sympy.Integer(1)
    if isinstance(symbol, AngleSymbol):
        return sympy.sympify(symbol.angle.whole(symbol.angle.rate))
    owner = getattr(symbol, "owner", None)
    if isinstance(symbol, StateSymbol) and isinstance(owner, Body):
        if symbol.quantity == "q":
            return owner.v[symbol.index]
        if symbol.quantity == "v":
            return (*owner.acceleration, *owner.quaternion_acceleration)[symbol.index]
        if symbol.quantity == "angular_velocity":
            return sympy.sympify(owner.angular_acceleration)
    raise StudyError(
        f"time_derivative(): the expression is {sympy.sstr(whole)[:200]}, and the rate of {symbol} is not known; "
        "expected positions, velocities, angles, uqmbd.t and random variables."
    )
