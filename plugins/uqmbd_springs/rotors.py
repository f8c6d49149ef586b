"""Inertia of parts that a joint drives at a gear ratio; only their motion relative to the bodies is included."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, overload

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Quantity, Vector

__all__ = ["RotorInertia", "SlidingInertia"]


class RotorInertia(uqmbd.Component):
    """Inertia of a rotor about the common axis of two bodies, reduced to the joint: energy ``inertia w^2 / 2``.

    ``w`` is the angular velocity of body j relative to body i, about `axis_i`. If the gear ratio is
    ``n = rotor speed / w``, `inertia` is n^2 times the inertia of the rotor about its own axis. The sign of n has no
    effect.

    The component contains no other energy of the rotor. Add the mass and the inertia of the rotor to the body that
    carries it. The coupling of the rotor speed with the rotation of this body is neglected.

    Examples
    --------
    >>> RotorInertia.signature()
    '(name, body_i, body_j, inertia, axis_i)'
    """

    symbol = "coil"
    spaces = (uqmbd.Spatial, uqmbd.Planar)
    inertia = uqmbd.Parameter("kg m^2", "inertia of the rotor, times (rotor speed / joint speed)^2", minimum=0)
    axis_i = uqmbd.Parameter("1", "axis, frame of body i (omit it in planar space)", kind="turning_axis", body="body_i")

    if TYPE_CHECKING:

        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, inertia: Quantity, axis_i: Vector = (), *,
            axis: Vector = (),
        ) -> None: ...  # fmt: skip

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Kinetic]:
        """Yield the kinetic energy."""
        spin = p.body_j.angular_velocity - p.body_i.angular_velocity
        speed = spin[0] if p.space.dimension == 2 else spin.dot(p.body_i.direction(p.axis_i))
        yield uqmbd.Kinetic(p.inertia * speed**2 / 2)


class SlidingInertia(uqmbd.Component):
    """Mass that resists only the sliding between two bodies along an axis, such as a motor that drives a spindle.

    The kinetic energy is ``mass v^2 / 2`` with the speed ``v`` of a point of body j along an axis fixed in body i.

    Examples
    --------
    >>> SlidingInertia.signature()
    '(name, body_i, body_j, point_i, point_j, axis_i, mass)'
    """

    symbol = "spring"
    spaces = (*uqmbd.Component.spaces, uqmbd.Line)
    point_i = uqmbd.Parameter("m", "a point of the axis, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "the point that slides, frame of body j", kind="point", body="body_j")
    axis_i = uqmbd.Parameter("1", "direction, frame of body i", kind="axis", body="body_i")
    mass = uqmbd.Parameter("kg", "mass at the joint", minimum=0)

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, axis_i: Vector,
            mass: Quantity,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, *,
            axis: Vector, mass: Quantity,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis_i: Vector, mass: Quantity
        ) -> None: ...
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis: Vector, mass: Quantity
        ) -> None: ...
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Kinetic]:
        """Yield the kinetic energy."""
        offset = p.let("offset", p.body_j.point(p.point_j) - p.body_i.point(p.point_i))
        axis = p.let("axis", p.body_i.direction(p.axis_i))
        yield uqmbd.Kinetic(p.mass * p.rate_of(axis.dot(offset)) ** 2 / 2)
