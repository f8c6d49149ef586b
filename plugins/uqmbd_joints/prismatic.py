"""Prismatic joint."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import sympy

import uqmbd
from uqmbd_joints.arguments import PointsAndAxes

__all__ = ["Prismatic"]


class Prismatic(PointsAndAxes):
    """A slide: the point on body j stays on a line fixed in body i, without relative rotation.

    The bodies keep the relative rotation of the given pose, changed by the smallest rotation that makes the axes
    parallel.

    Examples
    --------
    >>> Prismatic.signature()
    '(name, body_i, body_j, point_i, point_j, axis_i, axis_j)'
    """

    symbol = "slide"
    point_i = uqmbd.Parameter("m", "a point of the line, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "the point on the line, frame of body j", kind="point", body="body_j")
    axis_i = uqmbd.Parameter("1", "direction of the line, frame of body i", kind="axis", body="body_i")
    axis_j = uqmbd.Parameter("1", "direction of the line, frame of body j", kind="axis", body="body_j")

    def prepare(self) -> dict[str, Any]:
        """Return the normals of the line and the constant relative rotation."""
        if len(self.axis_i) == 3:
            normals = [*uqmbd.extend.perpendiculars(self.axis_i)[0], *uqmbd.extend.perpendiculars(self.axis_i)[1]]
        else:
            normals = [-self.axis_i[1], self.axis_i[0]]
        return {"normals": normals, "turn": uqmbd.extend.aligned(self.drawn_quaternion(), self.axis_i, self.axis_j)}

    def motion(self) -> dict[str, Any]:
        """Return the displacement of point j from point i along the axis."""
        return {"displacement": self.joint_displacement()}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the constraint equations."""
        i, j, d = p.body_i, p.body_j, p.space.dimension
        offset = j.point(p.point_j) - i.point(p.point_i)
        normals = [i.direction(p.normals[k : k + d]) for k in range(0, len(p.normals), d)]
        yield uqmbd.Constraint(sympy.Matrix([n.dot(offset) for n in normals]), "line")
        if p.space.turns:
            yield uqmbd.Constraint(uqmbd.extend.relative_quaternion(i.attitude(p.turn), j.quaternion)[1:], "rotation")
