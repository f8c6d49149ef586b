"""A slider-crank with clearance in its piston pin: impacts in the joint limit the accuracy of every chaos.

The mechanism is the slider-crank of ``slider_crank.py`` at its mean lengths: crank 0.15 m, 0.36 kg; rod 0.35 m,
0.15 kg; slider 0.10 kg; both links slender.  A rotation driver turns it at 60 rad/s, so that the inertia of the slider,
not gravity, presses the pin against the bore.  It starts at the outer dead centre, where the slider is at rest.

A `ClearanceJoint` replaces the hinge.  A pin of 10 mm radius is fixed in the slider.  The bore in the rod is larger by
the clearance.  The contact follows the Hunt-Crossley law (stiffness 1e8 N/m^1.5, D = 0.5 s/m) with friction.  Radial
clearance ~ Uniform(0.1, 0.5) mm, coefficient of friction ~ Uniform(0.05, 0.15).  At the start the pin presses against
the far side of the bore, at the depth that its acceleration requires.

The force reverses twice per turn; then the pin crosses the clearance and hits the other side.  The slider follows that
of an ideal hinge to within the clearance, which is the only variation: its standard deviation is 0.12 mm after 0.1 s.
Times of crossings and impacts depend on the clearance.  A plain expansion is therefore inaccurate from the first
crossing (0.01 s) on, and its stated errors show this.  Elements are more accurate, at a higher cost.
"""

import chaospy
import numpy as np

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_contact import ClearanceJoint
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Prismatic, Revolute
from uqmbd_montecarlo import MonteCarlo

CRANK, ROD, SPEED = 0.15, 0.35, 60.0  # m, m, rad/s

clearance = uqmbd.RandomVariable("clearance", chaospy.Uniform(1e-4, 5e-4), units="m")
friction = uqmbd.RandomVariable("friction", chaospy.Uniform(0.05, 0.15))

STIFFNESS = 1e8  # N/m^1.5
depth = (0.10 * SPEED**2 * CRANK * (1 + CRANK / ROD) / STIFFNESS) ** (2 / 3)  # of the contact at the start, m

mechanism = uqmbd.Mechanism("clearance", uqmbd.Planar(gravity=(0.0, -9.81)))
ground = mechanism.ground
crank = mechanism.body("crank", mass=0.36, inertia=0.36 * CRANK**2 / 12, position=(CRANK / 2, 0))
rod = mechanism.body(
    "rod",
    mass=0.15,
    inertia=0.15 * ROD**2 / 12,
    position=(CRANK + ROD / 2, 0),
    angular_velocity=-SPEED * CRANK / ROD,
)
slider = mechanism.body(
    "slider", mass=0.10, inertia=1e-4, position=(CRANK + ROD + clearance + depth, 0), velocity=(0, 0)
)

mechanism.add(Revolute("crank_bearing", ground, crank, point_i=(0, 0), point_j=(-CRANK / 2, 0)))
mechanism.add(Revolute("crank_pin", crank, rod, point_i=(CRANK / 2, 0), point_j=(-ROD / 2, 0)))
mechanism.add(Prismatic("guide", ground, slider, point_i=(0, 0), point_j=(0, 0), axis_i=(1, 0), axis_j=(1, 0)))
mechanism.add(RotationDriver("drive", ground, crank, angle=SPEED * uqmbd.t))
pin = mechanism.add(
    ClearanceJoint(
        "piston_pin",
        rod,
        slider,
        point_i=(ROD / 2, 0),
        point_j=(0, 0),
        radius=0.01,
        clearance=clearance,
        law="hunt-crossley",
        stiffness=STIFFNESS,
        damping=0.5,
        friction=friction,
        slow=0.01,
    )
)

mechanism.output("slider_x", slider.position[0], units="m")
mechanism.output("pin_offset", slider.position[0] - rod.point((ROD / 2, 0))[0], units="m")
mechanism.output("pin_force", pin.reaction_force[0], units="N")

study = uqmbd.Study(
    "clearance",
    mechanism,
    times=np.linspace(0, 0.2, 401),
    propagators=[
        MonteCarlo(samples=200, seed=1),
        Collocation(order=5, label="plain"),
        Collocation(order=2, elements="adaptive", max_elements=24, label="multi-element"),
    ],
    report_times=[0.02, 0.1, 0.2],
)
