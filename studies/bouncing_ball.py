"""A bouncing ball of which neither drop height nor restitution is known exactly: impacts of rigid bodies.

A point of 1 kg falls from rest onto a plane; ``height`` is the gap.  Drop height ~ Uniform(0.9, 1.1) m, coefficient of
restitution ~ Uniform(0.75, 0.85), g = 9.81 m/s^2.  Impacts are at ``t_n = sqrt(2 h / g) (1 + 2 (e + ... + e^(n-1)))``;
between them the ball flies freely, so that everything is known in closed form.  The first impact comes between 0.43 s
and 0.47 s, the second between 1.07 s and 1.28 s, the third between 1.55 s and 1.96 s: at 1.9 s some realisations have
bounced three times and others twice, and the velocity jumps between them.

No polynomial in the inputs follows a jump: the plain expansion is right until the first realisation meets the plane,
and wrong, whatever its order, at all times at which some have bounced and others have not; its stated error says so.
Elements, each with an expansion of its own, confine the error to those that the jump crosses.  At 1.9 s mean and
standard deviation of the closed form are 0.17989 and 0.06073 m for the height, 0.5619 and 1.2386 m/s for the velocity;
64 elements of order 2 (1531 realisations) miss them by 0.1 % of the largest standard deviation over time at most, by
collocation and by Galerkin.  Times of impacts, and the motion between them, are smooth functions of the inputs: the
event-aligned expansion converges exponentially, with some dozen realisations.
"""

import chaospy
import numpy as np

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo

drop = uqmbd.RandomVariable("drop_height", chaospy.Uniform(0.9, 1.1), units="m")
restitution = uqmbd.RandomVariable("restitution", chaospy.Uniform(0.75, 0.85))

mechanism = uqmbd.Mechanism("bouncing_ball", uqmbd.Translational(gravity=(0, -9.81)))
ball = mechanism.body("ball", mass=1, position=(0, drop), velocity=(0, 0))
floor = mechanism.add(
    PlaneImpact(
        "floor", mechanism.ground, ball, point_i=(0, 0), point_j=(0, 0), normal_i=(0, 1), restitution=restitution
    )
)

mechanism.output("height", ball.position[1], units="m")
mechanism.output("velocity", ball.velocity[1], units="m/s")
mechanism.output("first_impact", floor.event_time("impact", 1), units="s")
mechanism.output("second_impact", floor.event_time("impact", 2), units="s")
mechanism.output("third_impact", floor.event_time("impact", 3), units="s")

study = uqmbd.Study(
    "bouncing_ball",
    mechanism,
    times=np.linspace(0, 2.4, 241),
    propagators=[
        MonteCarlo(samples=500, seed=1),
        Collocation(order=6, label="plain"),
        Collocation(order=2, index_set="tensor", elements="adaptive", max_elements=64, label="multi-element"),
        Collocation(order=5, alignment="events", label="event-aligned"),
        Galerkin(order=2, elements="adaptive", max_elements=64, label="galerkin-multi-element"),
    ],
    report_times=[0.4, 1.0, 1.9],
    convergence={
        "propagators": [
            Collocation(label="plain"),
            Collocation(order=2, index_set="tensor", max_elements=64, label="multi-element"),
            Collocation(alignment="events", label="event-aligned"),
        ],
        "order": {"plain": [2, 4, 6, 8], "event-aligned": [2, 3, 4, 5, 6]},
        "elements": {"multi-element": [4, 8, 16, 32]},
        "reference": Collocation(order=8, alignment="events", label="event-aligned-8"),
    },
)
