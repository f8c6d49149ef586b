"""The distance joint."""

from __future__ import annotations

from collections.abc import Iterator

import uqmbd

__all__ = ["Distance"]


class Distance(uqmbd.Component):
    """A massless rod: two points keep their distance.  Spherical at both ends; in the plane revolute at both.

    Examples
    --------
    >>> Distance.signature()
    '(name, body_i, body_j, point_i, point_j, length)'
    """

    symbol = "rod"
    drawn_by = ()
    point_i = uqmbd.Parameter("m", "end of the rod, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "end of the rod, frame of body j", kind="point", body="body_j")
    length = uqmbd.Parameter("m", "length of the rod", minimum=0, exclusive=True)

    def terms(self, p: uqmbd.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the geometry."""
        offset = p.body_j.point(p.point_j) - p.body_i.point(p.point_i)
        yield uqmbd.Constraint(offset.dot(offset) - p.length**2, "length")
