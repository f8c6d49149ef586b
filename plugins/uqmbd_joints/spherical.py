"""The spherical joint."""

from __future__ import annotations

from collections.abc import Iterator

import uqmbd

__all__ = ["Spherical"]


class Spherical(uqmbd.Component):
    """A ball joint: two points coincide.

    Examples
    --------
    >>> Spherical.signature()
    '(name, body_i, body_j, point_i, point_j)'
    """

    symbol = "ball"
    point_i = uqmbd.Parameter("m", "joint point, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "joint point, frame of body j", kind="point", body="body_j")

    def terms(self, p: uqmbd.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the geometry."""
        yield uqmbd.Constraint(p.body_j.point(p.point_j) - p.body_i.point(p.point_i), "point")
