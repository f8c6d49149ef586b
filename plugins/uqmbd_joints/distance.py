"""Distance joint."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import uqmbd
from uqmbd.typing import Quantity, Vector

__all__ = ["Distance"]


class Distance(uqmbd.extend.TypedComponent):
    """A massless rod: two points keep their distance.

    Both ends are ball joints in three dimensions, and hinges in planar space.

    On a line, point j stays on the side of point i on which it is in the given pose.

    Examples
    --------
    >>> Distance.signature()
    '(name, body_i, body_j, point_i, point_j, length)'
    """

    symbol = "rod"
    spaces = (*uqmbd.Component.spaces, uqmbd.Line)
    drawn_by = ()
    body_i: uqmbd.extend.NamedFrame
    body_j: uqmbd.extend.NamedFrame
    point_i: uqmbd.Parameter[Vector] = uqmbd.Parameter(
        "m", "end of the rod, frame of body i", kind="point", body="body_i"
    )
    point_j: uqmbd.Parameter[Vector] = uqmbd.Parameter(
        "m", "end of the rod, frame of body j", kind="point", body="body_j"
    )
    length: uqmbd.Parameter[Quantity] = uqmbd.Parameter("m", "length of the rod", minimum=0, exclusive=True)

    def prepare(self) -> dict[str, Any]:
        """Return, for a mechanism on a line, the side of point i (1 or -1) on which point j is in the given pose."""
        return {"side": self.drawn_side()} if len(self.point_i) == 1 else {}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the constraint equation."""
        offset = p.body_j.point(p.point_j) - p.body_i.point(p.point_i)
        line = p.space.dimension == 1
        yield uqmbd.Constraint(p.side * offset[0] - p.length if line else offset.dot(offset) - p.length**2, "length")
