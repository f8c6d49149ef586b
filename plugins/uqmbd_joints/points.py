"""A point of one body on a line or plane of another."""

from __future__ import annotations

from uqmbd_joints.primitives import Dot2, Parallel2

__all__ = ["PointOnLine", "PointOnPlane"]


class PointOnLine(Parallel2):
    """A point of body j slides on a line fixed in body i, and may turn in every way.

    Examples
    --------
    >>> PointOnLine.signature()
    '(name, body_i, body_j, point_i, point_j, axis_i)'
    """


class PointOnPlane(Dot2):
    """A point of body j slides on a plane fixed in body i; in the plane, on a line with the normal `axis_i`.

    Examples
    --------
    >>> PointOnPlane.signature()
    '(name, body_i, body_j, point_i, point_j, axis_i)'
    """
