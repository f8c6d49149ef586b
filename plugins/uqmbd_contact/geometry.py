"""Geometry of the contact of two bodies: gap, normal, tangents and relative velocity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import sympy

import uqmbd
from uqmbd.laws import distance, law_at, law_values
from uqmbd.typing import Quantity, Vector

__all__ = ["InBearing", "Meeting", "OnPlane", "OnRoad", "OnSphere", "distance", "tangents"]

BUMP = sympy.sin(distance) / 4


@dataclass(frozen=True)
class Meeting:
    """Geometry of a pair of bodies that are close to each other."""

    gap: sympy.Expr  # m; negative if the bodies overlap
    normal: sympy.Matrix  # unit normal from body i to body j, world axes
    relative: sympy.Matrix  # velocity of body j relative to body i at the contact, m/s
    fixed_i: sympy.Matrix | None = None  # the normal in the frame of body i, if it is constant
    reach: Any = 0  # reference depth: the radius of the smaller body, m; 0 for a point


class OnPlane(uqmbd.extend.TypedComponent):
    """Geometry of a sphere of body j on a plane of body i."""

    symbol = "contact"
    spaces = (*uqmbd.Component.spaces, uqmbd.Line)
    drawn_by = ()
    body_i: uqmbd.extend.NamedFrame
    body_j: uqmbd.extend.NamedFrame
    point_i: uqmbd.Parameter[Vector] = uqmbd.Parameter(
        "m", "a point of the plane, frame of body i", kind="point", body="body_i"
    )
    point_j: uqmbd.Parameter[Vector] = uqmbd.Parameter(
        "m", "centre of the sphere, frame of body j", kind="point", body="body_j"
    )
    normal_i: uqmbd.Parameter[Vector] = uqmbd.Parameter(
        "1", "normal of the plane towards body j, frame of body i", kind="axis", body="body_i"
    )
    radius: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "m", "radius of the sphere; 0: a point", default=0, minimum=0, about="point_j"
    )

    def meeting(self, p: uqmbd.extend.Local) -> Meeting:
        """Return the contact geometry at the point of the plane below the centre."""
        normal = p.let("normal", p.body_i.direction(p.normal_i))
        centre = p.let("centre", p.body_j.point(p.point_j))
        gap = p.let("gap", normal.dot(centre - p.body_i.point(p.point_i)) - p.radius)
        return Meeting(gap, normal, _relative(p, centre - p.radius * normal), sympy.Matrix(p.normal_i), p.radius)


class OnSphere(uqmbd.extend.TypedComponent):
    """Geometry of two spheres; on a line, of two segments, which stay in the order of the given pose."""

    symbol = "contact"
    spaces = (*uqmbd.Component.spaces, uqmbd.Line)
    drawn_by = ()
    body_i: uqmbd.extend.NamedFrame
    body_j: uqmbd.extend.NamedFrame
    point_i: uqmbd.Parameter[Vector] = uqmbd.Parameter(
        "m", "centre of the sphere, frame of body i", kind="point", body="body_i"
    )
    point_j: uqmbd.Parameter[Vector] = uqmbd.Parameter(
        "m", "centre of the sphere, frame of body j", kind="point", body="body_j"
    )
    radius_i: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "m", "radius of the sphere of body i", minimum=0, about="point_i"
    )
    radius_j: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "m", "radius of the sphere of body j", minimum=0, about="point_j"
    )

    def prepare(self) -> dict[str, Any]:
        """Return, for a mechanism on a line, the side of point i (1 or -1) on which point j is in the given pose."""
        return {"side": self.drawn_side()} if len(self.point_i) == 1 else {}

    def meeting(self, p: uqmbd.extend.Local) -> Meeting:
        """Return the contact geometry at the point of sphere i towards the centre of sphere j."""
        first = p.let("centre i", p.body_i.point(p.point_i))
        offset = p.let("offset", p.body_j.point(p.point_j) - first)
        if p.space.dimension == 1:
            between, normal = p.let("distance", p.side * offset[0]), sympy.Matrix([p.side])
        else:
            between = p.let("distance", sympy.sqrt(offset.dot(offset)))
            normal = p.let("normal", offset / between)
        gap = p.let("gap", between - p.radius_i - p.radius_j)
        smaller = sympy.Min(p.radius_i, p.radius_j)
        return Meeting(gap, normal, _relative(p, first + p.radius_i * normal), reach=smaller)


class OnRoad(uqmbd.extend.TypedComponent):
    """Geometry of a point of body j on a road in body i: a planar curve, or a cylindrical surface in 3D."""

    drawn_by = ()
    body_i: uqmbd.extend.NamedFrame
    body_j: uqmbd.extend.NamedFrame
    point_j: uqmbd.Parameter[Vector] = uqmbd.Parameter("m", "the point, frame of body j", kind="point", body="body_j")
    road: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "m", "height of the road, a function of uqmbd_contact.distance", kind="option", example=BUMP
    )

    def prepare(self) -> dict[str, Any]:
        """Return the symbols in the road profile other than `distance`, by name."""
        return law_values(self.road, distance, what="road", package="uqmbd_contact")

    def meeting(self, p: uqmbd.extend.Local) -> Meeting:
        """Return the contact geometry at the point; the gap is along the normal of the road below the point."""
        frame = p.body_i
        point = p.let("point", p.body_j.point(p.point_j))
        place = p.let("place", frame.rotation.T * (point - frame.position))
        height, slope = (law_at(p, p.road, {distance: place[0]}, what="road", by=x) for x in (None, distance))
        slope = p.let("slope", slope)
        steep = p.let("steepness", sympy.sqrt(1 + slope**2))
        gap = p.let("gap", (place[-1] - height) / steep)
        up = [-slope / steep, *[0] * (len(place) - 2), 1 / steep]
        return Meeting(gap, p.let("normal", frame.direction(up)), _relative(p, point))

    def reaction_point(self, p: uqmbd.extend.Local) -> sympy.Matrix:
        """Return the world position of the point."""
        return p.body_j.point(p.point_j)


class InBearing(uqmbd.extend.TypedComponent):
    """Geometry of a circle of body j in a slightly larger circle of body i, or of a ball in a socket."""

    symbol = "contact"
    spaces = (*uqmbd.Component.spaces, uqmbd.Line)
    body_i: uqmbd.extend.NamedFrame
    body_j: uqmbd.extend.NamedFrame
    point_i: uqmbd.Parameter[Vector] = uqmbd.Parameter(
        "m", "centre of the bearing, frame of body i", kind="point", body="body_i"
    )
    point_j: uqmbd.Parameter[Vector] = uqmbd.Parameter(
        "m", "centre of the journal, frame of body j", kind="point", body="body_j"
    )
    radius: uqmbd.Parameter[Quantity] = uqmbd.Parameter("m", "radius of the journal", minimum=0, about="point_j")
    clearance: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "m", "radius of the bearing minus radius of the journal", minimum=0
    )

    def meeting(self, p: uqmbd.extend.Local) -> Meeting:
        """Return the contact geometry at the point of the bearing that is nearest to the journal."""
        first = p.let("centre i", p.body_i.point(p.point_i))
        offset = p.let("offset", p.body_j.point(p.point_j) - first)
        # coincident centres have no nearest direction: 1e-9 m avoids the division by zero, and the bodies do not touch
        eccentricity = p.let("eccentricity", sympy.sqrt(offset.dot(offset) + sympy.Float(1e-18)))
        inwards = p.let("normal", -offset / eccentricity)
        gap = p.let("gap", p.clearance - eccentricity)
        return Meeting(gap, inwards, _relative(p, first - (p.radius + p.clearance) * inwards), reach=p.radius)


def tangents(p: uqmbd.extend.Local, meeting: Meeting) -> tuple[sympy.Matrix, ...]:
    """Return unit vectors along the surface, world axes: one in planar, two in spatial models, none on a line."""
    if meeting.fixed_i is not None:  # the tangents rotate with body i
        return tuple(p.let("tangent", p.body_i.direction(x)) for x in _perpendicular(meeting.fixed_i))
    return tuple(p.let("tangent", x) for x in _perpendicular(meeting.normal))


def _relative(p: uqmbd.extend.Local, point: sympy.Matrix) -> sympy.Matrix:
    meeting = p.let("point", point)
    found: sympy.Matrix = p.let("relative velocity", _velocity(p.body_j, meeting) - _velocity(p.body_i, meeting))
    return found


def _velocity(frame: uqmbd.extend.Frame, point: sympy.Matrix) -> sympy.Matrix:
    """Return the velocity of the material of a body at a world point, m/s."""
    if not frame.space.turns:
        return frame.velocity
    arm, w = point - frame.position, frame.angular_velocity
    if frame.space.dimension == 2:
        return frame.velocity + w[0] * sympy.Matrix([-arm[1], arm[0]])
    return frame.velocity + w.cross(arm)


def _perpendicular(normal: sympy.Matrix) -> tuple[sympy.Matrix, ...]:
    """Return unit vectors perpendicular to a unit vector and to each other."""
    normal = sympy.Matrix(normal)
    if len(normal) == 1:
        return ()
    if len(normal) == 2:
        return (sympy.Matrix([normal[1], -normal[0]]),)
    # Duff et al., Journal of Computer Graphics Techniques 6 (2017) no. 1: the vectors jump only where z changes sign
    x, y, z = normal
    sign = sympy.Piecewise((1, z >= 0), (-1, True))
    a = -1 / (sign + z)
    b = x * y * a
    return (
        sympy.Matrix([1 + sign * x**2 * a, sign * b, -sign * x]),
        sympy.Matrix([b, sign + y**2 * a, -y]),
    )
