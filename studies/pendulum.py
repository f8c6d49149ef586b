"""A pendulum whose length is not known exactly: the first example."""

import chaospy
import numpy as np

import uqmbd
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo

length = uqmbd.RandomVariable("length", chaospy.Normal(1.0, 0.02), units="m")
mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0.0, -9.81)))
rod = mechanism.body("rod", mass=1.2 * length, inertia=1.2 * length**3 / 12, position=(length / 2, 0))
mechanism.add(Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-length / 2, 0)))
mechanism.output("angle", rod.angle, units="rad")
study = uqmbd.Study("pendulum", mechanism, np.linspace(0, 5, 251), [MonteCarlo(samples=200, seed=1)])
