"""Rates of quantities of the pose, over time and in modes, as expressions for outputs."""

from __future__ import annotations

from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.bodies import Body, StateSymbol
from uqmbd.mechanism.components import AngleSymbol
from uqmbd.mechanism.expressions import WITHOUT_DERIVATIVE, At, Part, as_symbolic, shape_of_mode, shown, t
from uqmbd.names import checked
from uqmbd.randomness import RandomVariable

__all__ = ["mode_shape", "time_derivative"]


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
    whole = as_symbolic(expression)
    found: list[sympy.Expr] = []
    for symbol in sorted(whole.free_symbols, key=str):
        if not isinstance(symbol, RandomVariable):
            part = whole.diff(symbol)
            if part != 0:
                found.append(part * _rate(symbol, whole))
    return sympy.Add(*found)


@checked
def mode_shape(number: int, quantity: Any, over: Any, at: At = "equilibrium", part: Part = "real") -> sympy.Expr:
    r"""Return the shape of a mode, as the ratio of how far two quantities move in it, for use in an output.

    In a mode of small motions of the constrained mechanism the coordinates change by :math:`\Delta q`, within the
    constraints and up to a factor.  A quantity :math:`g` of the pose changes by :math:`\nabla g \cdot \Delta q`, and
    the factor leaves the ratio of two of them: of positions, angles, distances.  An output with it has one value per
    realisation and no time.

    *Numbering* is that of `uqmbd.eigenfrequency`, and belongs to the place in the order of frequencies: if two modes
    exchange places within the range of the inputs, the ratio jumps from one mode to the other. No polynomial follows
    that. Where frequencies are equal any mix of their modes is a mode: if another frequency comes within a
    ten-millionth of this one, the ratio is not determined. The realisation has then failed, with a status and the
    reason. So has one in whose mode the reference does not move.

    *Damping*: with none, or in proportion to mass and stiffness, the ratio is a real number.  Otherwise the quantities
    pass their extremes one after the other, and the ratio is complex: its real part is what moves in phase with the
    reference, its imaginary part what moves a quarter of a period ahead.

    Parameters
    ----------
    number : int
        Of the mode, from 1.
    quantity, over : SymPy expression
        What moves, and the reference, in positions, angles, time (which is held) and random variables.
    at : {"equilibrium", "start", "steady"}
        About which pose, or motion, as of `uqmbd.eigenfrequency`.  About a steady motion quantities have to be such
        that the ratio stays the same on the way; a realisation in which it changes has failed.
    part : {"real", "imaginary"}
        Which part of the ratio.

    Raises
    ------
    uqmbd.StudyError
        If there cannot be such a mode, or a quantity is not one of the pose.

    Examples
    --------
    Two masses in a row: the outer one moves 1.618 times as far as the inner one in the first mode.

    >>> import uqmbd
    >>> from uqmbd_springs import SpringDamper
    >>> mechanism = uqmbd.Mechanism("row", uqmbd.Line())
    >>> one, two = (mechanism.body(f"mass {k}", mass=1, position=(k,)) for k in (1, 2))
    >>> for k, (a, b) in enumerate([(mechanism.ground, one), (one, two)]):
    ...     spring = mechanism.add(SpringDamper(f"spring {k}", a, b, (0,), (0,), stiffness=9, free_length=1))
    >>> mechanism.output("ratio", uqmbd.mode_shape(1, two.position[0], over=one.position[0]), units="1")
    >>> round(float(uqmbd.simulate(mechanism, [0, 1])["ratio"]), 6)
    1.618034
    """
    shape = shape_of_mode(number, quantity, over, at, part)
    for name, value in zip(("quantity", "over"), shape.moved, strict=True):
        held = {s for s in value.free_symbols if isinstance(s, RandomVariable) or s == t}
        pose = {s for s in value.free_symbols if isinstance(s, AngleSymbol) or getattr(s, "quantity", "") == "q"}
        late = [*sorted(value.free_symbols - held - pose, key=str), *value.atoms(*WITHOUT_DERIVATIVE)]
        if late or not pose:
            what = f"it contains {late[0]}" if late else "it does not depend on the pose"
            raise StudyError(
                f"mode_shape: {name} is {shown(value)}, and {what}; expected an expression in positions and angles, "
                "such as body.position[0], whose change in the mode is meant."
            )
    return shape


def _rate(symbol: Any, whole: sympy.Expr) -> sympy.Expr:
    if symbol == t:
        return sympy.Integer(1)
    if isinstance(symbol, AngleSymbol):
        return as_symbolic(symbol.angle.whole(symbol.angle.rate))
    owner = getattr(symbol, "owner", None)
    if isinstance(symbol, StateSymbol) and isinstance(owner, Body):
        if symbol.quantity == "q":
            return owner.v[symbol.index]
        if symbol.quantity == "v":
            return (*owner.acceleration, *owner.quaternion_acceleration)[symbol.index]
        if symbol.quantity == "angular_velocity":
            return as_symbolic(owner.angular_acceleration)
    raise StudyError(
        f"time_derivative(): the expression is {sympy.sstr(whole)[:200]}, and the rate of {symbol} is not known; "
        "expected positions, velocities, angles, uqmbd.t and random variables."
    )
