"""Point of one body on a line or plane of another body."""

from __future__ import annotations

from uqmbd_joints.primitives import Dot2, Parallel2

__all__ = ["PointOnLine", "PointOnPlane"]


class PointOnLine(Parallel2):
    """A point of body j slides on a line fixed in body i; the rotation is free.

    Examples
    --------
    >>> PointOnLine.signature()
    '(name, body_i, body_j, point_i, point_j, axis_i)'
    """


class PointOnPlane(Dot2):
    """A point of body j slides on a plane with the normal `axis_i` fixed in body i; in planar space, on a line.

    Examples
    --------
    >>> PointOnPlane.signature()
    '(name, body_i, body_j, point_i, point_j, axis_i)'
    """
