"""Universal joint."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, overload

import sympy

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Vector

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
    axis_i = uqmbd.Parameter("1", "axis of the cross, frame of body i", kind="axis", body="body_i")
    axis_j = uqmbd.Parameter("1", "axis of the cross, frame of body j", kind="axis", body="body_j")

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, axis_i: Vector,
            axis_j: Vector,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis_i: Vector, axis_j: Vector
        ) -> None: ...
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...

    def motion(self) -> dict[str, Any]:
        """Return the angles of the cross relative to body i about `axis_i`, and of body j relative to the cross.

        The second angle is about `axis_j`. Both angles are zero in the given pose.
        """
        i, j = self.attached["body_i"], self.attached["body_j"]
        drawn_i, drawn_j = self.drawn_frame("body_i"), self.drawn_frame("body_j")
        axis_i, axis_j = sympy.Matrix(self.axis_i), sympy.Matrix(self.axis_j)
        in_i = drawn_i.rotation.T * drawn_j.direction(axis_j)
        in_j = drawn_j.rotation.T * drawn_i.direction(axis_i)
        to_i, to_j = i.direction(axis_i), j.direction(axis_j)
        return {
            "angle_i": uqmbd.extend.JointAngle(
                i.direction(in_i).dot(to_j), i.direction(axis_i.cross(in_i)).dot(to_j), speed="speed_i"
            ),
            "angle_j": uqmbd.extend.JointAngle(
                j.direction(in_j).dot(to_i), -j.direction(axis_j.cross(in_j)).dot(to_i), speed="speed_j"
            ),
        }

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the constraint equations."""
        i, j = p.body_i, p.body_j
        yield uqmbd.Constraint(j.point(p.point_j) - i.point(p.point_i), "point")
        yield uqmbd.Constraint(i.direction(p.axis_i).dot(j.direction(p.axis_j)), "axes")
