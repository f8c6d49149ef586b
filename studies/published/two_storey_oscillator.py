"""A frame of two storeys after Yuen: its stiffnesses calibrated from measured frequencies and mode shapes.

Two masses of 1 stand on each other; the stiffness matrix is [[k1 + k2, -k2], [-k2, k2]].  The prior of k1 is uniform
between 0.8 and 2.2, that of k2 between 0.4 and 1.2.  Two quantities are measured five times.  The first eigenvalue
(squared angular frequency) has a standard deviation of 0.0191; the ratio of the storeys in the first mode has one of
0.0809.  The case is also an example of quoFEM (Yuen, Bayesian Methods for Structural Dynamics and Civil Engineering,
Wiley 2010).

| | k1 | k2 | correlation |
|---|---|---|---|
| on a grid | 1.0086 +- .0264 | .9907 +- .0416 | .008 |
| here, 107 realisations | 1.0084 +- .0264 | .9903 +- .0415 | .012 |

Run with ``uqmbd run studies/published/two_storey_oscillator.py``.  It predicts the second frequency, which is not
measured, from the prior and from the posterior.
"""

import chaospy
import numpy as np
import sympy

import uqmbd
from uqmbd_calibration import Calibrated, Record, Series, calibrate
from uqmbd_collocation import Collocation
from uqmbd_springs import SpringDamper

EIGENVALUES = (0.3860, 0.3922, 0.4157, 0.3592, 0.3615)
RATIOS = (1.68245252, 1.71103903, 1.57876073, 1.58722342, 1.61878479)


def frame() -> uqmbd.Mechanism:
    """Return the frame."""
    k1 = uqmbd.RandomVariable("k1", chaospy.Uniform(0.8, 2.2), units="N/m")
    k2 = uqmbd.RandomVariable("k2", chaospy.Uniform(0.4, 1.2), units="N/m")
    mechanism = uqmbd.Mechanism("two storeys", uqmbd.Line())
    lower, upper = mechanism.body("lower", mass=1, position=1), mechanism.body("upper", mass=1, position=2)
    mechanism.add(SpringDamper("first", mechanism.ground, lower, 0, 0, stiffness=k1, free_length=1))
    mechanism.add(SpringDamper("second", lower, upper, 0, 0, stiffness=k2, free_length=1))
    mechanism.output("eigenvalue", (2 * sympy.pi * uqmbd.eigenfrequency(1)) ** 2, units="1/s^2")
    mechanism.output("ratio", uqmbd.mode_shape(1, upper.position[0], over=lower.position[0]), units="1")
    mechanism.output("second frequency", uqmbd.eigenfrequency(2), units="Hz")
    return mechanism


record = Record(
    "vibration test",
    (
        Series("eigenvalue", np.array([]), np.array(EIGENVALUES), "1/s^2", 0.0191),
        Series("ratio", np.array([]), np.array(RATIOS), "1", 0.0809),
    ),
)
study = uqmbd.Study("two-storey oscillator", frame())
found = calibrate(study, record, draws=20000, seed=4)
study = study.with_propagators(
    [Collocation(order=4, label="before"), Calibrated(Collocation(order=4), found, label="after")]
)
