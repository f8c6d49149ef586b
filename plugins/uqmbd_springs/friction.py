"""Friction in joints: viscous friction, and Coulomb friction under a given load, which sticks or is smoothed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, overload

import sympy

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Quantity, Vector

__all__ = ["RotationalFriction", "SlidingFriction"]


def _resistance(p: uqmbd.extend.Local, speed: Any) -> Iterator[uqmbd.VirtualWork | uqmbd.extend.DryFriction]:
    """Yield viscous friction against a speed v, and Coulomb friction, smooth with a transition speed."""
    force = -p.damping * speed
    if p.transition != 0:
        force -= p.friction * speed / sympy.sqrt(speed**2 + p.transition**2)
    yield uqmbd.VirtualWork(force, speed)
    if p.transition == 0 and p.friction != 0:
        yield uqmbd.extend.DryFriction(p.friction, speed)


class RotationalFriction(uqmbd.Component):
    """A friction moment that opposes the rotation of body j relative to body i about a common axis.

    The joint sticks up to Coulomb's moment; `event_time` accepts ``stick`` and ``slip``. The moment may be a function
    of time, as for a brake. With a transition speed, friction is smooth, ``friction w / sqrt(w^2 + transition^2)``, and
    has no events: the joint creeps at less than the transition speed instead of sticking. ``integrator="ida"`` needs
    smooth friction. A random transition speed must be positive.

    The static equilibrium is computed without friction; a warning states the range of equilibria with friction.
    Eigenfrequencies and modes are not available if a joint sticks at rest.

    Examples
    --------
    >>> RotationalFriction.signature()
    '(name, body_i, body_j, friction, damping=0, transition=0, axis_i)'
    """

    symbol = "coil"
    spaces = (uqmbd.Spatial, uqmbd.Planar)
    friction = uqmbd.Parameter(
        "N m", "Coulomb's moment: coefficient times constant load times radius; 0: none", minimum=0
    )
    damping = uqmbd.Parameter("N m s/rad", "viscous friction", default=0, minimum=0)
    transition = uqmbd.Parameter(
        "rad/s", "speed at which smooth friction reaches 71 % of its limit; 0: the joint sticks", default=0, minimum=0,
        at_minimum="the joint sticks",
    )  # fmt: skip
    axis_i = uqmbd.Parameter("1", "axis, frame of body i (omit it in planar space)", kind="turning_axis", body="body_i")

    if TYPE_CHECKING:

        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, friction: Quantity, damping: Quantity = 0,
            transition: Quantity = 0, axis_i: Vector = (), *, axis: Vector = (),
        ) -> None: ...  # fmt: skip

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.VirtualWork | uqmbd.extend.DryFriction]:
        """Yield the friction."""
        spin = p.body_j.angular_velocity - p.body_i.angular_velocity
        yield from _resistance(p, spin[0] if p.space.dimension == 2 else spin.dot(p.body_i.direction(p.axis_i)))


class SlidingFriction(uqmbd.Component):
    """A friction force that opposes the sliding of a point of body j along an axis fixed in body i.

    The joint sticks up to Coulomb's force; `event_time` accepts ``stick`` and ``slip``. The force may be a function
    of time, as for a brake. With a transition speed, friction is smooth, ``friction v / sqrt(v^2 + transition^2)``, and
    has no events: the joint creeps at less than the transition speed instead of sticking. ``integrator="ida"`` needs
    smooth friction. A random transition speed must be positive.

    The static equilibrium is computed without friction; a warning states the range of equilibria with friction.
    Eigenfrequencies and modes are not available if a joint sticks at rest.

    Examples
    --------
    >>> SlidingFriction.signature()
    '(name, body_i, body_j, point_i, point_j, axis_i, friction, damping=0, transition=0)'
    """

    symbol = "spring"
    spaces = (*uqmbd.Component.spaces, uqmbd.Line)
    point_i = uqmbd.Parameter("m", "a point of the axis, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "the point that slides, frame of body j", kind="point", body="body_j")
    axis_i = uqmbd.Parameter("1", "direction, frame of body i", kind="axis", body="body_i")
    friction = uqmbd.Parameter("N", "Coulomb's force: coefficient times constant load; 0: none", minimum=0)
    damping = uqmbd.Parameter("N s/m", "viscous friction", default=0, minimum=0)
    transition = uqmbd.Parameter(
        "m/s", "speed at which smooth friction reaches 71 % of its limit; 0: the joint sticks", default=0, minimum=0,
        at_minimum="the joint sticks",
    )  # fmt: skip

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, axis_i: Vector,
            friction: Quantity, damping: Quantity = 0, transition: Quantity = 0,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, *,
            axis: Vector, friction: Quantity, damping: Quantity = 0, transition: Quantity = 0,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis_i: Vector,
            friction: Quantity, damping: Quantity = 0, transition: Quantity = 0,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis: Vector, friction: Quantity,
            damping: Quantity = 0, transition: Quantity = 0,
        ) -> None: ...  # fmt: skip
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.VirtualWork | uqmbd.extend.DryFriction]:
        """Yield the friction."""
        offset = p.let("offset", p.body_j.point(p.point_j) - p.body_i.point(p.point_i))
        axis = p.let("axis", p.body_i.direction(p.axis_i))
        yield from _resistance(p, p.rate_of(axis.dot(offset)))
