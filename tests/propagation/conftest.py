"""Small mechanisms with random inputs."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_joints import Distance
from uqmbd_montecarlo import MonteCarlo


def oscillator():
    """A point mass that hangs on a rod of random length, in the plane without rotations."""
    mechanism = uqmbd.Mechanism("swing", uqmbd.Translational(gravity=(0, -9.81)))
    length = uqmbd.RandomVariable("length", chaospy.Normal(1, 0.02), units="m")
    push = uqmbd.RandomVariable("push", chaospy.Uniform(0.1, 0.2), units="m/s")
    bob = mechanism.body("bob", mass=1, position=(0, -length), velocity=(push, 0))
    rod = mechanism.add(Distance("rod", mechanism.ground, bob, (0, 0), (0, 0), length=length))
    mechanism.output("x", bob.position[0], units="m")
    mechanism.output("pull", rod.reaction_force[1], units="N")
    return mechanism


def fragile(highest):
    """A bob between two rods from posts 1.8 m apart: short rods do not reach each other."""
    mechanism = uqmbd.Mechanism("fragile", uqmbd.Translational())
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.5, highest), units="m")
    bob = mechanism.body("bob", mass=1, position=(0, max(0.5, highest / 2)))
    for name, x in (("left", -0.9), ("right", 0.9)):
        mechanism.add(Distance(name, mechanism.ground, bob, (x, 0), (0, 0), length=length))
    mechanism.output("y", bob.position[1], units="m")
    return mechanism


@pytest.fixture(scope="session")
def swing():
    """A study of the swing with one propagator."""
    return uqmbd.Study("swings", oscillator(), np.linspace(0, 0.5, 6), [MonteCarlo(samples=100, seed=3)])


@pytest.fixture(scope="session")
def results(swing):
    """What it gives."""
    return swing.run()
