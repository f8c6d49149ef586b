"""A rigid ball bounces on a plane: jumps between realisations defeat a plain chaos, and event alignment restores it.

A point of 1 kg falls from rest onto a plane; ``height`` is the gap.  Drop height ~ Uniform(0.9, 1.1) m, coefficient of
restitution ~ Uniform(0.75, 0.85), g = 9.81 m/s^2.  Impacts occur at
``t_n = sqrt(2 h / g) (1 + 2 (e + ... + e^(n-1)))``.  The ball flies freely between impacts, so the motion has a closed
form.  The first impact occurs between 0.43 s and 0.47 s.  The second occurs between 1.07 s and 1.28 s, the third
between 1.55 s and 1.96 s.  At 1.9 s some realisations have bounced three times and others twice, and the velocity jumps
between them.

No polynomial in the inputs approximates a jump.  The plain expansion is accurate until the first realisation reaches
the plane.  At any order it is inaccurate at all times at which some realisations have bounced and others have not; its
stated error shows this.

Elements, each with a separate expansion, confine the error to the elements that the jump crosses.  In closed form, mean
and standard deviation at 1.9 s are 0.17989 and 0.06073 m for the height.  For the velocity they are 0.5619 and 1.2386
m/s.  Collocation and Galerkin with 64 elements of order 2 (1531 realisations) differ from them by at most 0.1 % of the
largest standard deviation over time.

Impact times, and the motion between impacts, are smooth functions of the inputs.  The event-aligned expansion therefore
converges exponentially, with some dozen realisations.
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
            Collocation(order=2, index_set="tensor", label="multi-element"),
            Collocation(alignment="events", label="event-aligned"),
        ],
        "order": {"plain": [2, 4, 6, 8], "event-aligned": [2, 3, 4, 5, 6]},
        "elements": {"multi-element": [4, 8, 16, 32]},
        "reference": Collocation(order=8, alignment="events", label="event-aligned-8"),
    },
)
