"""Torsion spring-damper."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Quantity, Vector
from uqmbd_springs.turning import rotation_rate

__all__ = ["TorsionSpringDamper"]


class TorsionSpringDamper(uqmbd.Component):
    """A linear spring and damper about a common axis of two bodies.

    The angle of body j relative to body i is an auxiliary state that counts any number of turns. In planar space, the
    initial angle is in the turn of the given pose. In three dimensions, the initial angle is within half a turn of
    zero.

    Examples
    --------
    >>> TorsionSpringDamper.signature()
    '(name, body_i, body_j, stiffness, damping=0, free_angle=0, axis_i, axis_j)'
    """

    symbol = "coil"
    spaces = (uqmbd.Spatial, uqmbd.Planar)
    stiffness = uqmbd.Parameter("N m/rad", "spring rate", one_sign=True)
    damping = uqmbd.Parameter("N m s/rad", "damper rate", default=0, one_sign=True)
    free_angle = uqmbd.Parameter("rad", "angle without moment", default=0)
    axis_i = uqmbd.Parameter("1", "axis, frame of body i (omit it in planar space)", kind="turning_axis", body="body_i")
    axis_j = uqmbd.Parameter("1", "axis, frame of body j (omit it in planar space)", kind="turning_axis", body="body_j")

    if TYPE_CHECKING:

        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, stiffness: Quantity, damping: Quantity = 0,
            free_angle: Quantity = 0, axis_i: Vector = (), axis_j: Vector = (), *, axis: Vector = (),
        ) -> None: ...  # fmt: skip

    def prepare(self) -> dict[str, Any]:
        """Return a joint frame in each body; in planar space, the angle in the given pose."""
        if not self.axis_i:
            return {"drawn": self.drawn_angle()}
        frame_i, frame_j = uqmbd.extend.joint_frames(self.axis_i, self.axis_j)
        near = getattr(self.joint_angle(), "near", 0)
        return {"frame_i": frame_i, "frame_j": frame_j, "near": near}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Auxiliary | uqmbd.Potential | uqmbd.VirtualWork]:
        """Yield the counted angle, energy and dissipation."""
        rate, start = rotation_rate(p)
        if p.stiffness != 0:
            angle = p.state("angle")
            yield uqmbd.Auxiliary(angle, rate, start)
            yield uqmbd.Potential(p.stiffness * (angle - p.free_angle) ** 2 / 2)
        yield uqmbd.VirtualWork(-p.damping * rate, rate)
