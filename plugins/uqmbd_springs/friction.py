"""Friction in joints: viscous friction, and smoothed Coulomb friction under a constant load."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, overload

import sympy

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Quantity, Vector

__all__ = ["RotationalFriction", "SlidingFriction"]


def _smooth(p: uqmbd.extend.Local, speed: Any) -> uqmbd.VirtualWork:
    """Return the virtual work of friction: ``damping v + friction v / sqrt(v^2 + transition^2)`` against speed v."""
    return uqmbd.VirtualWork(-p.damping * speed - p.friction * speed / sympy.sqrt(speed**2 + p.transition**2), speed)


class RotationalFriction(uqmbd.Component):
    """A friction moment that opposes the rotation of body j relative to body i about a common axis.

    Coulomb friction is smoothed: ``friction w / sqrt(w^2 + transition^2)``. Instead of sticking, the joint creeps at
    less than the transition speed. A lower transition speed is more accurate and more expensive to integrate.

    Examples
    --------
    >>> RotationalFriction.signature()
    '(name, body_i, body_j, friction, damping=0, transition=0.01, axis_i)'
    """

    symbol = "coil"
    spaces = (uqmbd.Spatial, uqmbd.Planar)
    friction = uqmbd.Parameter(
        "N m", "Coulomb's moment: coefficient times constant load times radius; 0: none", minimum=0
    )
    damping = uqmbd.Parameter("N m s/rad", "viscous friction", default=0, minimum=0)
    transition = uqmbd.Parameter(
        "rad/s", "speed at which 71 % of Coulomb's moment act", default=0.01, minimum=0, exclusive=True
    )
    axis_i = uqmbd.Parameter("1", "axis, frame of body i (omit it in planar space)", kind="turning_axis", body="body_i")

    if TYPE_CHECKING:

        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, friction: Quantity, damping: Quantity = 0,
            transition: Quantity = 0.01, axis_i: Vector = (), *, axis: Vector = (),
        ) -> None: ...  # fmt: skip

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.VirtualWork]:
        """Yield the dissipation."""
        spin = p.body_j.angular_velocity - p.body_i.angular_velocity
        yield _smooth(p, spin[0] if p.space.dimension == 2 else spin.dot(p.body_i.direction(p.axis_i)))


class SlidingFriction(uqmbd.Component):
    """A friction force that opposes the sliding of a point of body j along an axis fixed in body i.

    Coulomb friction is smoothed: ``friction v / sqrt(v^2 + transition^2)``. Instead of sticking, the joint creeps at
    less than the transition speed. A lower transition speed is more accurate and more expensive to integrate.

    Examples
    --------
    >>> SlidingFriction.signature()
    '(name, body_i, body_j, point_i, point_j, axis_i, friction, damping=0, transition=0.01)'
    """

    symbol = "spring"
    spaces = (*uqmbd.Component.spaces, uqmbd.Line)
    point_i = uqmbd.Parameter("m", "a point of the axis, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "the point that slides, frame of body j", kind="point", body="body_j")
    axis_i = uqmbd.Parameter("1", "direction, frame of body i", kind="axis", body="body_i")
    friction = uqmbd.Parameter("N", "Coulomb's force: coefficient times constant load; 0: none", minimum=0)
    damping = uqmbd.Parameter("N s/m", "viscous friction", default=0, minimum=0)
    transition = uqmbd.Parameter(
        "m/s", "speed at which 71 % of Coulomb's force act", default=0.01, minimum=0, exclusive=True
    )

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, axis_i: Vector,
            friction: Quantity, damping: Quantity = 0, transition: Quantity = 0.01,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, *,
            axis: Vector, friction: Quantity, damping: Quantity = 0, transition: Quantity = 0.01,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis_i: Vector,
            friction: Quantity, damping: Quantity = 0, transition: Quantity = 0.01,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis: Vector, friction: Quantity,
            damping: Quantity = 0, transition: Quantity = 0.01,
        ) -> None: ...  # fmt: skip
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.VirtualWork]:
        """Yield the dissipation."""
        offset = p.let("offset", p.body_j.point(p.point_j) - p.body_i.point(p.point_i))
        axis = p.let("axis", p.body_i.direction(p.axis_i))
        yield _smooth(p, p.rate_of(axis.dot(offset)))
