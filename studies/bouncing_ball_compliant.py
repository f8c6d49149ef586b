"""A bouncing ball on a compliant floor: a contact force that is no smooth function of the gap.

A point of 1 kg falls from rest at h ~ Uniform(0.9, 1.1) m onto a plane that pushes back with ``k`` times the depth,
k ~ Normal(1e5, 5e3) N/m, and never pulls; nothing is lost.  ``height`` is the gap, g = 9.81 m/s^2.  A contact lasts
10 ms, half a period of 20 ms, and is 14 mm deep; the first one begins between 0.43 s and 0.47 s, the second about
0.91 s later, and by then realisations that fall and others that rise are mixed.

The time of arrival varies by far more than the contact lasts, so a plain expansion breaks down with the first impact:
it would have to follow a kink that moves through the germ space.  Elements that are so small that within each of them
all realisations are in contact at about the same time make chaos work again; the stiffness hardly changes the times, so
that it is the drop height that has to be split.
"""

import chaospy
import numpy as np

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneContact
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo

drop = uqmbd.RandomVariable("drop_height", chaospy.Uniform(0.9, 1.1), units="m")
stiffness = uqmbd.RandomVariable("stiffness", chaospy.Normal(1e5, 5e3), units="N/m")

mechanism = uqmbd.Mechanism("bouncing_ball_compliant", uqmbd.Translational(gravity=(0, -9.81)))
ball = mechanism.body("ball", mass=1, position=(0, drop), velocity=(0, 0))
floor = mechanism.add(
    PlaneContact(
        "floor",
        mechanism.ground,
        ball,
        point_i=(0, 0),
        point_j=(0, 0),
        normal_i=(0, 1),
        law="linear",
        stiffness=stiffness,
    )
)

mechanism.output("height", ball.position[1], units="m")
mechanism.output("velocity", ball.velocity[1], units="m/s")

study = uqmbd.Study(
    "bouncing_ball_compliant",
    mechanism,
    times=np.linspace(0, 2.4, 241),
    propagators=[
        MonteCarlo(samples=500, seed=1),
        Collocation(order=6, label="plain"),
        Collocation(order=4, elements="adaptive", label="multi-element"),
        Galerkin(order=4, elements="adaptive", label="galerkin-multi-element"),
    ],
    report_times=[0.4, 0.9, 1.9],
)
