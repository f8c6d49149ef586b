"""A record of a double pendulum calibrates its mass and damping, and predicts how it swings after another release.

Two rods hang below each other.  Uncertain are the mass of the lower rod (0.5 kg, 10 %) and the dampers in both pivots
(12 and 6 mN m s, 30 %).  The record contains both angles for 10 s after a release at 0.9 and 0.5 rad, with errors of
0.01 rad.  Another engine made it, with 0.55 kg, 15 and 5 mN m s (`records/README.md`).  The calibration finds 0.5493 +-
0.0005 kg, 14.8 +- 0.1 and 5.03 +- 0.05 mN m s, with 115 realisations.

The study then releases the pendulum at 1.4 and -0.6 rad.  It predicts the motion twice: from the prior, and from the
posterior that the record gives.

Run with ``uqmbd run studies/calibration.py``.  ``python studies/calibration.py`` also calibrates with the record of a
pendulum with dry friction in its upper pivot.  The model has no dry friction; the calibration warns that the model is
wrong, and lists where.
"""

from pathlib import Path

import chaospy
import numpy as np

import uqmbd
from uqmbd_calibration import Calibrated, Record, calibrate
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import TorsionSpringDamper

RECORDS = Path(__file__).parent / "records"
TIMES = np.arange(201) / 20
LENGTHS = (0.4, 0.3)
NOISE = {"upper angle": 0.01, "joint angle": 0.01}


def double_pendulum(upper_angle, lower_angle):
    """Return the pendulum, released from rest at two angles against the vertical, rad."""
    mass = uqmbd.RandomVariable("lower_mass", chaospy.Normal(0.5, 0.05), units="kg")
    upper_damping, lower_damping = (
        uqmbd.RandomVariable(name, chaospy.LogNormal(mu=float(np.log(median)), sigma=0.3), units="N m s")
        for name, median in (("upper_damping", 0.012), ("lower_damping", 0.006))
    )
    mechanism = uqmbd.Mechanism("double_pendulum", uqmbd.Planar(gravity=(0.0, -9.81)))
    along = [np.array([np.sin(a), -np.cos(a)]) for a in (upper_angle, lower_angle)]
    first, second = LENGTHS[0] / 2 * along[0], LENGTHS[0] * along[0] + LENGTHS[1] / 2 * along[1]
    upper = mechanism.body("upper", 0.8, inertia=0.0107, position=tuple(first), angle=upper_angle)
    lower = mechanism.body("lower", mass, inertia=0.0042, position=tuple(second), angle=lower_angle)
    shoulder = mechanism.add(Revolute("shoulder", mechanism.ground, upper, (0, 0), (0, LENGTHS[0] / 2)))
    elbow = mechanism.add(Revolute("elbow", upper, lower, (0, -LENGTHS[0] / 2), (0, LENGTHS[1] / 2)))
    mechanism.add(TorsionSpringDamper("upper damper", mechanism.ground, upper, stiffness=0, damping=upper_damping))
    mechanism.add(TorsionSpringDamper("lower damper", upper, lower, stiffness=0, damping=lower_damping))
    mechanism.output("upper angle", shoulder.angle, units="rad")
    mechanism.output("joint angle", elbow.angle, units="rad")
    return mechanism


def calibrated(name):
    """Calibrate the recorded pendulum with the record of this name."""
    record = Record.read(RECORDS / f"{name}.csv", noise=NOISE)
    recorded = uqmbd.Study("recorded", double_pendulum(0.9, 0.5), TIMES)
    return calibrate(recorded, record, seed=1)


study = uqmbd.Study(
    "calibration",
    double_pendulum(1.4, -0.6),
    TIMES,
    [
        MonteCarlo(samples=300, seed=1, label="before"),
        Calibrated(MonteCarlo(samples=300, seed=1), calibrated("double_pendulum"), label="after"),
    ],
)

if __name__ == "__main__":
    print(calibrated("double_pendulum_with_friction"))
