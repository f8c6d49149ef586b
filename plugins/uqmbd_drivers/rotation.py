"""Rotational driver."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import sympy

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Quantity, Vector

__all__ = ["RotationDriver"]


class RotationDriver(uqmbd.Component):
    """The rotation of body j relative to body i, about a common axis, follows a function of time.

    With the relative quaternion ``r`` and the angle ``a``, the equation is ``r0 sin(a/2) - r3 cos(a/2) = 0``. It
    contains no ``atan2``, so any number of turns is possible. The angle may also depend on other joints, as in
    ``angle=2 * joint.angle``; body j then follows these joints.

    Angles of bodies, of joints and in springs count turns from the start. The initial angles are within half a turn of
    the given pose. If the initial angle of the driver is further away, such as 7 rad with a given angle of 0, uqmbd
    issues a `uqmbd.StudyWarning`. To avoid the warning, give the body the initial angle. Alternatively, add
    ``mechanism.start(joint.angle, 7)``, so that the angle of the joint includes the earlier turns. For a driver that
    follows a joint, state the initial angles of both.

    Examples
    --------
    >>> RotationDriver.signature()
    '(name, body_i, body_j, angle, axis_i, axis_j)'
    """

    symbol = "driver"
    prescribed_angle = "angle"
    spaces = (uqmbd.Spatial, uqmbd.Planar)
    angle = uqmbd.Parameter("rad", "angle, an expression in uqmbd.t; zero where the two frames coincide")
    axis_i = uqmbd.Parameter("1", "axis, frame of body i (omit it in planar space)", kind="turning_axis", body="body_i")
    axis_j = uqmbd.Parameter("1", "axis, frame of body j (omit it in planar space)", kind="turning_axis", body="body_j")

    if TYPE_CHECKING:

        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, angle: Quantity, axis_i: Vector = (),
            axis_j: Vector = (), *, axis: Vector = (),
        ) -> None: ...  # fmt: skip

    def prepare(self) -> dict[str, Any]:
        """Return a joint frame on each axis."""
        if not self.axis_i:
            return {}
        frame_i, frame_j = uqmbd.extend.joint_frames(self.axis_i, self.axis_j)
        return {"frame_i": frame_i, "frame_j": frame_j}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the constraint equation."""
        turned = (
            [f.attitude(frame) for f, frame in ((p.body_i, p.frame_i), (p.body_j, p.frame_j))]
            if p.axis_i
            else [p.body_i.quaternion, p.body_j.quaternion]
        )
        relative = uqmbd.extend.relative_quaternion(*turned)
        half = p.angle / 2
        yield uqmbd.Constraint(relative[0] * sympy.sin(half) - relative[-1] * sympy.cos(half), "angle")
