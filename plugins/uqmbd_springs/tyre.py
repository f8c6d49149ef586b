"""Wheels on a road, with or without a tyre."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import sympy

import uqmbd
from uqmbd.laws import law_at, law_values
from uqmbd.typing import Quantity, Vector
from uqmbd_springs.roads import distance, haversine_bump

__all__ = ["RadialTyre", "RoadFollower"]

ROAD = haversine_bump(sympy.Rational(1, 5), 1, start=-sympy.Rational(1, 2))


class RoadFollower(uqmbd.extend.TypedComponent):
    """A wheel centre (a point of body j) follows a road at the vertical distance `height` above it.

    The road is in body i: the first axis of body i points forward, and its last axis points up. The road profile is an
    expression in ``uqmbd_springs.distance``, the forward coordinate of the point, or in `uqmbd.t`. The profile can
    contain random variables. A `uqmbd.Line` is vertical here, and the distance on it is zero, so the profile of a
    moving road must be a function of `uqmbd.t`.

    Examples
    --------
    >>> RoadFollower.signature()
    '(name, body_i, body_j, point, road, height=0)'
    """

    spaces = (*uqmbd.Component.spaces, uqmbd.Line)
    body_i: uqmbd.extend.NamedFrame
    body_j: uqmbd.extend.NamedFrame
    point: uqmbd.Parameter[Vector] = uqmbd.Parameter("m", "the point, frame of body j", kind="point", body="body_j")
    road: uqmbd.Parameter[Quantity] = uqmbd.Parameter("m", "height of the road", kind="option", example=ROAD)
    height: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "m", "height of the point above the road: the radius of a wheel", default=0
    )

    def prepare(self) -> dict[str, Any]:
        """Return the symbols in the road profile other than `distance`, by name."""
        return law_values(self.road, distance, what="road", package="uqmbd_springs")

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the constraint equation."""
        place = _point_in_road_frame(p)
        road = law_at(p, p.road, {distance: place[0]}, what="road")
        yield uqmbd.Constraint(place[-1] - p.height - road, "road")

    def reaction_point(self, p: uqmbd.extend.Local) -> sympy.Matrix:
        """Return the world position of the point."""
        return p.body_j.point(p.point)


class RadialTyre(uqmbd.extend.TypedComponent):
    """A spring and damper between a wheel centre (a point of body j) and the road vertically below the centre.

    The road is defined as for `RoadFollower`. Let ``z`` be the vertical coordinate of the wheel centre in body i. The
    compression is ``c = road + radius - z``, and its rate is ``c'``. With ``e`` for `transition`, the load of the
    spring and the damper is ``f = stiffness c + damping c' (1 + c / sqrt(c^2 + e^2)) / 2``. The factor
    ``(1 + c / sqrt(c^2 + e^2)) / 2`` rises from 0 without contact to 1 in contact.

    The road only pushes: the vertical force on the wheel is ``(f + sqrt(f^2 + (stiffness e)^2)) / 2``, which is
    positive. The force is about ``f`` in contact, ``stiffness e / 2`` at ``f = 0``, and tends to 0 without contact. On
    an inclined road, the force also has a horizontal component, so that it is normal to the profile. The power of the
    force is zero at constant compression.

    Examples
    --------
    >>> RadialTyre.signature()
    '(name, body_i, body_j, point, road, radius, stiffness, damping=0, transition=0.0001)'
    """

    symbol = "contact"
    spaces = (*uqmbd.Component.spaces, uqmbd.Line)
    body_i: uqmbd.extend.NamedFrame
    body_j: uqmbd.extend.NamedFrame
    point: uqmbd.Parameter[Vector] = uqmbd.Parameter(
        "m", "centre of the wheel, frame of body j", kind="point", body="body_j"
    )
    road: uqmbd.Parameter[Quantity] = uqmbd.Parameter("m", "height of the road", kind="option", example=ROAD)
    radius: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "m", "radius of the wheel without load", minimum=0, about="point"
    )
    stiffness: uqmbd.Parameter[Quantity] = uqmbd.Parameter("N/m", "spring rate", minimum=0)
    damping: uqmbd.Parameter[Quantity] = uqmbd.Parameter("N s/m", "damper rate", default=0, minimum=0)
    transition: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "m", "range e of the compression in which contact starts smoothly", default=1e-4, minimum=0, exclusive=True
    )

    prepare = RoadFollower.prepare
    reaction_point = RoadFollower.reaction_point

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.VirtualWork]:
        """Yield the virtual work of the load."""
        place = _point_in_road_frame(p)
        road = law_at(p, p.road, {distance: place[0]}, what="road")
        compression = p.let("compression", road + p.radius - place[-1])
        rate = p.rate_of(compression)
        contact = (1 + compression / sympy.sqrt(compression**2 + p.transition**2)) / 2
        load = p.let("load", p.stiffness * compression + p.damping * contact * rate)
        yield uqmbd.VirtualWork(-(load + sympy.sqrt(load**2 + (p.stiffness * p.transition) ** 2)) / 2, rate)


def _point_in_road_frame(p: uqmbd.extend.Local) -> sympy.Matrix:
    """Return the point in the frame of body i, forward coordinate first, upward coordinate last (0, x on a line)."""
    place = p.body_i.rotation.T * (p.body_j.point(p.point) - p.body_i.position)
    found: sympy.Matrix = p.let("place", [0, place[0]] if p.space.dimension == 1 else place)
    return found
