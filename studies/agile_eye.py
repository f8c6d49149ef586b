"""The Agile Eye, a camera on a spherical five-bar: a polynomial chaos of order one misses the spread of its response.

Bodies 2 and 3 rotate in the ground about x and y.  Body 1 carries the camera and rotates on body 2 about y.  Body 4
rotates on body 1 about x, and the z axes of bodies 4 and 3 stay parallel.  All axes meet in the origin.  The model has
28 coordinates, 22 kinematic and 4 quaternion constraints, and two degrees of freedom.  It starts from rest in the home
pose, where all body frames coincide with the world frame.  There is no gravity.  Two moments act, on body 2 about x and
on body 3 about y; smooth steps switch them on and off.  The camera looks along z of body 1.

The centre of mass of the camera body is uncertain.  The response is nearly even in its offset.  An expansion of order
one therefore finds the mean and misses nearly all of the spread; order two finds most of it.  The standard deviation
of the offset, 10 mm, is deliberately large compared with its mean.

Many values are reconstructed, because the available copy of the source, a dissertation on polynomial chaos, is damaged:

- Exponents of the inertias are missing.  They follow from the limits for thin plates and rings (J_xx = J_yy + J_zz and
  similar relations).  So does the exponent of the only product of inertia, J_xz = 2.493e-6 kg m^2 of body 4.
- ``L3`` is printed as 0.506 m; 0.0506 m fits the inertias.
- The mass of body 2 is printed as zero.  Its centre of mass lies on its fixed axis, so the mass has no effect.
- A hinge as fifth joint would make three equations redundant.  The printed joint, defined by points, is no constraint
  where the origins coincide.  This model keeps two axes parallel instead.
- The positions of the bearings on their axes (``L1`` to ``L3``), which do not affect the motion, and the absence of
  gravity are assumptions.
"""

from typing import Any

import chaospy
import numpy as np

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Parallel1, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import Torque

L1 = L2 = 0.06508  # m
L3 = 0.0506  # m
SWITCH = 0.01  # half the duration of a step, s

x_cm = uqmbd.RandomVariable("x_cm", chaospy.Normal(0.0, 0.01), units="m")
y_cm = uqmbd.RandomVariable("y_cm", chaospy.Normal(-4.87e-4, 0.01), units="m")


def pulse(on: float, off: float) -> Any:
    """Return a pulse that is one between two times and zero elsewhere, with smooth steps."""
    return uqmbd.step(uqmbd.t, on - SWITCH, 0, on + SWITCH, 1) - uqmbd.step(uqmbd.t, off - SWITCH, 0, off + SWITCH, 1)


mechanism = uqmbd.Mechanism("agile_eye", uqmbd.Spatial(gravity=(0, 0, 0)))
ground = mechanism.ground
body1 = mechanism.body("body1", mass=0.0349, com=(x_cm, y_cm, -0.0121), inertia=(1.3413e-5, 1.3830e-5, 4.5815e-6))
body2 = mechanism.body("body2", mass=0.0195, com=(0.0195, 0, 0), inertia=(3.4040e-5, 2.0830e-5, 5.4400e-5))
body3 = mechanism.body("body3", mass=0.0154, com=(0, 0, -0.0375), inertia=(1.7550e-5, 6.2820e-6, 1.1640e-5))
body4 = mechanism.body(
    "body4", mass=0.0094, com=(-0.0169, 0, -0.0267), inertia=(1.1930e-5, 1.5360e-5, 3.6500e-6, 0, 2.493e-6, 0)
)

x, y, z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
mechanism.add(Revolute("ground-2", ground, body2, point_i=(L1, 0, 0), point_j=(L1, 0, 0), axis_i=x, axis_j=x))
mechanism.add(Revolute("ground-3", ground, body3, point_i=(0, L2, 0), point_j=(0, L2, 0), axis_i=y, axis_j=y))
mechanism.add(Revolute("2-1", body2, body1, point_i=(0, L3, 0), point_j=(0, L3, 0), axis_i=y, axis_j=y))
mechanism.add(Revolute("1-4", body1, body4, point_i=(L3, 0, 0), point_j=(L3, 0, 0), axis_i=x, axis_j=x))
mechanism.add(Parallel1("4-3", body4, body3, axis_i=z, axis_j=z))
mechanism.add(Torque("moment_2", body2, torque=(0.001 * pulse(0.10, 0.20), 0, 0)))
mechanism.add(Torque("moment_3", body3, torque=(0, 0.0015 * pulse(0.15, 0.25), 0)))

mechanism.output("camera_x", body1.rotation[0, 2], units="1")
mechanism.output("camera_y", body1.rotation[1, 2], units="1")
mechanism.output("camera_z", body1.rotation[2, 2], units="1")

study = uqmbd.Study(
    "agile_eye",
    mechanism,
    times=np.linspace(0, 0.5, 101),
    propagators=[
        MonteCarlo(samples=500, seed=1),
        Collocation(order=4),
        Galerkin(order=1, label="galerkin-1"),
        Galerkin(order=2, label="galerkin-2"),
        Galerkin(order=4, label="galerkin-4"),
    ],
    report_times=[0.4],
)
