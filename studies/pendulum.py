"""A pendulum of uncertain length swings freely: mean and spread of the height of its tip over time."""

import chaospy
import numpy as np

import uqmbd
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo

length = uqmbd.RandomVariable("length", chaospy.Normal(1.0, 0.02), units="m")
mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0.0, -9.81)))
rod = mechanism.body("rod", mass=1.0, inertia=length**2 / 12, position=(length / 2, 0), angle=0.0)
mechanism.add(Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-length / 2, 0)))
mechanism.output("tip_height", rod.point((length / 2, 0))[1], units="m")
study = uqmbd.Study("pendulum", mechanism, times=np.linspace(0, 2, 201), propagators=[MonteCarlo(samples=200, seed=1)])
