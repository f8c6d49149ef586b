"""Motions of many realisations with their energies, and mechanisms with random impacts."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd_contact import PlaneImpact


@pytest.fixture
def dropped():
    """Integrate a mechanism at values of its inputs: messages, total energy (K, T), states, counters."""

    def run(mechanism, values, times, rtol=1e-6):
        ensemble = Ensemble(build(mechanism), np.array(values))
        found = integrate(ensemble, np.asarray(times, dtype=float), rtol)
        energy = ensemble.energies(found.times, found.states).sum(axis=1)
        return found, energy

    return run


def number(name, low, high):
    return uqmbd.RandomVariable(name, chaospy.Uniform(low, high))


TILT, E, MU = number("tilt", -0.5, 0.5), number("e", 0, 0.95), number("mu", 0, 0.9)
HEIGHT, VX, VY, SPIN = number("height", 0, 0.6), number("vx", -3, 3), number("vy", -3, 1), number("spin", -30, 30)
ANGLE = number("angle", -3, 3)


def disc():
    """An eccentric disc on a tilted plane."""
    mechanism = uqmbd.Mechanism("disc", uqmbd.Planar(gravity=(0, -9.81)))
    motion = {"velocity": (VX, VY), "angular_velocity": SPIN}
    body = mechanism.body(
        "disc", mass=2, inertia=0.004, com=(0.02, 0), position=(0, 0.15 + HEIGHT), angle=ANGLE, **motion
    )
    up = (TILT, 1)
    mechanism.add(PlaneImpact("plane", mechanism.ground, body, (0, 0), (0, 0), up, 0.1, restitution=E, friction=MU))
    return mechanism


def rod():
    """A rod that falls on its ends."""
    mechanism = uqmbd.Mechanism("rod", uqmbd.Planar(gravity=(0, -9.81)))
    motion = {"velocity": (VX, VY), "angular_velocity": SPIN / 5}
    body = mechanism.body("rod", mass=1, inertia=1 / 12, position=(0, 0.6 + HEIGHT), angle=ANGLE, **motion)
    for k, x in enumerate((-0.5, 0.5)):
        mechanism.add(
            PlaneImpact(f"end{k}", mechanism.ground, body, (0, 0), (x, 0), (0, 1), restitution=E, friction=MU / 3)
        )
    return mechanism


def corner():
    """A disc in a corner, under gravity that presses it into the corner."""
    mechanism = uqmbd.Mechanism("corner", uqmbd.Planar(gravity=(-4, -9)))
    motion = {"velocity": (VX, VY), "angular_velocity": SPIN}
    body = mechanism.body("disc", mass=2, inertia=0.008, position=(0.3, 0.3 + HEIGHT), **motion)
    for name, up in (("floor", (TILT, 1)), ("wall", (1, 0))):
        mechanism.add(PlaneImpact(name, mechanism.ground, body, (0, 0), (0, 0), up, 0.05, restitution=E, friction=MU))
    return mechanism


def ball():
    """An eccentric ball with spin on a tilted plane in space."""
    mechanism = uqmbd.Mechanism("ball", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    body = mechanism.body(
        "ball",
        mass=1,
        inertia=(0.004, 0.005, 0.006),
        com=(0.01, 0, 0.005),
        position=(0, 0, 0.12 + HEIGHT),
        velocity=(VX, 0.5 * VY, VY),
        angular_velocity=(SPIN, 3, -SPIN / 2),
    )
    up, zero = (TILT, 0.2, 1), (0, 0, 0)
    mechanism.add(PlaneImpact("plane", mechanism.ground, body, zero, zero, up, 0.1, restitution=E, friction=MU))
    return mechanism


def groove():
    """A ball in a groove of two planes, along which it rolls or slides."""
    mechanism = uqmbd.Mechanism("groove", uqmbd.Spatial(gravity=(-3, -0.5, -9)))
    body = mechanism.body(
        "ball",
        mass=1,
        inertia=(0.004, 0.004, 0.004),
        position=(0.2, 0, 0.2 + HEIGHT),
        velocity=(VX / 2, VY / 2, VY),
        angular_velocity=(SPIN / 3, SPIN, -SPIN / 2),
    )
    zero = (0, 0, 0)
    for name, up in (("floor", (TILT, 0, 1)), ("wall", (1, 0, 0))):
        mechanism.add(PlaneImpact(name, mechanism.ground, body, zero, zero, up, 0.1, restitution=E, friction=MU))
    return mechanism


def ceiling():
    """A point thrown up a tilted wall and a ceiling that it just touches, or not: the height is that of the throw."""
    mechanism = uqmbd.Mechanism("ceiling", uqmbd.Translational(gravity=(0, -10)))
    body = mechanism.body("point", mass=1, position=(0, 0), velocity=(VX, 2))
    for name, place, up in (("floor", (0, 0), (0, 1)), ("ceiling", (0, 0.2 + 1e-6 * (HEIGHT - 0.3)), (0, -1))):
        mechanism.add(PlaneImpact(name, mechanism.ground, body, place, (0, 0), up, restitution=E, friction=MU))
    return mechanism


@pytest.fixture
def falling():
    """Make a mechanism by its name."""
    makers = {make.__name__: make for make in (disc, rod, corner, ball, ceiling, groove)}
    return lambda name: makers[name]()
