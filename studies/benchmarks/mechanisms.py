"""The mechanisms of the benchmarks that no study describes: a spherical five-bar, and a slider-crank of many inputs.

Four bodies in the arrangement of the Agile Eye: bodies 2 and 3 turn in the ground about x and y, body 1 turns on body 2
about y, body 4 on body 1 about x, and the z axes of bodies 4 and 3 stay parallel.  All axes meet in the origin, where
all body frames are; two degrees of freedom.  Small constant torques drive bodies 2 and 3 from rest, without gravity.
"""

from __future__ import annotations

from typing import Any

import chaospy
import sympy

import uqmbd
from uqmbd_joints import Parallel1, Prismatic, Revolute
from uqmbd_springs import Torque, TorsionSpringDamper

__all__ = ["BODIES", "END", "TORQUES", "five_bar", "slider_crank"]

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
    mechanism.add(Parallel1("4-3", body["body4"], body["body3"], axis_i=z, axis_j=z))
    mechanism.add(Torque("torque2", body["body2"], torque=(TORQUES[0], 0, 0)))
    mechanism.add(Torque("torque3", body["body3"], torque=(0, TORQUES[1], 0)))
    for i, letter in enumerate("xyz"):
        mechanism.output(f"camera_{letter}", body["body1"].rotation[i, 2], units="1")
    return mechanism


def slider_crank(inputs: int) -> uqmbd.Mechanism:
    """Make the slider-crank of the study, of which two to six numbers are random, normal with 2 %."""
    values = {"crank_length": 0.15, "rod_length": 0.35, "crank_mass": 0.36, "rod_mass": 0.15, "torque": 0.1}
    values["damping"] = 0.005
    units = ("m", "m", "kg", "kg", "N m", "N m s")
    p: dict[str, Any] = dict(values)
    for (name, value), unit in list(zip(values.items(), units, strict=True))[:inputs]:
        p[name] = uqmbd.RandomVariable(name, chaospy.Normal(value, 0.02 * value), units=unit)
    a, b = p["crank_length"], p["rod_length"]
    pin = a / sympy.sqrt(2)
    angle = -sympy.asin(pin / b)
    end = pin + b * sympy.cos(angle)
    mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Planar(gravity=(0.0, -9.81)))
    ground, mass = mechanism.ground, p["crank_mass"]
    crank = mechanism.body(
        "crank", mass=mass, inertia=mass * a**2 / 12, position=(pin / 2, pin / 2), angle=sympy.pi / 4
    )
    mass = p["rod_mass"]
    rod = mechanism.body("rod", mass=mass, inertia=mass * b**2 / 12, position=((pin + end) / 2, pin / 2), angle=angle)
    slider = mechanism.body("slider", mass=0.10, inertia=1e-4, position=(end, 0))
    mechanism.add(Revolute("crank_bearing", ground, crank, point_i=(0, 0), point_j=(-a / 2, 0)))
    mechanism.add(Revolute("crank_pin", crank, rod, point_i=(a / 2, 0), point_j=(-b / 2, 0)))
    wrist = mechanism.add(Revolute("piston_pin", rod, slider, point_i=(b / 2, 0), point_j=(0, 0)))
    mechanism.add(Prismatic("guide", ground, slider, point_i=(0, 0), point_j=(0, 0), axis_i=(1, 0), axis_j=(1, 0)))
    mechanism.add(Torque("drive", crank, torque=p["torque"]))
    mechanism.add(TorsionSpringDamper("friction", ground, crank, stiffness=0, damping=p["damping"]))
    mechanism.output("slider_x", slider.position[0], units="m")
    mechanism.output("crank_angle", crank.angle, units="rad")
    mechanism.output("pin_force", wrist.reaction_force[0], units="N")
    return mechanism
