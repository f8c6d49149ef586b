"""A slider-crank accelerates to full speed: the probability that it overloads its bearing or leaves its guide.

The mechanism is that of `slider_crank.py` with uncertain lengths, slider mass and speed.  A motor turns the crank from
rest.  Its angular velocity grows linearly for 0.3 s to 60 rad/s and then stays constant.  The study answers three
questions.  Does the force at the piston pin stay below the capacity of its bearing (overload)?  Does the slider stay
clear of the end of its guide, whose position is also uncertain (clearance)?  When is the bearing overloaded first
(first passage)?

In closed form, the probability of violating the clearance is 1.562 %.  The bearing is overloaded with 2.848 %, and at
least one of both occurs with 4.33 % (2,000,000 samples of a surrogate whose error is 4e-5 N).  With the seeds 0 to 19
the intervals of Monte Carlo contain these numbers in 19, 20 and 20 of 20 cases.
"""

import chaospy
import numpy as np
import sympy

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_drivers import RotationDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Prismatic, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_reliability import Reliability

crank_length = uqmbd.RandomVariable("crank_length", chaospy.Normal(0.15, 0.001), units="m")
rod_length = uqmbd.RandomVariable("rod_length", chaospy.Normal(0.35, 0.001), units="m")
slider_mass = uqmbd.RandomVariable("slider_mass", chaospy.Normal(0.5, 0.01), units="kg")
speed = uqmbd.RandomVariable("speed", chaospy.Normal(60, 1.2), units="rad/s")
guide_end = uqmbd.RandomVariable("guide_end", chaospy.Normal(0.5035, 0.0008), units="m")

pin_x = crank_length * sympy.cos(sympy.pi / 4)
pin_y = crank_length * sympy.sin(sympy.pi / 4)
rod_angle = -sympy.asin(pin_y / rod_length)
slider_position = pin_x + rod_length * sympy.cos(rod_angle)

mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Planar(gravity=(0.0, -9.81)))
ground = mechanism.ground
crank = mechanism.body(
    "crank", mass=0.36, inertia=0.36 * crank_length**2 / 12, position=(pin_x / 2, pin_y / 2), angle=sympy.pi / 4
)
rod = mechanism.body(
    "rod",
    mass=0.15,
    inertia=0.15 * rod_length**2 / 12,
    position=((pin_x + slider_position) / 2, pin_y / 2),
    angle=rod_angle,
)
slider = mechanism.body("slider", mass=slider_mass, inertia=1e-4, position=(slider_position, 0))

mechanism.add(Revolute("crank_bearing", ground, crank, point_i=(0, 0), point_j=(-crank_length / 2, 0)))
mechanism.add(Revolute("crank_pin", crank, rod, point_i=(crank_length / 2, 0), point_j=(-rod_length / 2, 0)))
pin = mechanism.add(Revolute("piston_pin", rod, slider, point_i=(rod_length / 2, 0), point_j=(0, 0)))
mechanism.add(Prismatic("guide", ground, slider, point_i=(0, 0), point_j=(0, 0), axis_i=(1, 0), axis_j=(1, 0)))
turned = speed * sympy.Piecewise((uqmbd.t**2 / 0.6, uqmbd.t < 0.3), (uqmbd.t - 0.15, True))
mechanism.add(RotationDriver("drive", ground, crank, angle=sympy.pi / 4 + turned))

force = sympy.Abs(pin.reaction_force[0])
mechanism.output("peak_force", uqmbd.maximum(force), units="N")
mechanism.require("overload", force <= 420, description="bearing of the piston pin, 420 N")
mechanism.require("clearance", slider.position[0] <= guide_end, description="slider clear of the end of its guide")

study = uqmbd.Study(
    "limits",
    mechanism,
    times=np.linspace(0, 0.6, 61),
    propagators=[
        MonteCarlo(samples=4000, seed=1),
        Collocation(order=2, verify=32),
        Galerkin(order=2),
        Reliability(seed=1),
    ],
)
