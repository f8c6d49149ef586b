"""Drivers of displacement and distance."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, overload

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Quantity, Vector

__all__ = ["DistanceDriver", "PositionDriver"]


class PositionDriver(uqmbd.Component):
    """The displacement of a point of body j along an axis fixed in body i follows a function of time.

    Examples
    --------
    >>> PositionDriver.signature()
    '(name, body_i, body_j, point_i, point_j, axis_i, displacement)'
    """

    symbol = "driver"
    spaces = (*uqmbd.Component.spaces, uqmbd.Line)
    point_i = uqmbd.Parameter("m", "point of zero displacement, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "the driven point, frame of body j", kind="point", body="body_j")
    axis_i = uqmbd.Parameter("1", "direction, frame of body i", kind="axis", body="body_i")
    displacement = uqmbd.Parameter("m", "displacement, an expression in uqmbd.t")

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, axis_i: Vector,
            displacement: Quantity,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, *,
            axis: Vector, displacement: Quantity,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis_i: Vector,
            displacement: Quantity,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis: Vector,
            displacement: Quantity,
        ) -> None: ...  # fmt: skip
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the constraint equation."""
        offset = p.body_j.point(p.point_j) - p.body_i.point(p.point_i)
        yield uqmbd.Constraint(p.body_i.direction(p.axis_i).dot(offset) - p.displacement, "displacement")


class DistanceDriver(uqmbd.extend.TypedComponent):
    """The distance of two points follows a function of time that never vanishes.

    On a line, point j stays on the side of point i on which it is in the given pose.

    Examples
    --------
    >>> DistanceDriver.signature()
    '(name, body_i, body_j, point_i, point_j, length)'
    """

    symbol = "driver"
    spaces = (*uqmbd.Component.spaces, uqmbd.Line)
    drawn_by = ()
    body_i: uqmbd.extend.NamedFrame
    body_j: uqmbd.extend.NamedFrame
    point_i: uqmbd.Parameter[Vector] = uqmbd.Parameter(
        "m", "end of the distance, frame of body i", kind="point", body="body_i"
    )
    point_j: uqmbd.Parameter[Vector] = uqmbd.Parameter(
        "m", "end of the distance, frame of body j", kind="point", body="body_j"
    )
    length: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "m", "distance, an expression in uqmbd.t", minimum=0, exclusive=True
    )

    def prepare(self) -> dict[str, Any]:
        """Return, for a mechanism on a line, the side of point i (1 or -1) on which point j is in the given pose."""
        return {"side": self.drawn_side()} if len(self.point_i) == 1 else {}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the constraint equation."""
        offset = p.body_j.point(p.point_j) - p.body_i.point(p.point_i)
        line = p.space.dimension == 1
        yield uqmbd.Constraint(p.side * offset[0] - p.length if line else offset.dot(offset) - p.length**2, "length")
