"""Motion quantities of components: angles counted over any number of turns, displacements, and their rates.

Length: each public name has an example, and each example needs a component.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import sympy

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.components.coordinates import pairs_of
from uqmbd.mechanism.expressions import as_symbolic, flatten
from uqmbd.mechanism.geometry import (
    Frame,
    NamedFrame,
    angle_at_start,
    continued,
    joint_frames,
    nominal,
    quaternion_product,
    relative_quaternion,
)
from uqmbd.names import did_you_mean
from uqmbd.randomness import RandomVariable, Symbol, Symbolic
from uqmbd.wording import place_of

__all__ = [
    "VOCABULARY",
    "AngleSymbol",
    "JointAngle",
    "JointDisplacement",
    "angle_between",
    "angle_from_drawn",
    "angles_in",
    "in_words",
    "motion_values",
    "motion_quantities",
    "motion_quantity",
]

VOCABULARY = ("angle", "speed", "displacement", "sliding_speed")
"""Names of the motion quantities of joints with one angle and one displacement."""

HALF_TURN = 1e-9
"""Rounding error, in turns, of a given angle of half a turn; within this error the angle starts at +pi."""


@typechecked
@dataclass(frozen=True)
class JointAngle:
    """Angle between bodies, determined up to whole turns by a pair of expressions.

    Parameters
    ----------
    cosine, sine : expression
        Cosine and sine of the angle or half the angle, up to a common positive factor. The expressions are in random
        variables and coordinates of the bodies, as from ``self.attached["body_i"].direction(...)``.
    half : bool
        Whether `cosine` and `sine` belong to half the angle, as in quaternions.
    signed : bool
        Whether the common sign of a half-angle pair has a meaning. In planar space, the sign distinguishes odd from
        even numbers of turns.
    near : expression
        Angle near the initial angle, rad, as a number or an expression in random variables. This angle selects the turn
        of the initial angle.
    rate : expression, optional
        Rate of the angle, rad/s, in coordinates and velocities. None: derived from cosine and sine.
    speed : str
        Name of the rate of the angle.
    constants : mapping
        Expression in random variables for each further symbol in cosine, sine and rate. The expressions are evaluated
        once for each realisation.

    Examples
    --------
    Angle of a body with a pin in a slot:

    >>> import uqmbd
    >>> class PinInSlot(uqmbd.Component):
    ...     spaces = (uqmbd.Planar,)
    ...     axis_i = uqmbd.Parameter("1", "direction of the slot, frame of body i", kind="axis")
    ...     axis_j = uqmbd.Parameter("1", "direction on the pin's body, its frame", kind="axis")
    ...     def motion(self):
    ...         i, j = self.attached["body_i"], self.attached["body_j"]
    ...         x, y = i.direction(self.axis_i), i.direction((-self.axis_i[1], self.axis_i[0]))
    ...         pointer = j.direction(self.axis_j)
    ...         return {"angle": uqmbd.extend.JointAngle(x.dot(pointer), y.dot(pointer))}
    ...     def terms(self, p):
    ...         return []
    >>> mechanism = uqmbd.Mechanism("slotted", uqmbd.Planar())
    >>> body = mechanism.body("body", mass=1, inertia=1)
    >>> pin = mechanism.add(PinInSlot("pin", mechanism.ground, body, (1, 0), (1, 0)))
    >>> pin.angle
    pin.angle
    """

    cosine: Any
    sine: Any
    half: bool = False
    signed: bool = False
    near: Any = 0
    rate: Any = None
    speed: str = "speed"
    constants: Mapping[sympy.Symbol, Any] = field(default_factory=dict)

    @property
    def parts(self) -> int:
        """Ratio of this angle to the angle whose cosine and sine are given: 2 for half angles, else 1."""
        return 2 if self.half else 1

    @property
    def period(self) -> sympy.Expr:
        """Period of the angle, rad: two turns if the sign of a half-angle pair has a meaning, otherwise one turn."""
        return 4 * sympy.pi if self.half and self.signed else 2 * sympy.pi

    def at_start(self, cosine: Any, sine: Any, near: Any) -> sympy.Expr:
        """Return the angle nearest to `near`, from cosine and sine; the result is smooth close to `near`.

        Parameters
        ----------
        cosine, sine : expression
            Cosine and sine of the angle, or of half of it.
        near : expression
            Angle near the result, rad.

        Returns
        -------
        expression
            Angle, rad.
        """
        return angle_at_start(cosine, sine, near, half=self.half, signed=self.signed)

    def continued(self, counted: Any, cosine: Any, sine: Any) -> sympy.Expr:
        """Return the angle nearest to `counted`, from cosine and sine; the result is smooth for any number of turns.

        Parameters
        ----------
        counted : expression
            Counted angle, rad, with any number of turns.
        cosine, sine : expression
            Cosine and sine of the angle, or of half of it.

        Returns
        -------
        expression
            Angle, rad.
        """
        return continued(counted, cosine, sine, half=self.half)

    def nearest(self, angle: Any, cosine: Any, sine: Any) -> sympy.Expr:
        """Return the angle nearest to `angle`, from numeric cosine and sine; equal to `continued` up to rounding.

        Parameters
        ----------
        angle : expression
            Angle near the result, rad, with any number of turns.
        cosine, sine : expression
            Cosine and sine of the angle, or of half of it.

        Returns
        -------
        expression
            Angle, rad.
        """
        raw = self.parts * sympy.atan2(sine, cosine)
        return raw + self.period * sympy.floor((angle - raw) / self.period + sympy.Rational(1, 2))

    def whole(self, expression: Any) -> sympy.Expr:
        """Replace the constants in an expression by their definitions."""
        return as_symbolic(expression).xreplace({k: as_symbolic(x) for k, x in self.constants.items()})


@typechecked
@dataclass(frozen=True)
class JointDisplacement:
    """Displacement between bodies along a line or an axis.

    Parameters
    ----------
    expression : expression
        Displacement, m, in coordinates of the bodies of the component and random variables.
    speed : str
        Name of the rate of the displacement.

    Examples
    --------
    A slider along an axis of the ground:

    >>> import uqmbd
    >>> class Rail(uqmbd.Component):
    ...     bodies, spaces = ("body",), (uqmbd.Translational,)
    ...     def motion(self):
    ...         return {"displacement": uqmbd.extend.JointDisplacement(self.attached["body"].position[0])}
    ...     def terms(self, p):
    ...         yield uqmbd.Constraint(p.body.position[1])
    >>> mechanism = uqmbd.Mechanism("slide", uqmbd.Translational())
    >>> mass = mechanism.body("mass", mass=1, velocity=(2, 0))
    >>> rail = mechanism.add(Rail("rail", mass))
    >>> mechanism.output("way", rail.displacement, units="m")
    >>> mechanism.output("speed", rail.speed, units="m/s")
    >>> motion = uqmbd.simulate(mechanism, [0, 1.5])
    >>> round(float(motion["way"][-1]), 6), round(float(motion["speed"][-1]), 6)
    (3.0, 2.0)
    """

    expression: Any
    speed: str = "speed"


def angle_between(
    i: Frame, j: Frame, axes: Sequence[Sequence[Any]], start: Sequence[Any], drawn: Any, speed: str
) -> JointAngle:
    """Return the angle of frame j relative to frame i about a common axis; it is zero if the joint frames coincide.

    `axes` contains one unit vector for each frame, and is empty in planar space; `start` is the given relative
    quaternion. In planar space, `drawn` is the given angle, rad. In three dimensions, the initial angle is within half
    a turn of zero.
    """
    if i.space.dimension == 2:
        cosine, sine = relative_quaternion(i.quaternion, j.quaternion)
        rate = as_symbolic(_spin(j)[0] - _spin(i)[0])
        return JointAngle(cosine, sine, half=True, signed=True, near=drawn, rate=rate, speed=speed)
    frames = joint_frames(*axes)
    turned = relative_quaternion(frames[0], quaternion_product(start, frames[1]))
    c, s = (nominal(turned[k]) for k in (0, 3))
    half_turns = math.atan2(s, c) / math.pi
    near = 2 * math.pi * (half_turns - math.ceil(half_turns - 0.5 - HALF_TURN))
    held = sympy.symbols("_k0:11", real=True)
    r = relative_quaternion(i.attitude(held[:4]), j.attitude(held[4:8]))
    rate = (_spin(j) - _spin(i)).dot(i.rotation * sympy.Matrix(held[8:]))
    values = dict(zip(held, (*frames[0], *frames[1], *axes[0]), strict=True))
    return JointAngle(r[0], r[3], half=True, near=near, rate=rate, speed=speed, constants=values)


def angle_from_drawn(i: Frame, j: Frame, axis_j: Sequence[Any], start: Sequence[Any], speed: str) -> JointAngle:
    """Return the rotation angle of frame j relative to frame i since the given pose, about an axis fixed in frame j.

    The rate follows from cosine and sine, because this component need not fix the axis in frame i.
    """
    held = sympy.symbols("_k0:7", real=True)
    r = relative_quaternion(i.attitude(held[: len(start)]), j.quaternion)
    if i.space.dimension == 2:
        constants = dict(zip(held, start, strict=False))
        return JointAngle(r[0], r[1], half=True, signed=True, speed=speed, constants=constants)
    sine = sympy.Matrix(r[1:]).dot(sympy.Matrix(held[4:]))
    return JointAngle(r[0], sine, half=True, speed=speed, constants=dict(zip(held, (*start, *axis_j), strict=True)))


def _spin(frame: Frame) -> sympy.Matrix:
    """Return the angular velocity in coordinates and rates, as a column, also in planar space."""
    return frame.space.angular_velocity(frame.quaternion, frame.quaternion_rate)


class AngleSymbol(Symbolic, Symbol):
    """Symbol of an angle in outputs, parameters and laws, counted over any number of turns.

    `owner` is the body or component of the angle.
    """

    owner: Any
    angle: JointAngle

    def __new__(cls, owner: Any, name: str, angle: JointAngle) -> AngleSymbol:
        """Make a symbol that stores its owner and its angle."""
        self: AngleSymbol = sympy.Symbol.__xnew__(cls, name, real=True)
        self.owner, self.angle, self.units = owner, angle, "rad"
        return self

    def __init__(self, *args: Any) -> None:
        """Accept the arguments of ``__new__``."""

    def _hashable_content(self) -> tuple[Any, ...]:
        return (*super()._hashable_content(), id(self.owner))

    @property
    def states(self) -> set[sympy.Symbol]:
        """Coordinates and velocities on which the angle and its rate depend."""
        angle = self.angle
        found = {s for x in (angle.cosine, angle.sine, angle.rate) for s in as_symbolic(x).free_symbols}
        return {s for s in found - set(angle.constants) if not isinstance(s, RandomVariable)}


def angles_in(values: Iterable[Any]) -> list[AngleSymbol]:
    """Return the counted angles in values, ordered by name."""
    symbols = {s for value in values for part in flatten(value) for s in getattr(part, "free_symbols", ())}
    return sorted((s for s in symbols if isinstance(s, AngleSymbol)), key=str)


class HasMotion(Protocol):
    """Component, with the attributes that motion quantities need."""

    name: str
    settled: int

    @property
    def attached(self) -> Mapping[str, Any]: ...

    def motion(self) -> Mapping[str, JointAngle | JointDisplacement | None]: ...


def motion_quantities(component: HasMotion) -> dict[str, tuple[sympy.Expr, str]]:
    """Return the motion quantities of an added component: (expression, units) by name.

    Raises `uqmbd.StudyError` if the method `motion` fails or returns an invalid value.
    """
    found: dict[str, tuple[sympy.Expr, str]] | None = vars(component).get("_quantities")
    if found is None:
        where = f"{type(component).__name__} {component.name!r}"
        try:
            motion = dict(component.motion())
        except StudyError as error:
            raise StudyError(f"{where}: {error}") from None
        except Exception as error:
            raise StudyError(
                f"{where}: motion() raised {type(error).__name__}: {error}{place_of(error)}. Expected a mapping from "
                "names to uqmbd.extend.JointAngle or uqmbd.extend.JointDisplacement."
            ) from error
        found = vars(component)["_quantities"] = motion_values(component, where, motion, component.attached.values())
    return found


def motion_quantity(component: HasMotion, name: str) -> sympy.Expr:
    """Return the expression of a motion quantity of a component by name.

    Raises AttributeError, with the known names, if the quantity does not exist. Raises `uqmbd.StudyError` if the
    component has not been added to a mechanism, or if its method `motion` is invalid.
    """
    kind = type(component).__name__
    found = motion_quantities(component) if component.settled else {}
    if name in found:
        return found[name][0]
    if name not in VOCABULARY:
        near = did_you_mean(name, [*found, *dir(type(component)), *vars(component)])
        raise AttributeError(f"{kind!r} object has no attribute {name!r}{near}", obj=component)
    if not component.settled:
        raise StudyError(
            f"{kind} {component.name!r}: .{name} is used before the joint was added to a mechanism; call "
            "mechanism.add(...) with the joint first."
        )
    raise AttributeError(f"{kind} {component.name!r} has no .{name}: {in_words(found)}.")


def motion_values(
    owner: HasMotion,
    where: str,
    motion: Mapping[str, JointAngle | JointDisplacement | None],
    frames: Iterable[NamedFrame],
) -> dict[str, tuple[sympy.Expr, str]]:
    """Return an expression and its units for each motion quantity of a component, by name.

    Raises `uqmbd.StudyError` if two quantities have the same name. Raises it also if an expression contains a symbol
    that is neither random nor a coordinate of one of the bodies `frames`.
    """
    flow = {x: dx for frame in frames for x, dx in frame.rates.items()} | dict(pairs_of(owner).values())

    def rate(expression: sympy.Expr) -> sympy.Expr:
        return sympy.Add(*(expression.diff(x) * dx for x, dx in flow.items()))

    def known(what: str, expression: Any, constants: Iterable[sympy.Symbol] = (), *, moving: bool = False) -> Any:
        value = as_symbolic(expression)
        allowed = {*flow, *constants, *(flow.values() if moving else ())}
        strangers = [s for s in value.free_symbols if s not in allowed and not isinstance(s, RandomVariable)]
        if strangers:
            raise StudyError(
                f"{where}: motion(): {what} contains {min(map(str, strangers))}; expected coordinates of the bodies, "
                f'as in self.attached["{next(iter(owner.attached), "body")}"].position, and random variables.'
            )
        return value

    found: dict[str, tuple[sympy.Expr, str]] = {}

    def put(name: str, value: sympy.Expr, units: str) -> None:
        if name in found:
            raise StudyError(
                f"{where}: motion() returns {name!r} twice; give each motion and each speed a different name."
            )
        found[name] = value, units

    for name, declared in motion.items():
        if isinstance(declared, JointAngle):
            cosine, sine = (
                known(f"the angle {name!r}", x, declared.constants) for x in (declared.cosine, declared.sine)
            )
            if declared.rate is None:
                turned = (cosine * rate(sine) - sine * rate(cosine)) / (cosine**2 + sine**2)
                speed = declared.parts * turned
            else:
                speed = known(f"the rate of {name!r}", declared.rate, declared.constants, moving=True)
            angle = JointAngle(
                cosine,
                sine,
                declared.half,
                declared.signed,
                as_symbolic(declared.near),
                speed,
                declared.speed,
                declared.constants,
            )
            put(name, AngleSymbol(owner, f"{owner.name}.{name}", angle), "rad")
            put(declared.speed, declared.whole(speed), "rad/s")
        elif isinstance(declared, JointDisplacement):
            value = known(f"the displacement {name!r}", declared.expression)
            put(name, value, "m")
            put(declared.speed, rate(value), "m/s")
        elif declared is not None:
            raise StudyError(
                f"{where}: motion() returned {declared!r} for {name!r}; expected uqmbd.extend.JointAngle(cosine, "
                "sine) or uqmbd.extend.JointDisplacement(expression)."
            )
    return found


def in_words(found: Mapping[str, tuple[sympy.Expr, str]]) -> str:
    """List the motion quantities of a component, as the end of a sentence."""
    if not found:
        return "the component defines no motion quantities"
    words = [f".{name} ({units})" for name, (_, units) in found.items()]
    return f"its motion quantities are {' and '.join(filter(None, (', '.join(words[:-1]), words[-1])))}"
