"""The universal joint."""

from __future__ import annotations

from collections.abc import Iterator

import uqmbd

__all__ = ["Universal"]


class Universal(uqmbd.Component):
    """A Cardan joint: two points coincide, and the two axes of the cross stay perpendicular.

    Examples
    --------
    >>> Universal.signature()
    '(name, body_i, body_j, point_i, point_j, axis_i, axis_j)'
    """

    symbol = "universal"
    spaces = (uqmbd.Spatial,)
    drawn_by = ("at",)
    point_i = uqmbd.Parameter("m", "centre of the cross, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "centre of the cross, frame of body j", kind="point", body="body_j")
    axis_i = uqmbd.Parameter("1", "axis of the cross in body i, its frame", kind="axis", body="body_i")
    axis_j = uqmbd.Parameter("1", "axis of the cross in body j, its frame", kind="axis", body="body_j")

    def terms(self, p: uqmbd.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the geometry."""
        i, j = p.body_i, p.body_j
        yield uqmbd.Constraint(j.point(p.point_j) - i.point(p.point_i), "point")
        yield uqmbd.Constraint(i.direction(p.axis_i).dot(j.direction(p.axis_j)), "axes")
