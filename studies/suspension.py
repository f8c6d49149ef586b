"""A double wishbone suspension with uncertain hard points: spread of camber and half track over wheel travel.

The view is of the right wheel from the front, x outwards and y upwards, m.  The lower arm rotates about (0.25, 0.20) on
the chassis, the upper arm about (0.32, 0.40).  Their ball joints on the upright are 120 mm below and 130 mm above the
wheel centre.  The lengths of the arms have a standard deviation of 0.5 mm, the height of the upper pivot one of 1 mm.
The wheel moves from 60 mm in rebound to 60 mm in bump, so the outputs depend on the geometry only.

Camber is negative where the top of the wheel leans inwards.
"""

import chaospy
import numpy as np
import sympy

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_drivers import PositionDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo

CENTRE = (0.70, 0.30)
LOWER_PIVOT, UPPER_PIVOT = (0.25, 0.20), (0.32, 0.40)
LOWER_BALL, UPPER_BALL = (-0.08, -0.12), (-0.13, 0.13)
"""Ball joints on the upright, relative to the wheel centre."""
PATCH = (0.03, -0.30)
"""Contact patch, relative to the wheel centre."""
TRAVEL = 0.06

LOWER_LENGTH, UPPER_LENGTH = (
    float(np.hypot(*np.subtract(np.add(CENTRE, ball), pivot)))
    for ball, pivot in ((LOWER_BALL, LOWER_PIVOT), (UPPER_BALL, UPPER_PIVOT))
)

lower_length = uqmbd.RandomVariable("lower_length", chaospy.Normal(LOWER_LENGTH, 0.5e-3), units="m")
upper_length = uqmbd.RandomVariable("upper_length", chaospy.Normal(UPPER_LENGTH, 0.5e-3), units="m")
pivot_height = uqmbd.RandomVariable("pivot_height", chaospy.Normal(UPPER_PIVOT[1], 1e-3), units="m")

mechanism = uqmbd.Mechanism("double_wishbone", uqmbd.Planar())
ground = mechanism.ground
upright = mechanism.body("upright", mass=25, inertia=0.8, position=CENTRE)
for name, pivot, ball, length in (
    ("lower", LOWER_PIVOT, LOWER_BALL, lower_length),
    ("upper", (UPPER_PIVOT[0], pivot_height), UPPER_BALL, upper_length),
):
    run, rise = CENTRE[0] + ball[0] - pivot[0], CENTRE[1] + ball[1] - pivot[1]
    arm = mechanism.body(
        f"{name}_arm", mass=3, inertia=length**2 / 4, com=(length / 2, 0), position=pivot, angle=sympy.atan2(rise, run)
    )
    mechanism.add(Revolute(f"{name}_pivot", ground, arm, pivot, (0, 0)))
    mechanism.add(Revolute(f"{name}_ball", arm, upright, (length, 0), ball))
mechanism.add(PositionDriver("rig", ground, upright, CENTRE, (0, 0), (0, 1), TRAVEL * (2 * uqmbd.t - 1)))

mechanism.output("travel", 1000 * (upright.position[1] - CENTRE[1]), units="mm")
mechanism.output("camber", -upright.angle * 180 / sympy.pi, units="deg", over="travel")
mechanism.output("half_track", 1000 * upright.point(PATCH)[0], units="mm", over="travel")

study = uqmbd.Study(
    "suspension",
    mechanism,
    times=np.linspace(0, 1, 61),
    propagators=[MonteCarlo(samples=300, seed=1), Collocation(order=2), Galerkin(order=2)],
)
