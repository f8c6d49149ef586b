"""Primitive constraints of joints."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import sympy

import uqmbd
from uqmbd.typing import Vector
from uqmbd_joints.arguments import PointsAndAxis

__all__ = ["Dot1", "Dot2", "Parallel2"]


class Dot1(uqmbd.extend.TypedComponent):
    """Two axes stay perpendicular: one equation.

    Examples
    --------
    >>> Dot1.signature()
    '(name, body_i, body_j, axis_i, axis_j)'
    """

    spaces = (uqmbd.Spatial, uqmbd.Planar)
    drawn_by = ()
    body_i: uqmbd.extend.NamedFrame
    body_j: uqmbd.extend.NamedFrame
    axis_i: uqmbd.Parameter[Vector] = uqmbd.Parameter("1", "axis, frame of body i", kind="axis", body="body_i")
    axis_j: uqmbd.Parameter[Vector] = uqmbd.Parameter("1", "axis, frame of body j", kind="axis", body="body_j")

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the constraint equation."""
        yield uqmbd.Constraint(p.body_i.direction(p.axis_i).dot(p.body_j.direction(p.axis_j)), "axes")


class Dot2(PointsAndAxis):
    """The vector from point i to point j stays perpendicular to an axis: point j stays on a plane fixed in body i.

    Examples
    --------
    >>> Dot2.signature()
    '(name, body_i, body_j, point_i, point_j, axis_i)'
    """

    symbol = "plane"
    point_i = uqmbd.Parameter("m", "a point of the plane, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "the point on the plane, frame of body j", kind="point", body="body_j")
    axis_i = uqmbd.Parameter("1", "normal of the plane, frame of body i", kind="axis", body="body_i")

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the constraint equation."""
        offset = p.body_j.point(p.point_j) - p.body_i.point(p.point_i)
        yield uqmbd.Constraint(p.body_i.direction(p.axis_i).dot(offset), "plane")


class Parallel2(PointsAndAxis):
    """The vector from point i to point j stays parallel to an axis: point j stays on a line fixed in body i.

    The constraint has two equations in three dimensions, and one in planar space.

    Examples
    --------
    >>> Parallel2.signature()
    '(name, body_i, body_j, point_i, point_j, axis_i)'
    """

    symbol = "line"
    point_i = uqmbd.Parameter("m", "a point of the line, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "the point on the line, frame of body j", kind="point", body="body_j")
    axis_i = uqmbd.Parameter("1", "direction of the line, frame of body i", kind="axis", body="body_i")

    def prepare(self) -> dict[str, Any]:
        """Return the normals of the line."""
        if len(self.axis_i) == 3:
            return {
                "normals": [*uqmbd.extend.perpendiculars(self.axis_i)[0], *uqmbd.extend.perpendiculars(self.axis_i)[1]]
            }
        return {"normals": [-self.axis_i[1], self.axis_i[0]]}

    def motion(self) -> dict[str, Any]:
        """Return the displacement of point j from point i along the axis."""
        return {"displacement": self.joint_displacement()}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint | uqmbd.Auxiliary]:
        """Yield the constraint equations."""
        d = p.space.dimension
        offset = p.body_j.point(p.point_j) - p.body_i.point(p.point_i)
        normals = [p.body_i.direction(p.normals[k : k + d]) for k in range(0, len(p.normals), d)]
        yield uqmbd.Constraint(sympy.Matrix([n.dot(offset) for n in normals]), "line")
