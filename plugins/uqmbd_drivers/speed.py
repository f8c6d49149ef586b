"""Drivers of speed: they integrate the prescribed speed, which can therefore be any function of time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, overload

import sympy

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Quantity, Vector

__all__ = ["LinearSpeedDriver", "SpeedDriver"]


class SpeedDriver(uqmbd.Component):
    """Body j rotates from its given pose relative to body i, about a common axis, at a prescribed speed over time.

    Examples
    --------
    >>> SpeedDriver.signature()
    '(name, body_i, body_j, speed, axis_j)'
    """

    symbol = "driver"
    spaces = (uqmbd.Spatial, uqmbd.Planar)
    speed = uqmbd.Parameter("rad/s", "angular speed, an expression in uqmbd.t")
    axis_j = uqmbd.Parameter("1", "axis, frame of body j (omit it in planar space)", kind="turning_axis", body="body_j")

    if TYPE_CHECKING:

        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, speed: Quantity, axis_j: Vector = (), *,
            axis: Vector = (),
        ) -> None: ...  # fmt: skip

    def prepare(self) -> dict[str, Any]:
        """Return the relative quaternion of the bodies in the given pose."""
        return {"drawn": self.drawn_quaternion()}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint | uqmbd.Auxiliary]:
        """Yield the constraint equation and the auxiliary state."""
        angle = p.state("angle")
        yield uqmbd.Auxiliary(angle, p.speed, 0)
        cosine, sine = uqmbd.extend.half_angle(p, p.body_i, p.body_j, p.drawn, p.axis_j)
        yield uqmbd.Constraint(cosine * sympy.sin(angle / 2) - sine * sympy.cos(angle / 2), "angle")


class LinearSpeedDriver(uqmbd.Component):
    """A point of body j moves from its given pose along an axis fixed in body i at a prescribed speed over time.

    Examples
    --------
    >>> LinearSpeedDriver.signature()
    '(name, body_i, body_j, point_i, point_j, axis_i, speed)'
    """

    symbol = "driver"
    spaces = (*uqmbd.Component.spaces, uqmbd.Line)
    point_i = uqmbd.Parameter("m", "a point to measure from, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "the driven point, frame of body j", kind="point", body="body_j")
    axis_i = uqmbd.Parameter("1", "direction, frame of body i", kind="axis", body="body_i")
    speed = uqmbd.Parameter("m/s", "speed, an expression in uqmbd.t")

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, axis_i: Vector,
            speed: Quantity,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, *,
            axis: Vector, speed: Quantity,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis_i: Vector, speed: Quantity
        ) -> None: ...
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis: Vector, speed: Quantity
        ) -> None: ...
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...

    def prepare(self) -> dict[str, Any]:
        """Return the displacement in the given pose."""
        return {"start": self.drawn_displacement()}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint | uqmbd.Auxiliary]:
        """Yield the constraint equation and the auxiliary state."""
        displacement = p.state("displacement")
        yield uqmbd.Auxiliary(displacement, p.speed, p.start)
        offset = p.body_j.point(p.point_j) - p.body_i.point(p.point_i)
        yield uqmbd.Constraint(p.body_i.direction(p.axis_i).dot(offset) - displacement, "displacement")
