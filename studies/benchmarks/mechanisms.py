"""Mechanisms of the benchmarks that are not studies: a spherical five-bar, a slider-crank of many inputs, and chains.

The spherical five-bar has four bodies in the arrangement of the Agile Eye.  Bodies 2 and 3 rotate in the ground about x
and y.  Body 1 rotates on body 2 about y, body 4 on body 1 about x.  The z axes of bodies 4 and 3 stay parallel.  All
axes meet in the origin, which is also the origin of all body frames.  It has two degrees of freedom.  Small constant
torques drive bodies 2 and 3 from rest, without gravity.

The chains are of four-bars (a loop each), and open ones in the plane and in space.
"""

from __future__ import annotations

from typing import Any

import chaospy
import numpy as np
import sympy

import uqmbd
from uqmbd_joints import Parallel1, Prismatic, Revolute
from uqmbd_springs import Torque, TorsionSpringDamper

__all__ = [
    "BODIES",
    "END",
    "GRAVITY",
    "LINK",
    "OFFSET",
    "SPEED",
    "START",
    "TORQUES",
    "five_bar",
    "four_bars",
    "links",
    "slider_crank",
    "spatial_links",
]

BODIES: dict[str, tuple[float, tuple[float, float, float], tuple[float, ...]]] = {
    "body1": (0.0349, (0.0, -4.87e-4, -0.0121), (1.3413e-5, 1.3830e-5, 4.5815e-6)),
    "body2": (0.0195, (0.0195, 0.0, 0.0), (3.4040e-5, 2.0830e-5, 5.4400e-5)),
    "body3": (0.0154, (0.0, 0.0, -0.0375), (1.7550e-5, 6.2820e-6, 1.1640e-5)),
    "body4": (0.0094, (-0.0169, 0.0, -0.0267), (1.1930e-5, 1.5360e-5, 3.6500e-6, 0.0, 2.493e-6, 0.0)),
}
"""Mass (kg), centre of mass (m, body frame) and inertia about it (kg m^2: xx, yy, zz, xy, xz, yz) of each body."""

TORQUES = (4.0e-4, 6.0e-4)
"""Torques on body 2 about x and on body 3 about y, N m."""

END = 0.5
"""End of the motion of the five-bar, s."""

OFFSET = 0.002
"""Standard deviation of the random centre of mass of body 1 along x and y, m."""

GRAVITY = 9.81

START, SPEED = -np.pi / 2, 3.0
"""Angle and speed of the cranks of the four-bars at the start, rad and rad/s."""

LINK = {"length": 0.25, "mass": 0.5, "spread": 0.05, "angle": np.pi / 3, "end": 1.0}
"""Links of the open chains: length in m, mass in kg, its relative standard deviation, angle at the start from hanging
down in rad, end of the motion in s."""


def five_bar(random: bool = False) -> uqmbd.Mechanism:
    """Return the five-bar for uqmbd; its outputs are the direction of the z axis of body 1.

    With `random`, the centre of mass of body 1 is random along x and y.
    """
    mechanism = uqmbd.Mechanism("five_bar", uqmbd.Spatial(gravity=(0, 0, 0)))
    ground = mechanism.ground
    bodies: dict[str, Any] = dict(BODIES)
    if random:
        mass, com, inertia = bodies["body1"]
        spread = [chaospy.Normal(mean, OFFSET) for mean in com[:2]]
        moved = [uqmbd.RandomVariable(f"{a}_cm", d, units="m") for a, d in zip("xy", spread, strict=True)]
        bodies["body1"] = mass, (*moved, com[2]), inertia
    body = {name: mechanism.body(name, mass=m, com=c, inertia=j) for name, (m, c, j) in bodies.items()}
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
    """Return the slider-crank of the study with two to six random parameters, normal with 2 %."""
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


def four_bars(number: int) -> uqmbd.Mechanism:
    """Return a chain of four-bars; its output is the horizontal position of the tip of the first crank."""
    mechanism = uqmbd.Mechanism(f"chain_{number}", uqmbd.Planar(gravity=(0.0, -GRAVITY)))
    rod: dict[str, Any] = {"mass": 1.0, "inertia": 1 / 12}
    x, y = np.cos(START), np.sin(START)
    cranks = []
    for k in range(number + 1):
        speed = None if k else SPEED
        cranks.append(
            mechanism.body(f"crank{k}", **rod, position=(k + x / 2, y / 2), angle=START, angular_velocity=speed)
        )
        mechanism.add(Revolute(f"bearing{k}", mechanism.ground, cranks[k], point_i=(k, 0), point_j=(-0.5, 0)))
    for k in range(number):
        coupler = mechanism.body(f"coupler{k}", **rod, position=(k + x + 0.5, y), angle=0.0)
        mechanism.add(Revolute(f"left{k}", cranks[k], coupler, point_i=(0.5, 0), point_j=(-0.5, 0)))
        mechanism.add(Revolute(f"right{k}", cranks[k + 1], coupler, point_i=(0.5, 0), point_j=(0.5, 0)))
    mechanism.output("tip", cranks[0].point((0.5, 0))[0], units="m")
    return mechanism


def links(number: int) -> uqmbd.Mechanism:
    """Return an open chain of uniform rods in the plane with random masses, drawn in line.

    Its outputs are all angles, from hanging down.
    """
    length, angle = LINK["length"], LINK["angle"]
    mechanism = uqmbd.Mechanism(f"links_{number}", uqmbd.Planar(gravity=(0.0, -GRAVITY)))
    before: uqmbd.extend.NamedFrame = mechanism.ground
    along = (np.sin(angle) * length, -np.cos(angle) * length)
    for k in range(number):
        mass: Any = chaospy.Normal(LINK["mass"], LINK["spread"] * LINK["mass"])
        mass = uqmbd.RandomVariable(f"mass_{k}", mass, units="kg")
        place = ((k + 0.5) * along[0], (k + 0.5) * along[1])
        rod = mechanism.body(f"rod{k}", mass=mass, inertia=mass * length**2 / 12, position=place, angle=angle)
        mechanism.add(Revolute(f"hinge{k}", before, rod, point_i=(0, -length / 2 if k else 0), point_j=(0, length / 2)))
        mechanism.output(f"angle_{k}", rod.angle, units="rad")
        before = rod
    return mechanism


def spatial_links(number: int) -> uqmbd.Mechanism:
    """Return a hanging open chain in space with hinges about x and y in turn; output: the height of its end."""
    mechanism = uqmbd.Mechanism(f"spatial_links_{number}", uqmbd.Spatial(gravity=(0, 0, -GRAVITY)))
    length, mass = LINK["length"], LINK["mass"]
    round_ = mass * length**2 / 12
    before: uqmbd.extend.NamedFrame = mechanism.ground
    end = (0, 0, -length / 2)
    for k in range(number):
        rod = mechanism.body(
            f"rod{k}", mass=mass, inertia=(round_, round_, round_ / 20), position=(0, 0, -(k + 0.5) * length)
        )
        axis = (0, 1, 0) if k % 2 else (1, 0, 0)
        point = end if k else (0, 0, 0)
        hinge = {"point_i": point, "point_j": (0, 0, length / 2), "axis_i": axis, "axis_j": axis}
        mechanism.add(Revolute(f"hinge{k}", before, rod, **hinge))
        before = rod
    mechanism.output("height", before.point(end)[2], units="m")
    return mechanism
