"""The mechanisms of the benchmarks that no study describes: a spherical five-bar.

Four bodies in the arrangement of the Agile Eye: bodies 2 and 3 turn in the ground about x and y, body 1 turns on body 2
about y, body 4 on body 1 about x, and the z axes of bodies 4 and 3 stay parallel.  All axes meet in the origin, where
all body frames are; two degrees of freedom.  Small constant torques drive bodies 2 and 3 from rest, without gravity.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import uqmbd
from uqmbd_joints import Revolute
from uqmbd_springs import Torque

__all__ = ["BODIES", "END", "TORQUES", "five_bar"]

BODIES: dict[str, tuple[float, tuple[float, float, float], tuple[float, ...]]] = {
    "body1": (0.0349, (0.0, -4.87e-4, -0.0121), (1.3413e-5, 1.3830e-5, 4.5815e-6)),
    "body2": (0.0195, (0.0195, 0.0, 0.0), (3.4040e-5, 2.0830e-5, 5.4400e-5)),
    "body3": (0.0154, (0.0, 0.0, -0.0375), (1.7550e-5, 6.2820e-6, 1.1640e-5)),
    "body4": (0.0094, (-0.0169, 0.0, -0.0267), (1.1930e-5, 1.5360e-5, 3.6500e-6, 0.0, 2.493e-6, 0.0)),
}
"""Mass (kg), centre of mass (m, body frame) and inertia about it (kg m^2: xx, yy, zz, xy, xz, yz) of each body."""

TORQUES = (4.0e-4, 6.0e-4)
"""On body 2 about x and on body 3 about y, N m."""

END = 0.5
"""End of the motion, s."""


class ParallelAxes(uqmbd.Component):
    """Two axes stay parallel: two equations, those of a revolute without its point."""

    axis_i = uqmbd.Parameter("1", "axis, frame of body i", kind="turning_axis")
    axis_j = uqmbd.Parameter("1", "axis, frame of body j", kind="turning_axis")

    def prepare(self) -> dict[str, Any]:
        """Lay a frame on each axis."""
        frame_i, frame_j = uqmbd.joint_frames(self.axis_i, self.axis_j)
        return {"frame_i": frame_i, "frame_j": frame_j}

    def terms(self, p: uqmbd.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the geometry."""
        relative = uqmbd.relative_quaternion(p.body_i.attitude(p.frame_i), p.body_j.attitude(p.frame_j))
        yield uqmbd.Constraint(relative[1:3], "axis")


def five_bar() -> uqmbd.Mechanism:
    """Make the five-bar for uqmbd; its outputs are the direction of the z axis of body 1."""
    mechanism = uqmbd.Mechanism("five_bar", uqmbd.Spatial(gravity=(0, 0, 0)))
    ground = mechanism.ground
    body = {name: mechanism.body(name, mass=m, com=c, inertia=j) for name, (m, c, j) in BODIES.items()}
    x, y, z, origin = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)

    def revolute(name: str, i: Any, j: Any, axis: tuple[int, int, int]) -> None:
        mechanism.add(Revolute(name, i, j, point_i=origin, point_j=origin, axis_i=axis, axis_j=axis))

    revolute("ground-2", ground, body["body2"], x)
    revolute("ground-3", ground, body["body3"], y)
    revolute("2-1", body["body2"], body["body1"], y)
    revolute("1-4", body["body1"], body["body4"], x)
    mechanism.add(ParallelAxes("4-3", body["body4"], body["body3"], axis_i=z, axis_j=z))
    mechanism.add(Torque("torque2", body["body2"], torque=(TORQUES[0], 0, 0)))
    mechanism.add(Torque("torque3", body["body3"], torque=(0, TORQUES[1], 0)))
    for i, letter in enumerate("xyz"):
        mechanism.output(f"camera_{letter}", body["body1"].rotation[i, 2], units="1")
    return mechanism
