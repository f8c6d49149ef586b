"""The parallel-axes primitive."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, overload

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Vector

__all__ = ["Parallel1"]


class Parallel1(uqmbd.Component):
    """Two axes stay parallel, and point the same way: two equations, those of a spatial hinge without its point.

    As in `Revolute`, two vector components of the relative quaternion of the joint frames vanish.

    Examples
    --------
    >>> Parallel1.signature()
    '(name, body_i, body_j, axis_i, axis_j)'
    """

    spaces = (uqmbd.Spatial,)
    axis_i = uqmbd.Parameter("1", "axis, frame of body i", kind="axis", body="body_i")
    axis_j = uqmbd.Parameter("1", "axis, frame of body j", kind="axis", body="body_j")

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, axis_i: Vector, axis_j: Vector
        ) -> None: ...
        @overload
        def __init__(self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, axis: Vector) -> None: ...
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...

    def prepare(self) -> dict[str, Any]:
        """Lay a frame on each axis."""
        frame_i, frame_j = uqmbd.extend.joint_frames(self.axis_i, self.axis_j)
        return {"frame_i": frame_i, "frame_j": frame_j}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the geometry."""
        relative = uqmbd.extend.relative_quaternion(p.body_i.attitude(p.frame_i), p.body_j.attitude(p.frame_j))
        yield uqmbd.Constraint(relative[1:3], "axis")
