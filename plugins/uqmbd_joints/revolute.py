"""Revolute joint."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, overload

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Vector

__all__ = ["Revolute"]


class Revolute(uqmbd.Component):
    """A hinge: two points coincide, and in three dimensions two axes are parallel.

    The axis equations use the quaternion of joint frame j relative to joint frame i: its first two vector components
    are zero. These equations are quadratic in the coordinates. Unlike the usual dot products, they exclude the mirror
    image.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    >>> rod = mechanism.body("rod", mass=1, inertia=1 / 12, position=(0.5, 0))
    >>> mechanism.add(Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-0.5, 0)))
    <Revolute 'pivot': ground, rod>
    """

    symbol = "hinge"
    point_i = uqmbd.Parameter("m", "joint point, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "joint point, frame of body j", kind="point", body="body_j")
    axis_i = uqmbd.Parameter(
        "1", "joint axis, frame of body i (omit it in planar space)", kind="turning_axis", body="body_i"
    )
    axis_j = uqmbd.Parameter(
        "1", "joint axis, frame of body j (omit it in planar space)", kind="turning_axis", body="body_j"
    )

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector,
            axis_i: Vector = (), axis_j: Vector = (), *, axis: Vector = (),
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis_i: Vector = (),
            axis_j: Vector = (), axis: Vector = (),
        ) -> None: ...  # fmt: skip
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...

    def prepare(self) -> dict[str, Any]:
        """Return a joint frame in each body, with the joint axis as its third axis."""
        if not self.axis_i:
            return {}
        frame_i, frame_j = uqmbd.extend.joint_frames(self.axis_i, self.axis_j)
        return {"frame_i": frame_i, "frame_j": frame_j}

    def motion(self) -> dict[str, Any]:
        """Return the angle, counted over any number of turns; it is zero if the joint frames coincide."""
        return {"angle": self.joint_angle()}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the constraint equations."""
        i, j = p.body_i, p.body_j
        yield uqmbd.Constraint(j.point(p.point_j) - i.point(p.point_i), "point")
        if p.space.dimension == 3:
            relative = uqmbd.extend.relative_quaternion(i.attitude(p.frame_i), j.attitude(p.frame_j))
            yield uqmbd.Constraint(relative[1:3], "axis")
