"""The undamped oscillator of Gayton, and of Echard, Gayton and Lemaire: how probably it goes too far.

A mass m hangs between two springs, c1 and c2, at rest; a force F1 pushes from t = 0 to t1, then none.  It must not go
farther than 3 r, at any time.  Six normal inputs: m (1, 0.05), c1 (1, 0.1), c2 (0.1, 0.01), r (0.5, 0.05), t1 (1, 0.2)
and F1 (1, 0.2), mean and standard deviation.  With w^2 = (c1 + c2) / m it swings as far as
2 F1 / (m w^2) |sin(w t1 / 2)|.

| source | probability | realisations |
|---|---|---|
| Echard, Gayton, Lemaire, Structural Safety 33 (2011) 145: Monte Carlo | 2.834e-2 +- 2.2 % | 70,000 |
| there: Kriging and Monte Carlo | 2.851e-2 | 45 |
| FORM, Phi(-beta) | 3.2e-2 | 60 |
| here, with the motion integrated | 2.84e-2, standard error 0.14e-2, 95 % interval 2.52e-2 to 3.20e-2 | 1,427 |
| closed form, importance sampling of 0.5 % | 2.883e-2 | 23,000 |

With a smaller force, F1 (0.6, 0.1), it is 9.07e-6 by the closed form, and 8.6e-6, 8.2e-6, 9.1e-6 here, with three
seeds and 1,500 to 1,900 realisations each.

Run with ``uqmbd run studies/published/undamped_oscillator.py``.
"""

import chaospy
import numpy as np
import sympy

import uqmbd
from uqmbd_reliability import Reliability
from uqmbd_springs import PointForce, SpringDamper

TIMES = np.linspace(0, 8, 81)


def oscillator(mean_force=1.0, deviation=0.2):
    """Return the mechanism, with its requirement."""

    def normal(name, mean, std, units):
        return uqmbd.RandomVariable(name, chaospy.Normal(mean, std), units=units)

    mechanism = uqmbd.Mechanism("undamped oscillator", uqmbd.Translational())
    mass = mechanism.body("mass", mass=normal("m", 1, 0.05, "kg"), position=(0, 0))
    stiffness = normal("c1", 1, 0.1, "N/m") + normal("c2", 0.1, 0.01, "N/m")
    mechanism.add(SpringDamper("springs", mechanism.ground, mass, (0, 0), (0, 0), stiffness=stiffness))
    push = sympy.Piecewise((normal("F1", mean_force, deviation, "N"), uqmbd.t < normal("t1", 1, 0.2, "s")), (0, True))
    mechanism.add(PointForce("push", mass, (0, 0), (push, 0)))
    limit = 3 * normal("r", 0.5, 0.05, "m")
    mechanism.require("travel", sympy.Abs(mass.position[0]) <= limit, description="it goes no farther than 3 r")
    return mechanism


def margin(values):
    """Return the margin in closed form, shape (K,), at values of F1, c1, c2, m, r, t1, shape (K, 6)."""
    force, first, second, mass, yielding, end = np.asarray(values).T
    frequency = np.sqrt((first + second) / mass)
    return 3 * yielding - np.abs(2 * force / (first + second) * np.sin(frequency * end / 2))


study = uqmbd.Study("undamped oscillator", oscillator(), TIMES, [Reliability(seed=1)])
