"""Wheels and spheres that roll without slipping, and skates, as velocity constraints."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, overload

import sympy

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Quantity, Vector

__all__ = ["RollingSphere", "RollingWheel", "Skate"]


class RollingWheel(uqmbd.Component):
    """A wheel of body j, a thin disc with a sharp rim, rolls without slipping on a plane fixed in body i.

    The rim touches the plane, and the wheel may lean. At the contact point, the material points of both bodies have the
    same velocity. In planar space, the wheel rolls on a line. The constraint does not permit lift-off or slip.
    `reaction_force`, which acts on the wheel at the contact, shows whether lift-off or slip would occur. The pose in
    which the disc lies flat on the plane is singular, and the motion ends there.

    The plane has the unit normal ``n``. The wheel has the radius ``R`` and the unit axis ``a``, and its centre is at
    the height ``h`` over the plane. Then ``h = R w``, where ``w = |n x a|``. The vector from the centre to the contact
    is ``-R (n - (n . a) a) / w`` [1]_.

    References
    ----------
    .. [1] J. I. Neimark, N. A. Fufaev, Dynamics of Nonholonomic Systems, American Mathematical Society 1972, chapter 3.

    Examples
    --------
    >>> RollingWheel.signature()
    '(name, body_i, body_j, point_i, point_j, normal_i, axis_j, radius)'
    """

    symbol = "wheel"
    spaces = (uqmbd.Spatial, uqmbd.Planar)
    drawn_by = ()
    point_i = uqmbd.Parameter("m", "a point of the plane, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "centre of the wheel, frame of body j", kind="point", body="body_j")
    normal_i = uqmbd.Parameter(
        "1", "normal of the plane towards the wheel, frame of body i", kind="axis", body="body_i"
    )
    axis_j = uqmbd.Parameter(
        "1",
        "axis of the wheel, frame of body j (omit it in planar space)",
        kind="turning_axis",
        default=(),
        body="body_j",
    )
    radius = uqmbd.Parameter("m", "radius of the wheel", minimum=0, exclusive=True, about="point_j")

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, normal_i: Vector,
            axis_j: Vector, radius: Quantity,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, normal_i: Vector,
            *, radius: Quantity,
        ) -> None: ...  # fmt: skip
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...

    def prepare(self) -> dict[str, Any]:
        """Return the directions of the plane."""
        return _directions(self.normal_i)

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint | uqmbd.extend.VelocityConstraint]:
        """Yield the constraints of contact and of no slip."""
        i, j = p.body_i, p.body_j
        normal, centre = i.direction(p.normal_i), j.point(p.point_j)
        height = normal.dot(centre - i.point(p.point_i))
        if p.space.dimension == 2:
            yield uqmbd.Constraint(height - p.radius, "contact")
            foot = centre - p.radius * normal
            yield uqmbd.extend.VelocityConstraint(i.direction(p.along).dot(_slip_velocity(p, foot)), "rolling")
            return
        axis = j.direction(p.axis_j)
        lean = normal.dot(axis)
        crossed = normal.cross(axis)
        width = p.let("width", sympy.sqrt(crossed.dot(crossed)))
        yield uqmbd.Constraint(height - p.radius * width, "contact")
        turning = (j.angular_velocity - i.angular_velocity).cross(normal - lean * axis)
        slip = _slip_velocity(p, centre) - p.radius / width * turning
        directions = [i.direction(x) for x in (p.along, p.across)]
        yield uqmbd.extend.VelocityConstraint(sympy.Matrix([d.dot(slip) for d in directions]), "rolling")

    def reaction_point(self, p: uqmbd.extend.Local) -> sympy.Matrix:
        """Return the world position of the point of contact."""
        normal, centre = p.body_i.direction(p.normal_i), p.body_j.point(p.point_j)
        if p.space.dimension == 2:
            return centre - p.radius * normal
        axis = p.body_j.direction(p.axis_j)
        crossed = normal.cross(axis)
        return centre - p.radius / sympy.sqrt(crossed.dot(crossed)) * (normal - normal.dot(axis) * axis)


class RollingSphere(uqmbd.extend.TypedComponent):
    """A sphere of body j rolls without slipping on a plane fixed in body i; the sphere may spin about the normal.

    The constraint does not permit lift-off or slip. `reaction_force`, which acts on the sphere at the contact, shows
    whether lift-off or slip would occur.

    Examples
    --------
    >>> RollingSphere.signature()
    '(name, body_i, body_j, point_i, point_j, normal_i, radius)'
    """

    symbol = "contact"
    spaces = (uqmbd.Spatial,)
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
        "1", "normal of the plane towards the sphere, frame of body i", kind="axis", body="body_i"
    )
    radius: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "m", "radius of the sphere", minimum=0, exclusive=True, about="point_j"
    )

    def prepare(self) -> dict[str, Any]:
        """Return the directions of the plane."""
        return _directions(self.normal_i)

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint | uqmbd.extend.VelocityConstraint]:
        """Yield the constraints of contact and of no slip."""
        normal = p.body_i.direction(p.normal_i)
        height = normal.dot(p.body_j.point(p.point_j) - p.body_i.point(p.point_i))
        yield uqmbd.Constraint(height - p.radius, "contact")
        slip = _slip_velocity(p, self.reaction_point(p))
        directions = [p.body_i.direction(x) for x in (p.along, p.across)]
        yield uqmbd.extend.VelocityConstraint(sympy.Matrix([d.dot(slip) for d in directions]), "rolling")

    def reaction_point(self, p: uqmbd.extend.Local) -> sympy.Matrix:
        """Return the world position of the point of contact."""
        return p.body_j.point(p.point_j) - p.radius * p.body_i.direction(p.normal_i)


class Skate(uqmbd.extend.TypedComponent):
    """A knife edge: a blade at a point of body j slides over a plane of body i in the direction of the blade only.

    The transverse direction is perpendicular to the axis and to the normal of the plane. The constraint is one equation
    in velocities. Another component, such as `PointOnPlane`, must keep the blade on the plane. A planar model is a top
    view and needs no normal. `reaction_force` acts on body j at the blade, in the transverse direction.

    Examples
    --------
    >>> Skate.signature()
    '(name, body_i, body_j, point_j, axis_j, normal_i)'
    """

    symbol = "skate"
    spaces = (uqmbd.Spatial, uqmbd.Planar)
    drawn_by = ()
    body_i: uqmbd.extend.NamedFrame
    body_j: uqmbd.extend.NamedFrame
    point_j: uqmbd.Parameter[Vector] = uqmbd.Parameter(
        "m", "point of the blade, frame of body j", kind="point", body="body_j"
    )
    axis_j: uqmbd.Parameter[Vector] = uqmbd.Parameter(
        "1", "direction of the blade, frame of body j", kind="axis", body="body_j"
    )
    normal_i: uqmbd.Parameter[Vector] = uqmbd.Parameter(
        "1",
        "normal of the plane, frame of body i (omit it in planar space)",
        kind="turning_axis",
        default=(),
        body="body_i",
    )

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.extend.VelocityConstraint]:
        """Yield the constraint of no transverse velocity."""
        axis = p.body_j.direction(p.axis_j)
        if p.space.dimension == 2:
            across = sympy.Matrix([-axis[1], axis[0]])
        else:
            across = p.body_i.direction(p.normal_i).cross(axis)
        yield uqmbd.extend.VelocityConstraint(across.dot(_slip_velocity(p, p.body_j.point(p.point_j))), "blade")

    def reaction_point(self, p: uqmbd.extend.Local) -> sympy.Matrix:
        """Return the world position of the blade."""
        return p.body_j.point(p.point_j)


def _directions(normal: Any) -> dict[str, Any]:
    """Return unit vectors perpendicular to a normal, and to each other."""
    if len(normal) == 2:
        return {"along": (normal[1], -normal[0])}
    along, across = uqmbd.extend.perpendiculars(normal)
    return {"along": along, "across": across}


def _slip_velocity(p: uqmbd.extend.Local, point: sympy.Matrix) -> sympy.Matrix:
    """Return the velocity of body j relative to body i, m/s, at the material points that are at a world point."""
    return _velocity(p.body_j, point) - _velocity(p.body_i, point)


def _velocity(frame: uqmbd.extend.Frame, point: sympy.Matrix) -> sympy.Matrix:
    arm, w = point - frame.position, frame.angular_velocity
    if frame.space.dimension == 2:
        return frame.velocity + w[0] * sympy.Matrix([-arm[1], arm[0]])
    return frame.velocity + w.cross(arm)
