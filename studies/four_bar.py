"""A four-bar linkage with an uncertain payload: the probability that the force in its crank pin stays below a limit.

A motor turns the crank (0.1 m) at an uncertain speed.  The coupler is 0.4 m +-2 mm and the rocker 0.3 m long, both
slender; gravity acts along -y.  A torsion spring and a damper act at the pivot of the rocker, and its end carries an
uncertain payload.  The drawing places the rocker where a coupler of nominal length reaches it; assembly closes the
joints for other lengths.

uqmbd run studies/four_bar.py --require 1% tests whether the force in the crank pin stays below 38 N with 99 %.
"""

from math import atan2, cos, pi, sin, sqrt

import chaospy
import numpy as np

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_drivers import SpeedDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Fixed, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import TorsionSpringDamper

length = uqmbd.RandomVariable("coupler_length", uqmbd.tolerance(0.4, 0.002, 0.002), units="m")
stiffness = uqmbd.RandomVariable("stiffness", chaospy.Normal(5, 0.4), units="N m/rad")
payload = uqmbd.RandomVariable("payload", chaospy.Uniform(0.8, 1.2), units="kg")
speed = uqmbd.RandomVariable("speed", chaospy.Normal(10, 0.2), units="rad/s")

# the drawing: crank at 60 degrees; coupler and rocker meet above the line from crank pin to pivot
pivot = (0.4, 0.0)
pin = (0.1 * cos(pi / 3), 0.1 * sin(pi / 3))
dx, dy = pivot[0] - pin[0], pivot[1] - pin[1]
apart = sqrt(dx**2 + dy**2)
along = (0.4**2 - 0.3**2 + apart**2) / (2 * apart)
aside = sqrt(0.4**2 - along**2)
elbow = (pin[0] + (along * dx - aside * dy) / apart, pin[1] + (along * dy + aside * dx) / apart)
rocker_angle = atan2(elbow[1] - pivot[1], elbow[0] - pivot[0])
coupler_angle = atan2(elbow[1] - pin[1], elbow[0] - pin[0])


def middle(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    """Return the midpoint of two points, which is the centre of a slender body."""
    return (a[0] + b[0]) / 2, (a[1] + b[1]) / 2


mechanism = uqmbd.Mechanism("four_bar", uqmbd.Planar(gravity=(0, -9.81)))
ground = mechanism.ground
crank = mechanism.body("crank", mass=0.3, inertia=0.3 * 0.1**2 / 12, position=middle((0, 0), pin), angle=pi / 3)
coupler = mechanism.body(
    "coupler", mass=0.5, inertia=0.5 * length**2 / 12, position=middle(pin, elbow), angle=coupler_angle
)
rocker = mechanism.body(
    "rocker", mass=0.6, inertia=0.6 * 0.3**2 / 12, position=middle(pivot, elbow), angle=rocker_angle
)
load = mechanism.body("load", mass=payload, inertia=payload * 0.03**2 / 2, position=elbow, angle=rocker_angle)

mechanism.add(Revolute("bearing", ground, crank, point_i=(0, 0), point_j=(-0.05, 0)))
crank_pin = mechanism.add(Revolute("crank_pin", crank, coupler, point_i=(0.05, 0), point_j=(-length / 2, 0)))
mechanism.add(Revolute("elbow", coupler, rocker, point_i=(length / 2, 0), point_j=(0.15, 0)))
mechanism.add(Revolute("pivot", ground, rocker, point_i=pivot, point_j=(-0.15, 0)))
mechanism.add(Fixed("bolts", rocker, load, point_i=(0.15, 0), point_j=(0, 0)))
mechanism.add(TorsionSpringDamper("spring", ground, rocker, stiffness=stiffness, damping=0.2, free_angle=rocker_angle))
mechanism.add(SpeedDriver("motor", ground, crank, speed=speed))

# components of the force; its norm has a kink where the force passes zero, which polynomials approximate poorly
force = crank_pin.reaction_force
mechanism.output("rocker_angle", rocker.angle, units="rad")
mechanism.output("force_x", force[0], units="N")
mechanism.output("force_y", force[1], units="N")
mechanism.output("peak_force", uqmbd.maximum(force.norm()), units="N")
mechanism.require("strength", force.norm() <= 38, description="crank pin, 38 N")

study = uqmbd.Study(
    "four_bar",
    mechanism,
    times=np.linspace(0, 1, 101),
    propagators=[MonteCarlo(samples=1000, seed=1), Collocation(order=4), Galerkin(order=4)],
)
