"""Massless link with a revolute joint at one end and a ball joint at the other."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, overload

import sympy

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Quantity, Vector

__all__ = ["RevoluteSpherical"]


class RevoluteSpherical(uqmbd.Component):
    """A massless link: a hinge on body i with its axis perpendicular to the link, and a ball joint on body j.

    The two points keep their distance, and the link stays perpendicular to the hinge axis.

    Examples
    --------
    >>> RevoluteSpherical.signature()
    '(name, body_i, body_j, point_i, point_j, axis_i, length)'
    """

    symbol = "rod"
    spaces = (uqmbd.Spatial,)
    drawn_by = ("axis",)
    point_i = uqmbd.Parameter("m", "hinge, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "ball, frame of body j", kind="point", body="body_j")
    axis_i = uqmbd.Parameter("1", "axis of the hinge, frame of body i", kind="axis", body="body_i")
    length = uqmbd.Parameter("m", "length of the link", minimum=0, exclusive=True)

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, axis_i: Vector,
            length: Quantity,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, *,
            axis: Vector, length: Quantity,
        ) -> None: ...  # fmt: skip
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...

    def motion(self) -> dict[str, Any]:
        """Return the angle of the link about the hinge on body i, zero in the given pose."""
        i, j = self.attached["body_i"], self.attached["body_j"]
        drawn_i, drawn_j = self.drawn_frame("body_i"), self.drawn_frame("body_j")
        link = drawn_i.rotation.T * (drawn_j.point(self.point_j) - drawn_i.point(self.point_i))
        offset = j.point(self.point_j) - i.point(self.point_i)
        across = sympy.Matrix(self.axis_i).cross(link)
        return {"angle": uqmbd.extend.JointAngle(i.direction(link).dot(offset), i.direction(across).dot(offset))}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the constraint equations."""
        offset = p.body_j.point(p.point_j) - p.body_i.point(p.point_i)
        yield uqmbd.Constraint(offset.dot(offset) - p.length**2, "length")
        yield uqmbd.Constraint(p.body_i.direction(p.axis_i).dot(offset), "axis")
