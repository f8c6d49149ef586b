"""The undamped oscillator of Gayton, Echard and Lemaire: the small probability that its displacement exceeds a limit.

A mass m rests between two springs, c1 and c2.  A force F1 pushes it from t = 0 to t1, and then stops.  The displacement
must not exceed 3 r at any time.  Six inputs are normal: m (1, 0.05), c1 (1, 0.1), c2 (0.1, 0.01), r (0.5, 0.05), t1 (1,
0.2) and F1 (1, 0.2), mean and standard deviation.  With w^2 = (c1 + c2) / m the amplitude is
2 F1 / (m w^2) |sin(w t1 / 2)|.

| source | probability | realisations |
|---|---|---|
| Echard, Gayton, Lemaire, Structural Safety 33 (2011) 145: Monte Carlo | 2.834e-2 +- 2.2 % | 70,000 |
| there: Kriging and Monte Carlo | 2.851e-2 | 45 |
| FORM, Phi(-beta) | 3.2e-2 | 60 |
| closed form, by quadrature | 2.8596e-2 | |
| here, with the motion integrated | 2.92e-2, standard error 0.14e-2, 95 % interval 2.63e-2 to 3.24e-2 | 1,428 |

Smaller forces make the event rarer.  Quadrature evaluates the closed form: for a given stiffness, mass and t1 the
margin is linear in r and F1, so its probability is Phi.  A Gauss-Legendre rule of 96^3 nodes within 8.5 deviations
integrates it over these three.  The result of 48^3 nodes differs in the seventh digit.  Importance sampling of the six
inputs agrees within 0.2 %, 1.5 of its standard errors.

The second table applies the algorithm of `Reliability` to the closed form with 200 seeds.  It lists the error (root
mean square and largest), the share of intervals that contain the probability, and the realisations (median and
largest).  The mechanism integrates the motion; its margins differ from the closed form by at most 4e-6 m.

| F1 | probability | error | largest | contained | realisations | mechanism, seeds 1 to 4; errors |
|---|---|---|---|---|---|---|
| 0.45, 0.075 | 1.5144e-08 | 4.8% | 15% | 96.0% | 2381, 3000 | 1.437, 1.498, 1.501, 1.481 e-08; -5%, -1%, -1%, -2% |
| 0.5, 0.0833 | 1.8083e-07 | 5.2% | 14% | 93.0% | 2132, 3000 | 1.810, 1.754, 1.915, 1.956 e-07; +0%, -3%, +6%, +8% |
| 0.55, 0.0917 | 1.5001e-06 | 5.1% | 15% | 93.5% | 1916, 3000 | 1.483, 1.508, 1.504, 1.390 e-06; -1%, +1%, +0%, -7% |
| 0.6, 0.1 | 9.1310e-06 | 4.6% | 14% | 96.5% | 1824, 3000 | 8.919, 8.765, 8.647, 8.145 e-06; -2%, -4%, -5%, -11% |
| 0.8, 0.16 | 2.4173e-03 | 4.9% | 13% | 95.5% | 1364, 2659 | 2.329, 2.589, 2.487, 2.272 e-03; -4%, +7%, +3%, -6% |
| 1, 0.2 | 2.8596e-02 | 4.9% | 16% | 95.0% | 1128, 1941 | 2.918, 2.750, 2.848, 2.780 e-02; +2%, -4%, -0%, -3% |

Run with ``uqmbd run studies/published/undamped_oscillator.py``.  ``python studies/published/undamped_oscillator.py
[SEEDS] [SEEDS OF THE MECHANISM]`` computes the second table.
"""

import sys
import warnings

import chaospy
import numpy as np
import sympy
from scipy.special import ndtr
from scipy.stats import norm

import uqmbd
from uqmbd_reliability import Reliability
from uqmbd_springs import PointForce, SpringDamper

TIMES = np.linspace(0, 8, 81)


def oscillator(mean_force=1.0, deviation=0.2):
    """Return the mechanism with its requirement."""

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


def probability(mean_force=1.0, deviation=0.2, points=96, reach=8.5):
    """Return the probability of the closed form by quadrature over stiffness, mass and t1."""
    nodes, weights = np.polynomial.legendre.leggauss(points)
    z = reach * nodes
    weights = reach * weights * norm.pdf(z)
    stiffness, mass, end = np.meshgrid(1.1 + np.hypot(0.1, 0.01) * z, 1 + 0.05 * z, 1 + 0.2 * z, indexing="ij")
    travel = np.abs(2 / stiffness * np.sin(np.sqrt(stiffness / mass) * end / 2))  # for a unit force
    beyond = ndtr((mean_force * travel - 3 * 0.5) / np.hypot(3 * 0.05, deviation * travel))
    return float(np.einsum("i,j,k,ijk->", weights, weights, weights, beyond))


FORCES = ((0.45, 0.075), (0.5, 0.5 / 6), (0.55, 0.55 / 6), (0.6, 0.1), (0.8, 0.16), (1.0, 0.2))
"""Means and standard deviations of F1."""


def compared(mean_force, deviation, seeds, mechanism_seeds):
    """Return a table row: true probability, many seeds with the closed form, and a few with the mechanism."""
    from uqmbd_reliability.analysis import analyse

    truth = probability(mean_force, deviation)
    means = np.array([mean_force, 1, 0.1, 1, 0.5, 1])
    deviations = np.array([deviation, 0.1, 0.01, 0.05, 0.05, 0.2])

    def limit(u):
        return margin(means + deviations * u)[:, None], np.zeros(len(u), dtype=bool)

    rows = []
    for seed in range(seeds):
        found = analyse(limit, 6, generator=np.random.default_rng(seed))
        one = found.estimates[0]
        rows.append((one.probability / truth - 1, one.lower <= truth <= one.upper, found.ledger.count))
    error, held, count = np.array(rows).T
    cells = [
        f"{mean_force:g}, {deviation:.3g}",
        f"{truth:.4e}",
        f"{np.sqrt((error**2).mean()):.1%}",
        f"{np.abs(error).max():.0%}",
        f"{held.mean():.1%}",
        f"{np.median(count):.0f}, {count.max():.0f}",
    ]
    real = uqmbd.Study("undamped oscillator", oscillator(mean_force, deviation), TIMES)
    for seed in range(1, mechanism_seeds + 1):
        node = real.propagate(Reliability(seed=seed))
        requirements = node.children["requirements"].to_dataset()
        low, high = requirements["interval"].values[0]
        value = requirements["violation_probability"].item()
        inside = "" if low <= truth <= high else " (not contained)"
        cells.append(f"{value:.3e} {value / truth - 1:+.0%}, {node.attrs['realisations']}{inside}")
    return "| " + " | ".join(cells) + " |"


study = uqmbd.Study("undamped oscillator", oscillator(), TIMES, [Reliability(seed=1)])

if __name__ == "__main__":
    few = [int(text) for text in sys.argv[1:]]
    warnings.simplefilter("ignore")
    for force in FORCES:
        print(compared(*force, *few, *(20, 3)[len(few) :]), flush=True)
