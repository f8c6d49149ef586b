"""Scalar quantities in output expressions: properties of modes, values at equilibrium and in steady motion."""

from __future__ import annotations

import operator
from typing import Any, Literal, Self, get_args

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions.computable import Placeholder
from uqmbd.mechanism.expressions.time import t
from uqmbd.mechanism.expressions.user_values import as_symbolic, flatten, shown
from uqmbd.names import checked
from uqmbd.randomness import RandomVariable, Symbol, Symbolic

__all__ = [
    "AtEquilibrium",
    "AtSteady",
    "EventTime",
    "ModeShape",
    "MotionSymbol",
    "ScalarSymbol",
    "at_equilibrium",
    "at_steady",
    "check_scalar",
    "damping_ratio",
    "eigenfrequency",
    "is_scalar",
    "shape_of_mode",
    "single",
]

At = Literal["equilibrium", "start", "steady"]
AT: tuple[At, ...] = get_args(At)
Part = Literal["real", "imaginary"]
PARTS: tuple[Part, ...] = get_args(Part)


class ScalarSymbol(Symbolic, Symbol):
    """Symbol of a scalar quantity of a realisation, independent of output times; symbols with equal names are equal.

    `quantity` is ``frequency`` or ``damping_ratio``, `number` is the number of the mode, and `at` is the pose of the
    linearisation.
    """

    quantity: str
    number: int
    at: str

    def __new__(cls, name: str, quantity: str, number: int = 0, at: str = "") -> Self:
        """Make a symbol that stores its arguments as attributes."""
        self: Self = sympy.Symbol.__xnew__(cls, name, real=True)
        self.quantity, self.number, self.at = quantity, number, at
        self.units = {"frequency": "Hz", "damping_ratio": "1"}.get(quantity, "")
        return self

    def __init__(self, *args: Any) -> None:
        """Accept the arguments of ``__new__``."""

    def _hashable_content(self) -> tuple[Any, ...]:
        return (*super()._hashable_content(), "uqmbd scalar")


class MotionSymbol(ScalarSymbol):
    """Symbol of a scalar result of an integration in addition to its states, such as the time of an event.

    Integrators return the scalar in ``Trajectories.scalars`` under the name of the symbol.
    """

    def __new__(cls, name: str) -> Self:
        """Make a symbol with this name."""
        return super().__new__(cls, name, "motion")


def event_name(component: str, label: str, number: int) -> str:
    """Return the name under which the results of a motion contain the time of an event."""
    return f"{component}: {label} {number}"


class EventTime(MotionSymbol):
    """The time of an event of a component."""

    component: Any
    label: str

    def __new__(cls, component: Any, label: str, number: int) -> Self:
        """Make a symbol that stores its arguments as attributes."""
        self = super().__new__(cls, event_name(component.name, label, number))
        self.component, self.label = component, label
        self.units = "s"
        return self

    def _hashable_content(self) -> tuple[Any, ...]:
        return (*super()._hashable_content(), id(self.component))


class AtEquilibrium(Placeholder, sympy.Function):
    """The value of an expression at the static equilibrium of a realisation."""

    nargs = 1
    is_real = True


class AtSteady(Placeholder, sympy.Function):
    """The value of an expression in the steady motion of a realisation."""

    nargs = 1
    is_real = True


class ModeShape(Placeholder, sympy.Function):
    """Ratio of the amplitudes of two expressions of the pose in a mode."""

    nargs = 5
    is_real = True

    @property
    def moved(self) -> tuple[sympy.Expr, sympy.Expr]:
        """The two expressions of the ratio."""
        return self.args[0], self.args[1]

    @property
    def number(self) -> int:
        """Number of the mode, from 1."""
        return int(self.args[2])

    @property
    def at(self) -> At:
        """Pose of the linearisation."""
        return AT[int(self.args[3])]

    @property
    def part(self) -> Part:
        """Part of the complex ratio."""
        return PARTS[int(self.args[4])]

    def _sympystr(self, printer: Any) -> str:
        quantity, over = (printer.doprint(x) for x in self.moved)
        pose = "" if self.at == "equilibrium" else f", {self.at}"
        part = "" if self.part == "real" else f", {self.part}"
        return f"mode_shape({self.number}, {quantity}, over={over}{pose}{part})"


def shape_of_mode(number: Any, quantity: Any, over: Any, at: Any, part: Any) -> ModeShape:
    """Return the symbol for the shape of a mode, or raise; see `uqmbd.mode_shape`."""
    count = _number("mode_shape", number, at)
    if not isinstance(part, str) or part not in PARTS:
        raise StudyError(f"mode_shape: part is {shown(part)}; expected 'real' or 'imaginary'.")
    moved = [single("mode_shape", x, "1, body.position[0], over=other.position[0]") for x in (quantity, over)]
    return ModeShape(*moved, sympy.Integer(count), sympy.Integer(AT.index(at)), sympy.Integer(PARTS.index(part)))


@checked
def eigenfrequency(number: int, at: At = "equilibrium") -> sympy.Expr:
    """Return the natural frequency of a mode, in Hz, for use in an output.

    The frequency of small motions of the constrained mechanism is ``|eigenvalue| / 2 pi``; see
    `uqmbd.eigenfrequencies`.  With proportional damping, this frequency equals the undamped frequency; with other
    damping, it equals the undamped frequency only approximately.  An output of a natural frequency has one value per
    realisation and no time.

    *Numbering*: oscillating modes are numbered from 1 by ascending frequency.  Rigid-body modes, which have zero
    frequency, and modes that decay or grow without oscillation have no number.  A realisation with fewer than `number`
    modes fails, with a status and a reason.  The number is the rank of the frequency and does not follow the shape of
    the mode.  If two modes exchange ranks within the range of the inputs, both frequencies have a kink as functions of
    the inputs, and polynomials converge slowly.

    Parameters
    ----------
    number : int
        Number of the mode, from 1.
    at : {"equilibrium", "start", "steady"}
        State about which the motion is linearised, with time fixed at the first output time. ``equilibrium``: the
        static equilibrium of the realisation, found from its initial pose; a realisation without an equilibrium fails.
        ``start``: the initial pose, at rest. The initial pose is the assembled given pose, or the equilibrium with
        ``Study(start="equilibrium")``. ``steady``: the steady motion (see `uqmbd.at_steady`), in which drivers
        continue. In steady motion, frequencies refer to the world frame if the coefficients of small motions are
        constant in this frame (a rotor in its bearings). Otherwise frequencies refer to the frame that turns with the
        bodies (a pendulum on a turning shaft).

    Raises
    ------
    uqmbd.StudyError
        If the number or the state is invalid.

    Examples
    --------
    >>> import numpy as np, uqmbd
    >>> from uqmbd_springs import SpringDamper
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
    >>> mass = mechanism.body("mass", mass=2, position=(1, 0))
    >>> spring = mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), stiffness=8))
    >>> mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    >>> round(float(uqmbd.simulate(mechanism, [0, 1])["frequency"]), 6)
    0.31831
    """
    return _modal("eigenfrequency", "frequency", number, at)


@checked
def damping_ratio(number: int, at: At = "equilibrium") -> sympy.Expr:
    """Return the damping ratio of a mode, ``-Re(eigenvalue) / |eigenvalue|``, for use in an output.

    Modes are numbered by ascending frequency, as in `uqmbd.eigenfrequency`.

    Parameters
    ----------
    number : int
        Number of the mode, from 1.
    at : {"equilibrium", "start", "steady"}
        State about which the motion is linearised, as for `uqmbd.eigenfrequency`.

    Raises
    ------
    uqmbd.StudyError
        If the number or the state is invalid.

    Examples
    --------
    >>> damping_ratio(1) / 2
    damping_ratio(1)/2
    """
    return _modal("damping_ratio", "damping_ratio", number, at)


@checked
def at_equilibrium(expression: Any) -> sympy.Expr:
    """Return the value of an expression at the static equilibrium of a realisation, for use in an output.

    The search for the equilibrium begins at the initial pose of the realisation, at rest, as in
    `uqmbd.static_equilibrium`.  Time is fixed at the first output time.  The output has one value per realisation and
    no time.

    Parameters
    ----------
    expression : SymPy expression
        Expression in quantities that an output may contain: positions, reactions, random variables ...

    Raises
    ------
    uqmbd.StudyError
        If `expression` is not a single expression, or already contains a scalar output.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_springs import SpringDamper
    >>> mechanism = uqmbd.Mechanism("balance", uqmbd.Translational(gravity=(0, -10)))
    >>> pan = mechanism.body("pan", mass=2, position=(0, -1))
    >>> spring = mechanism.add(SpringDamper("spring", mechanism.ground, pan, (0, 0), (0, 0), 100, free_length=1))
    >>> mechanism.output("sag", -1 - uqmbd.at_equilibrium(pan.position[1]), units="m")
    >>> round(float(uqmbd.simulate(mechanism, [0, 1])["sag"]), 9)
    0.2
    """
    found: sympy.Expr = AtEquilibrium(single("at_equilibrium", expression))
    return found


@checked
def at_steady(expression: Any) -> sympy.Expr:
    """Return the value of an expression in the steady motion of a realisation, for use in an output.

    In a steady motion, drivers continue at constant speeds and the mechanism keeps its shape. An example is a governor
    whose balls stay at a constant angle. Newton's method finds the shape, starting from the initial state of the
    realisation. The search does not change speeds of drivers, stated velocities and start conditions of velocities. All
    other bodies move with the bodies that carry them. The steady motion may be unstable. If the stated velocities
    already give a steady motion, such as the precession of a top, the initial state is used unchanged. The whirl of an
    unbalanced rotor has no driver. Newton's method finds a whirl only if the initial pose and velocities of all bodies
    belong to this whirl. Speeds of drivers and loads must be constant from the start; a change within 10 s or three
    turns is an error. A realisation fails, with a reason, if it has no steady motion or if the expression changes
    during the steady motion. The output has one value per realisation and no time.

    Parameters
    ----------
    expression : SymPy expression
        Expression in quantities that are constant in the steady motion: relative angles, heights, speeds, magnitudes of
        reactions.

    Raises
    ------
    uqmbd.StudyError
        If `expression` is not a single expression, or already contains a scalar output.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_drivers import RotationDriver
    >>> from uqmbd_springs import SpringDamper
    >>> from uqmbd_joints import PointOnLine, Revolute
    >>> mechanism = uqmbd.Mechanism("turntable", uqmbd.Planar())
    >>> table = mechanism.body("table", mass=1, inertia=1)
    >>> ball = mechanism.body("ball", mass=1, inertia=1, position=(1, 0))
    >>> driver = mechanism.add(RotationDriver("motor", mechanism.ground, table, angle=2 * uqmbd.t))
    >>> groove = mechanism.add(PointOnLine("groove", table, ball, (0, 0), (0, 0), axis_i=(1, 0)))
    >>> axle = mechanism.add(Revolute("axle", mechanism.ground, table, (0, 0), (0, 0)))
    >>> spring = mechanism.add(SpringDamper("spring", table, ball, (0, 0), (0, 0), stiffness=9, free_length=1))
    >>> mechanism.output("radius", uqmbd.at_steady(ball.position.norm()), units="m")
    >>> round(float(uqmbd.simulate(mechanism, [0, 1])["radius"]), 6)
    1.8
    """
    found: sympy.Expr = AtSteady(single("at_steady", expression))
    return found


def single(function: str, expression: Any, example: str = "body.position[0]") -> sympy.Expr:
    """Return the argument of a scalar quantity; raise if it is not one expression or contains scalar quantities."""
    parts = flatten(expression)
    try:
        value = as_symbolic(parts[0]) if len(parts) == 1 else None
    except StudyError:
        value = None
    if not isinstance(value, sympy.Expr):
        raise StudyError(
            f"{function}: the argument is {shown(expression)}; expected one expression, e.g. "
            f"uqmbd.{function}({example})."
        )
    if value.is_number:
        raise StudyError(
            f"{function}: the argument is the constant {shown(value)}, which is equal in every pose. Expected an "
            f"expression of the motion, e.g. uqmbd.{function}(body.position[0]). Write a number without {function}."
        )
    if is_scalar(value):
        raise StudyError(
            f"{function}: the argument is {shown(value)}, which already contains a scalar output. Apply {function} "
            "to positions and reactions only, and combine the results."
        )
    return value


def is_scalar(value: Any) -> bool:
    """Return whether an expression contains a scalar quantity, which is independent of time.

    >>> is_scalar(2 * eigenfrequency(1)), is_scalar(sympy.pi)
    (True, False)
    """
    return isinstance(value, sympy.Basic) and bool(value.atoms(ScalarSymbol, Placeholder))


def check_scalar(where: str, value: sympy.Expr) -> None:
    """Raise if an expression with a scalar quantity also contains a quantity that changes with time."""
    held = {e: sympy.Dummy() for e in value.atoms(Placeholder)}
    outside = value.xreplace(held).free_symbols - set(held.values())
    moving = sorted((s for s in outside if not isinstance(s, (ScalarSymbol, RandomVariable))), key=str)
    if not moving:
        return
    named = "time" if moving[0] == t else str(moving[0])
    raise StudyError(
        f"{where}: the expression combines {named}, which changes during the motion, with a quantity that has one "
        f"value per realisation. Write uqmbd.at_equilibrium({moving[0]}) for the value at rest, or "
        f"uqmbd.at_steady({moving[0]}) for the value in steady motion. uqmbd.maximum({moving[0]}) and "
        f"uqmbd.final({moving[0]}) are values of the whole motion. Or declare separate outputs."
    )


MOST_MODES = 10**6
"""Upper limit of mode numbers; every mechanism that can be assembled has fewer modes."""


def _modal(function: str, quantity: str, number: Any, at: Any) -> sympy.Expr:
    count = _number(function, number, at)
    pose = "" if at == "equilibrium" else f", {at}"
    return ScalarSymbol(f"{function}({count}{pose})", quantity, count, at)


def _number(function: str, number: Any, at: Any) -> int:
    """Return the number of a mode; raise if the number or the pose is invalid."""
    try:
        count = operator.index(number)
    except TypeError:
        count = 0
    if isinstance(number, bool) or not 1 <= count <= MOST_MODES:
        raise StudyError(
            f"{function}: the number of the mode is {shown(number)}; expected 1 for the lowest frequency above zero, "
            "2 for the next, ..."
        )
    if not isinstance(at, str) or at not in AT:
        raise StudyError(f"{function}: at is {shown(at)}; expected 'equilibrium', 'start' or 'steady'.")
    return count
