"""The torsion spring-damper."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import sympy

import uqmbd

__all__ = ["TorsionSpringDamper"]


class TorsionSpringDamper(uqmbd.Component):
    """A linear spring and damper about a common axis of two bodies.

    The angle of body j relative to body i is a state of its own, so any number of turns is counted.  In the plane it
    starts as the bodies are drawn, in space within half a turn of zero.

    Examples
    --------
    >>> TorsionSpringDamper.signature()
    '(name, body_i, body_j, stiffness, damping=0, free_angle=0, axis_i, axis_j)'
    """

    spaces = (uqmbd.Spatial, uqmbd.Planar)
    stiffness = uqmbd.Parameter("N m/rad", "spring rate")
    damping = uqmbd.Parameter("N m s/rad", "damper rate", default=0)
    free_angle = uqmbd.Parameter("rad", "angle without moment", default=0)
    axis_i = uqmbd.Parameter("1", "axis, frame of body i (left out in the plane)", kind="turning_axis")
    axis_j = uqmbd.Parameter("1", "axis, frame of body j (left out in the plane)", kind="turning_axis")

    def prepare(self) -> dict[str, Any]:
        """Lay a frame on each axis; in the plane take the angle from the drawing."""
        if not self.axis_i:
            return {"drawn": self.drawn_angle()}
        frame_i, frame_j = uqmbd.joint_frames(self.axis_i, self.axis_j)
        return {"frame_i": frame_i, "frame_j": frame_j}

    def terms(self, p: uqmbd.Local) -> Iterator[uqmbd.Auxiliary | uqmbd.Potential | uqmbd.VirtualWork]:
        """Yield the counted angle, energy and dissipation."""
        i, j = p.body_i, p.body_j
        rate = j.angular_velocity - i.angular_velocity
        if p.space.dimension == 3:
            rate = rate.dot(i.direction(p.axis_i))
            r = uqmbd.relative_quaternion(i.attitude(p.frame_i), j.attitude(p.frame_j))
            start = 2 * sympy.Piecewise((sympy.atan2(r[3], r[0]), r[0] >= 0), (sympy.atan2(-r[3], -r[0]), True))
        else:
            rate = rate[0]
            r = uqmbd.relative_quaternion(i.quaternion, j.quaternion)
            start = 2 * sympy.atan2(r[1], r[0])
            # the pair of half angles knows two turns; the drawing tells which ones are meant
            start += 4 * sympy.pi * sympy.floor((p.drawn - start) / (4 * sympy.pi) + sympy.Rational(1, 2))
        if p.stiffness != 0:
            angle = p.state("angle")
            yield uqmbd.Auxiliary(angle, rate, start)
            yield uqmbd.Potential(p.stiffness * (angle - p.free_angle) ** 2 / 2)
        yield uqmbd.VirtualWork(-p.damping * rate, rate)
