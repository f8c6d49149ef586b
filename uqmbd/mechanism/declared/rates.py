"""Time derivatives and mode shapes of quantities of the pose, as expressions for outputs."""

from __future__ import annotations

from typing import Any

import sympy

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.bodies import Body
from uqmbd.mechanism.components import AngleSymbol, CoordinateSet, StateSymbol
from uqmbd.mechanism.expressions import WITHOUT_DERIVATIVE, At, Part, as_symbolic, shape_of_mode, shown, t
from uqmbd.names import checked
from uqmbd.randomness import RandomVariable

__all__ = ["mode_shape", "time_derivative"]


@typechecked(values=False)
def time_derivative(expression: Any) -> sympy.Expr:
    """Return the time derivative of an expression in positions, velocities, angles, time and random variables.

    Parameters
    ----------
    expression : sympy.Expr
        Expression as in an output of a mechanism.

    Returns
    -------
    sympy.Expr
        Time derivative for an output, in the units of the expression divided by s.

    Raises
    ------
    uqmbd.StudyError
        If the expression contains quantities without a known rate: accelerations, reactions, commands of a controller.

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
    r"""Return the shape of a mode as the ratio of the amplitudes of two quantities, for use in an output.

    In a mode of small motions of the constrained mechanism, the coordinates change by :math:`\Delta q`. This change
    satisfies the constraints and is known up to a factor.  A quantity :math:`g` of the pose, such as a position, an
    angle or a distance, changes by :math:`\nabla g \cdot \Delta q`. The factor cancels in the ratio of two quantities.
    The output has one value per realisation and no time.

    *Numbering*: modes are numbered as in `uqmbd.eigenfrequency`, by the rank of the frequency. If two modes exchange
    ranks within the range of the inputs, the ratio jumps from one mode to the other. No polynomial represents such a
    jump. If several frequencies are equal, every linear combination of their modes is also a mode, and the ratio is
    undetermined. A realisation therefore fails, with a status and the reason, if the relative difference to another
    frequency is below 1e-7. A realisation also fails if the reference quantity does not change in the mode.

    *Damping*: without damping, or with damping in proportion to mass and stiffness, the ratio is real.  Otherwise the
    quantities reach their extremes at different times, and the ratio is complex. The real part of the ratio is in phase
    with the reference quantity. The imaginary part leads the reference quantity by a quarter of a period.

    Parameters
    ----------
    number : int
        Number of the mode, from 1.
    quantity, over : SymPy expression
        Quantity of interest and reference quantity, in positions, angles, time and random variables. Time is held
        constant.
    at : {"equilibrium", "start", "steady"}
        State about which the motion is linearised, as for `uqmbd.eigenfrequency`. About a steady motion the ratio must
        be constant in time; otherwise the realisation fails.
    part : {"real", "imaginary"}
        Part of the complex ratio.

    Raises
    ------
    uqmbd.StudyError
        If the number is invalid, or a quantity depends on more than the pose.

    Examples
    --------
    In the first mode of two masses in a row, the outer mass moves 1.618 times as far as the inner mass.

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
                "such as body.position[0]."
            )
    return shape


def _rate(symbol: Any, whole: sympy.Expr) -> sympy.Expr:
    if symbol == t:
        return sympy.Integer(1)
    if isinstance(symbol, AngleSymbol):
        return as_symbolic(symbol.angle.whole(symbol.angle.rate))
    owner = getattr(symbol, "owner", None)
    if isinstance(symbol, StateSymbol) and isinstance(owner, CoordinateSet) and symbol.quantity in ("q", "v"):
        return (owner.v if symbol.quantity == "q" else owner.a)[symbol.index]
    if isinstance(symbol, StateSymbol) and isinstance(owner, Body):
        if symbol.quantity == "q":
            return owner.v[symbol.index]
        if symbol.quantity == "v":
            return (*owner.acceleration, *owner.quaternion_acceleration)[symbol.index]
        if symbol.quantity == "angular_velocity":
            return as_symbolic(owner.angular_acceleration)
    raise StudyError(
        f"time_derivative(): the expression is {sympy.sstr(whole)[:200]}, but the rate of {symbol} is unknown; "
        "expected positions, velocities, angles, uqmbd.t and random variables."
    )
