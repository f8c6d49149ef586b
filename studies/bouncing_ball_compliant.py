"""A ball bounces on a compliant floor: its contact force is not smooth, and a multi-element chaos resolves the kink.

A point of 1 kg falls from rest at h ~ Uniform(0.9, 1.1) m onto a plane.  The plane pushes back with ``k`` times the
depth, k ~ Normal(1e5, 5e3) N/m, and never pulls; the contact dissipates no energy.  ``height`` is the gap,
g = 9.81 m/s^2.  A contact lasts 10 ms, half a period of 20 ms, and is 14 mm deep.  The first contact begins between
0.43 s and 0.47 s, the second about 0.91 s later.  By then some realisations fall while others rise.

The arrival time varies by far more than the duration of a contact.  A plain expansion therefore fails at the first
impact: it would have to represent a kink that moves through the germ space.  Chaos works again in elements so small
that all realisations of an element are in contact at about the same time.  The stiffness hardly changes the times, so
the drop height has to be split.
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
