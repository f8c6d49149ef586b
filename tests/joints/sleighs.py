"""Chaplygin's sleigh, seen from above."""

from __future__ import annotations

import uqmbd
from uqmbd_joints import Skate


def sleigh(speed, turning, inertia=0.15, mass=2.0, arm=0.3):
    mechanism = uqmbd.Mechanism("sleigh", uqmbd.Planar())
    body = mechanism.body(
        "sleigh", mass=mass, inertia=inertia, com=(arm, 0), velocity=(speed, 0), angular_velocity=turning
    )
    mechanism.add(Skate("blade", mechanism.ground, body, (0, 0), (1, 0)))
    mechanism.output("speed", body.direction((1, 0)).dot(body.velocity), units="m/s")
    mechanism.output("across", body.direction((0, 1)).dot(body.velocity), units="m/s")
    mechanism.output("turning", body.angular_velocity[0], units="rad/s")
    mechanism.output("angle", body.angle, units="rad")
    return mechanism
