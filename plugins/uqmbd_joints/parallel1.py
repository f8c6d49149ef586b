"""Primitive constraint of parallel axes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, overload

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Vector

__all__ = ["Parallel1"]


class Parallel1(uqmbd.Component):
    """Two axes stay parallel with the same sense: two equations, the axis equations of a spatial `Revolute` joint.

    The equations set two vector components of the relative quaternion of the joint frames to zero, as in `Revolute`.

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
        """Return a joint frame in each body, with the joint axis as its third axis."""
        frame_i, frame_j = uqmbd.extend.joint_frames(self.axis_i, self.axis_j)
        return {"frame_i": frame_i, "frame_j": frame_j}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the constraint equations."""
        relative = uqmbd.extend.relative_quaternion(p.body_i.attitude(p.frame_i), p.body_j.attitude(p.frame_j))
        yield uqmbd.Constraint(relative[1:3], "axis")
