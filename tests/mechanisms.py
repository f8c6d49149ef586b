"""Makers of small mechanisms with random inputs that several folders of tests share."""

from __future__ import annotations

import chaospy
import sympy

import uqmbd
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Prismatic, Revolute, RollingWheel, Skate, Spherical
from uqmbd_springs import PointForce, SpringDamper, Torque


def random_length_and_mass(length=1.0):
    return (
        uqmbd.RandomVariable("length", chaospy.Normal(length, 0.02 * length), units="m"),
        uqmbd.RandomVariable("mass", chaospy.Uniform(0.8, 1.2), units="kg"),
    )


def pendulum(loaded=False, speed=None, angle=0.5):
    """A rod on a pin; loaded: with a torque and a force that grows with time."""
    length, mass = random_length_and_mass()
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    pose = (length / 2 * sympy.cos(angle), length / 2 * sympy.sin(angle))
    rod = mechanism.body(
        "rod", mass=mass, inertia=mass * length**2 / 12, position=pose, angle=angle, angular_velocity=speed
    )
    mechanism.add(Revolute("pin", mechanism.ground, rod, (0, 0), (-length / 2, 0)))
    if loaded:
        mechanism.add(Torque("torque", rod, 0.3))
        mechanism.add(PointForce("force", rod, (length / 2, 0), (1.0, 2 * uqmbd.t)))
    mechanism.output("x", rod.point((length / 2, 0))[0], units="m")
    mechanism.output("y", rod.point((length / 2, 0))[1], units="m")
    return mechanism


def slider_crank(torque=0.0):
    """The slider-crank of the studies without friction, its crank of random length and mass."""
    length, mass = random_length_and_mass(0.15)
    x, y = (length * f(sympy.pi / 4) for f in (sympy.cos, sympy.sin))
    turned = -sympy.asin(y / 0.35)
    end = x + 0.35 * sympy.cos(turned)
    mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Planar(gravity=(0, -9.81)))
    ground = mechanism.ground
    crank = mechanism.body(
        "crank", mass=0.36 * mass, inertia=0.03 * mass * length**2, position=(x / 2, y / 2), angle=sympy.pi / 4
    )
    rod = mechanism.body("rod", mass=0.15, inertia=0.15 * 0.35**2 / 12, position=((x + end) / 2, y / 2), angle=turned)
    slider = mechanism.body("slider", mass=0.1, inertia=1e-4, position=(end, 0))
    mechanism.add(Revolute("A", ground, crank, (0, 0), (-length / 2, 0)))
    mechanism.add(Revolute("B", crank, rod, (length / 2, 0), (-0.175, 0)))
    mechanism.add(Revolute("C", rod, slider, (0.175, 0), (0, 0)))
    mechanism.add(Prismatic("D", ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    if torque:
        mechanism.add(Torque("drive", crank, torque))
    mechanism.output("slider_x", slider.position[0], units="m")
    return mechanism


def spatial_pendulum():
    """A body with full inertia on a ball joint, spinning."""
    length, mass = random_length_and_mass()
    mechanism = uqmbd.Mechanism("spatial_pendulum", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    moments = (mass * length**2 / 12, 0.02, mass * length**2 / 12, 0.001, 0.002, 0.003)
    body = mechanism.body(
        "body", mass=mass, inertia=moments, com=(0.01, 0, 0), position=(0, length / 2, 0), angular_velocity=(1, 0, 0.5)
    )
    mechanism.add(Spherical("ball", mechanism.ground, body, (0, 0, 0), (0, -length / 2, 0)))
    mechanism.output("y", body.position[1], units="m")
    mechanism.output("z", body.position[2], units="m")
    return mechanism


def sleigh():
    """Chaplygin's sleigh, seen from above: a blade behind the centre of mass, of random distance and mass."""
    length, mass = random_length_and_mass(0.3)
    mechanism = uqmbd.Mechanism("sleigh", uqmbd.Planar())
    body = mechanism.body(
        "sleigh", mass=mass, inertia=0.1 * mass, com=(length, 0), velocity=(1, 0), angular_velocity=1.0
    )
    mechanism.add(Skate("blade", mechanism.ground, body, (0, 0), (1, 0)))
    mechanism.output("x", body.position[0], units="m")
    mechanism.output("y", body.position[1], units="m")
    return mechanism


def rolling_wheel():
    """A wheel of random radius and mass rolls down a line."""
    length, mass = random_length_and_mass(0.5)
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar(gravity=(3, -9)))
    wheel = mechanism.body("wheel", mass=mass, inertia=mass * length**2 / 2, position=(0, length))
    mechanism.add(RollingWheel("road", mechanism.ground, wheel, (0, 0), (0, 0), (0, 1), radius=length))
    mechanism.output("x", wheel.position[0], units="m")
    mechanism.output("spoke", wheel.direction((1, 0))[1])
    return mechanism


def oscillator(stiffness, damping=0.0, mass=1.0, velocity=None):
    """A mass on a spring without length: ``x'' = -stiffness / mass x``."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
    body = mechanism.body("body", mass=mass, position=(1, 0), velocity=velocity)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, (0, 0), (0, 0), stiffness, damping))
    mechanism.output("x", body.position[0], units="m")
    return mechanism


def driven_slider_crank(rod_length):
    """Crank 0.15 m that turns at 2 rad/s from 0; a shorter rod does not let it pass."""
    mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Planar())
    ground = mechanism.ground
    crank = mechanism.body("crank", mass=1, inertia=0.01)
    rod = mechanism.body("rod", mass=1, inertia=0.01, position=(0.15, 0))
    slider = mechanism.body("slider", mass=1, inertia=0.01, position=(0.15 + rod_length, 0))
    mechanism.add(Revolute("A", ground, crank, (0, 0), (0, 0)))
    mechanism.add(Revolute("B", crank, rod, (0.15, 0), (0, 0)))
    mechanism.add(Revolute("C", rod, slider, (rod_length, 0), (0, 0)))
    mechanism.add(Prismatic("D", ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    mechanism.add(RotationDriver("drive", ground, crank, 2 * uqmbd.t))
    mechanism.output("x", slider.position[0], units="m")
    return mechanism
