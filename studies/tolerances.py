"""A four-bar linkage with toleranced lengths: the share that violates its limits, and tolerances that reduce it to 1 %.

A crank of 40 mm turns once in a second.  A coupler of 120 mm drives a rocker of 80 mm, on a frame of 100 mm.
The lengths are drilled distances with limits of 0.10 to 0.15 mm on either side and a capability of 1.  The coupler
carries a roller, 20 h11.  Two limits apply: the lower edge of the roller stays 30.6 mm above the frame, and the rocker
does not swing beyond 128.75 degrees.

`uqmbd run studies/tolerances.py` computes how many linkages violate either limit.  `python studies/tolerances.py`
allocates the tolerances so that one in a hundred does, where the cost of a tolerance grows with the nominal length.
"""

import numpy as np
import sympy

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_reliability import allocate


def length(name, nominal, width):
    """Return a drilled distance."""
    return uqmbd.RandomVariable(name, uqmbd.tolerance(nominal, width, width, cpk=1), units="m")


crank_length = length("crank", 0.040, 0.00010)
coupler_length = length("coupler", 0.120, 0.00015)
rocker_length = length("rocker", 0.080, 0.00012)
frame_length = length("frame", 0.100, 0.00015)
roller = uqmbd.RandomVariable("roller", uqmbd.iso286(0.020, "h11", cpk=1, units="m"), units="m")

# the given pose for all lengths: crank along the frame, joint of coupler and rocker above it
rest = frame_length - crank_length
coupler_angle = sympy.acos((coupler_length**2 + rest**2 - rocker_length**2) / (2 * coupler_length * rest))
joint_x = crank_length + coupler_length * sympy.cos(coupler_angle)
joint_y = coupler_length * sympy.sin(coupler_angle)
rocker_angle = sympy.atan2(joint_y, joint_x - frame_length)

mechanism = uqmbd.Mechanism("four_bar", uqmbd.Planar())
ground = mechanism.ground
crank = mechanism.body("crank", mass=0.1, inertia=1e-5, position=(crank_length / 2, 0))
coupler = mechanism.body(
    "coupler", mass=0.2, inertia=1e-4, position=((crank_length + joint_x) / 2, joint_y / 2), angle=coupler_angle
)
rocker = mechanism.body(
    "rocker", mass=0.15, inertia=1e-4, position=((frame_length + joint_x) / 2, joint_y / 2), angle=rocker_angle
)
mechanism.add(Revolute("A", ground, crank, point_i=(0, 0), point_j=(-crank_length / 2, 0)))
mechanism.add(Revolute("B", crank, coupler, point_i=(crank_length / 2, 0), point_j=(-coupler_length / 2, 0)))
mechanism.add(Revolute("C", coupler, rocker, point_i=(coupler_length / 2, 0), point_j=(rocker_length / 2, 0)))
mechanism.add(Revolute("D", ground, rocker, point_i=(frame_length, 0), point_j=(-rocker_length / 2, 0)))
mechanism.add(RotationDriver("drive", ground, crank, angle=2 * sympy.pi * uqmbd.t))

edge = coupler.point((0, 0.060))[1] - roller / 2
mechanism.output("edge", edge, units="m")
mechanism.output("swing", rocker.angle, units="rad")
mechanism.require("clearance", edge >= 0.0306, description="lower edge of the roller above 30.6 mm")
mechanism.require("swing", rocker.angle <= sympy.rad(128.75), description="rocker within 128.75 degrees")

study = uqmbd.Study(
    "tolerances",
    mechanism,
    times=np.linspace(0, 1, 101),
    propagators=[MonteCarlo(samples=1000, seed=1), Collocation(order=2)],
)

ALLOWED = 0.01
COSTS = {"crank": 1.0, "rocker": 1.5, "frame": 2.0, "coupler": 2.5, "roller": 0.5}
"""Costs at a half width of 0.1 mm; halving it doubles them. Long distances are expensive, a ground roller is not."""

if __name__ == "__main__":
    print(allocate(study, None, ALLOWED, cost={name: 1e-4 * price for name, price in COSTS.items()}))
