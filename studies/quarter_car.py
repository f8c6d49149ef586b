"""A quarter car on a random road, a Karhunen-Loeve expansion of twelve terms: a chaos of twelve random inputs.

The height of the road is a Gaussian process of the distance with the covariance ``s^2 exp(-|x - y| / c)``, s = 10 mm,
c = 5 m.  Its Karhunen-Loeve expansion over the 40 m that the car drives at 20 m/s is truncated after twelve terms.  The
coefficients are independent and standard normal.  `LEFT_OUT` states the truncated share of the variance.  The tyre
follows the mean height over the 0.2 m of its contact patch, and lifts off instead of pulling.

Twelve terms end at 18 rad/s, below the wheel hop at 70 rad/s.  From 1 s to 2 s they reach 99 % of the exact standard
deviation of the body height and 88 % of that of the suspension travel.  They reach 58 % for the body acceleration and
31 % for the tyre force.  With 48 terms the travel reaches 99 %, with 96 the acceleration, with 192 the tyre force; use
order 1 for so many inputs.  Without the contact patch the tyre force has no limit: the damper of the tyre responds to
the slope of the road, whose variance is infinite.  `studies/benchmarks/random_road.py` prints the table.

Sprung mass 300 kg, unsprung 40 kg, suspension 20 kN/m and 1.2 kN s/m, tyre 180 kN/m and 100 N s/m.
"""

from typing import Any

import chaospy
import numpy as np
import scipy.optimize
import sympy

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import RadialTyre, SpringDamper

SPEED, DURATION, DEVIATION, CORRELATION, TERMS, PATCH = 20.0, 2.0, 0.01, 5.0, 12, 0.2
HALF = SPEED * DURATION / 2


def karhunen_loeve(terms):
    """Return frequencies (1/m) and eigenvalues of the covariance over (-HALF, HALF); cosines and sines alternate.

    R. G. Ghanem and P. D. Spanos, Stochastic Finite Elements, Springer 1991, section 2.3.3.
    """
    c = 1 / CORRELATION

    def even(w):
        return c - w * np.tan(w * HALF)

    def odd(w):
        return w + c * np.tan(w * HALF)

    found = []
    for k in range(terms):
        low, high = k * np.pi / (2 * HALF) + 1e-12, (k + 1) * np.pi / (2 * HALF) - 1e-12
        frequency: Any = scipy.optimize.brentq(even if k % 2 == 0 else odd, low, high)
        found.append((frequency, DEVIATION**2 * 2 * c / (frequency**2 + c**2)))
    return found


def random_road(terms, patch=PATCH):
    """Return the height of the road under the wheel over time (m): its mean over a contact patch (length in m)."""
    place = SPEED * uqmbd.t - HALF
    height = sympy.Integer(0)
    for k, (frequency, value) in enumerate(karhunen_loeve(terms)):
        sign, wave = (1, sympy.cos) if k % 2 == 0 else (-1, sympy.sin)
        size = np.sqrt(HALF + sign * np.sin(2 * frequency * HALF) / (2 * frequency))
        coefficient = uqmbd.RandomVariable(f"road_{k + 1}", chaospy.Normal(0, 1), units="1")
        mean = np.sinc(frequency * patch / 2 / np.pi)  # of the harmonic over the patch
        height += coefficient * float(mean * np.sqrt(value) / size) * wave(frequency * place)
    return height


def quarter_car(road):
    """Return the sprung and unsprung mass on a road whose height (m) is given."""
    mechanism = uqmbd.Mechanism("quarter_car", uqmbd.Line(gravity=-9.81))
    wheel = mechanism.body("wheel", mass=40, position=0.3)
    body = mechanism.body("body", mass=300, position=0.8)
    mechanism.add(SpringDamper("suspension", wheel, body, 0, 0, stiffness=20_000, damping=1_200, free_length=0.65))
    tyre = mechanism.add(
        RadialTyre("tyre", mechanism.ground, wheel, 0, road=road, radius=0.32, stiffness=180_000, damping=100)
    )
    mechanism.output("body_height", body.position, units="m")
    mechanism.output("body_acceleration", body.acceleration, units="m/s^2")
    mechanism.output("suspension_travel", body.position - wheel.position, units="m")
    mechanism.output("tyre_force", tyre.reaction_force, units="N")
    return mechanism


modes = karhunen_loeve(TERMS)
LEFT_OUT = 1 - sum(value for _, value in modes) / (DEVIATION**2 * 2 * HALF)

road = random_road(TERMS)
mechanism = quarter_car(road)

study = uqmbd.Study(
    "quarter_car",
    mechanism,
    times=np.linspace(0, DURATION, 201),
    propagators=[
        MonteCarlo(samples=500, seed=1),
        Collocation(order=2, method="regression"),
        Galerkin(order=1, rule="sobol", samples=64),
    ],
    start="equilibrium",
)
