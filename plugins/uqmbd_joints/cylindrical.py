"""Cylindrical joint."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import uqmbd
from uqmbd_joints.arguments import PointsAndAxes
from uqmbd_joints.primitives import Parallel2

__all__ = ["Cylindrical"]


class Cylindrical(PointsAndAxes, Parallel2):
    """A slide that can rotate: the point on body j stays on a line fixed in body i, and two axes are parallel.

    Examples
    --------
    >>> Cylindrical.signature()
    '(name, body_i, body_j, point_i, point_j, axis_i, axis_j)'
    """

    symbol = "cylinder"
    spaces = (uqmbd.Spatial,)
    axis_j = uqmbd.Parameter("1", "direction of the line, frame of body j", kind="axis", body="body_j")

    def prepare(self) -> dict[str, Any]:
        """Return the normals of the line, and a joint frame whose third axis is the joint axis in each body."""
        frame_i, frame_j = uqmbd.extend.joint_frames(self.axis_i, self.axis_j)
        return {**super().prepare(), "frame_i": frame_i, "frame_j": frame_j}

    def motion(self) -> dict[str, Any]:
        """Return the angle, defined as for `Revolute`, and the displacement."""
        return {"angle": self.joint_angle(), "displacement": self.joint_displacement("sliding_speed")}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint | uqmbd.Auxiliary]:
        """Yield the constraint equations."""
        yield from super().terms(p)
        relative = uqmbd.extend.relative_quaternion(p.body_i.attitude(p.frame_i), p.body_j.attitude(p.frame_j))
        yield uqmbd.Constraint(relative[1:3], "axis")
