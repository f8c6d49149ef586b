"""Gears, and rack and pinion."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Literal, overload

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Quantity, Vector

__all__ = ["Gear", "RackAndPinion"]


class Gear(uqmbd.Component):
    """Two meshing gears: relative to the carrier of their axes, body i makes `ratio` turns for each turn of body j.

    The angle of each gear about its axis is zero in the given pose. Other joints must fix the axes in the carrier. The
    reaction is the moment on body j. If body j is the ground, the reaction is the negative moment on body i.

    Examples
    --------
    >>> Gear.signature()
    "(name, body_i, body_j, ratio, axis_i, axis_j, mesh='external', carrier=ground)"
    """

    bodies = ("body_i", "body_j", "carrier")
    grounded = ("carrier",)
    spaces = (uqmbd.Spatial, uqmbd.Planar)
    ratio = uqmbd.Parameter("1", "turns of body i per turn of body j: teeth of j over teeth of i")
    axis_i = uqmbd.Parameter(
        "1", "axis of body i, in its frame (omit it in planar space)", kind="turning_axis", body="body_i"
    )
    axis_j = uqmbd.Parameter(
        "1", "axis of body j, in its frame (omit it in planar space)", kind="turning_axis", body="body_j"
    )
    mesh = uqmbd.Parameter(
        "", "external: opposite turns; internal: alike", kind="option", default="external",
        choices=("external", "internal"),
    )  # fmt: skip

    if TYPE_CHECKING:

        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, ratio: Quantity, axis_i: Vector = (),
            axis_j: Vector = (), mesh: Literal["external", "internal"] = "external", *, axis: Vector = (),
            carrier: NamedFrame | None = None,
        ) -> None: ...  # fmt: skip

    def prepare(self) -> dict[str, Any]:
        """Return the quaternions of both gears relative to the carrier in the given pose."""
        for x in "ij":
            if self.attached[f"body_{x}"] is self.attached["carrier"]:
                raise uqmbd.StudyError(
                    f"body_{x} and the carrier are both the ground: body_{x} cannot turn relative to the carrier, so "
                    "the other gear could not turn either; give carrier=, the body that holds the axes of the gears."
                )
        return {f"drawn_{x}": self.drawn_quaternion("carrier", f"body_{x}") for x in "ij"}

    def motion(self) -> dict[str, Any]:
        """Return the angles of both gears relative to the carrier, zero in the given pose."""
        return {f"angle_{x}": self.joint_angle("carrier", f"body_{x}", drawn=True, speed=f"speed_{x}") for x in "ij"}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint | uqmbd.Auxiliary]:
        """Yield the constraint equation and the auxiliary states."""
        first, turns_i = uqmbd.extend.counted_angle(p, "angle_i", p.carrier, p.body_i, p.drawn_i, p.axis_i)
        second, turns_j = uqmbd.extend.counted_angle(p, "angle_j", p.carrier, p.body_j, p.drawn_j, p.axis_j)
        yield turns_i
        yield turns_j
        yield uqmbd.Constraint(first + (p.ratio if p.mesh == "external" else -p.ratio) * second, "mesh")


class RackAndPinion(uqmbd.Component):
    """A pinion (body j) rolls on a rack (body i): as the pinion turns, its centre advances from the given position.

    Other joints must keep the pinion on the rack. A wheel that rolls on the ground is also a pinion.

    Examples
    --------
    >>> RackAndPinion.signature()
    '(name, body_i, body_j, point_i, point_j, axis_i, axis_j, radius)'
    """

    spaces = (uqmbd.Spatial, uqmbd.Planar)
    drawn_by = ("at",)
    point_i = uqmbd.Parameter("m", "a point of the rack, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "centre of the pinion, frame of body j", kind="point", body="body_j")
    axis_i = uqmbd.Parameter("1", "direction of the rack, frame of body i", kind="axis", body="body_i")
    axis_j = uqmbd.Parameter(
        "1", "axis of the pinion, frame of body j (omit it in planar space)", kind="turning_axis", body="body_j"
    )
    radius = uqmbd.Parameter(
        "m", "advance per radian; negative if a positive turn moves the pinion backwards", about="point_j"
    )

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, axis_i: Vector,
            axis_j: Vector, radius: Quantity,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, axis_i: Vector,
            *, radius: Quantity,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis_i: Vector,
            axis_j: Vector = (), radius: Quantity,
        ) -> None: ...  # fmt: skip
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...

    def prepare(self) -> dict[str, Any]:
        """Return the relative rotation and the displacement in the given pose."""
        return {"drawn": self.drawn_quaternion(), "start": self.drawn_displacement()}

    def motion(self) -> dict[str, Any]:
        """Return the pinion's angle, zero in the given pose, and its centre's displacement from the rack's point."""
        return {"angle": self.joint_angle(drawn=True), "displacement": self.joint_displacement("sliding_speed")}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint | uqmbd.Auxiliary]:
        """Yield the constraint equation and the auxiliary state."""
        angle, turns = uqmbd.extend.counted_angle(p, "angle", p.body_i, p.body_j, p.drawn, p.axis_j)
        yield turns
        offset = p.body_j.point(p.point_j) - p.body_i.point(p.point_i)
        advance = p.body_i.direction(p.axis_i).dot(offset) - p.start
        yield uqmbd.Constraint(advance - p.radius * angle, "rolling")
