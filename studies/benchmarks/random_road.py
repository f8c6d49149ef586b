"""Measure the truncation error of a random road by number of terms: a quarter car against linear random vibration.

The height of the road is a Gaussian process of the distance with the covariance ``s^2 exp(-|x - y| / c)``, s = 10 mm,
c = 5 m.  The car drives over 40 m of its Karhunen-Loeve expansion at 20 m/s.  The coefficients are independent and
standard normal.  The tyre follows the mean height over the 0.2 m of its contact patch.  Without the contact patch the
tyre force has no limit: the damper of the tyre responds to the slope of the road, whose variance is infinite.

The standard deviations are root mean squares from 1 s to 2 s.  Collocation of order 1 computes them on roads of 12 to
192 Karhunen-Loeve terms.  They are relative to those of the stationary motion: the integral of the squared transfer
function times the spectral density of the road.  The tables are with the mean over the contact patch of the tyre, and
without it.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/random_road.py [--terms 12 24 ...]``.
"""

from __future__ import annotations

import argparse
import os
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import chaospy
import numpy as np
import scipy.optimize
import sympy
from numpy.typing import NDArray

import uqmbd
from uqmbd.typing import Array
from uqmbd_collocation import Collocation
from uqmbd_springs import RadialTyre, SpringDamper

OUTPUTS = ("body_height", "body_acceleration", "suspension_travel", "tyre_force")

SPEED, DURATION, DEVIATION, CORRELATION, PATCH = 20.0, 2.0, 0.01, 5.0, 0.2
HALF = SPEED * DURATION / 2


def karhunen_loeve(terms: int) -> list[tuple[float, float]]:
    """Return frequencies (1/m) and eigenvalues of the covariance over (-HALF, HALF); cosines and sines alternate.

    R. G. Ghanem and P. D. Spanos, Stochastic Finite Elements, Springer 1991, section 2.3.3.
    """
    c = 1 / CORRELATION

    def even(w: float) -> float:
        return float(c - w * np.tan(w * HALF))

    def odd(w: float) -> float:
        return float(w + c * np.tan(w * HALF))

    found = []
    for k in range(terms):
        low, high = k * np.pi / (2 * HALF) + 1e-12, (k + 1) * np.pi / (2 * HALF) - 1e-12
        frequency: Any = scipy.optimize.brentq(even if k % 2 == 0 else odd, low, high)
        found.append((frequency, DEVIATION**2 * 2 * c / (frequency**2 + c**2)))
    return found


def random_road(terms: int, patch: float = PATCH) -> sympy.Expr:
    """Return the height of the road under the wheel over time (m): its mean over a contact patch (length in m)."""
    place = SPEED * uqmbd.t - HALF
    height: sympy.Expr = sympy.Integer(0)
    for k, (frequency, value) in enumerate(karhunen_loeve(terms)):
        sign, wave = (1, sympy.cos) if k % 2 == 0 else (-1, sympy.sin)
        size = np.sqrt(HALF + sign * np.sin(2 * frequency * HALF) / (2 * frequency))
        coefficient = uqmbd.RandomVariable(f"road_{k + 1}", chaospy.Normal(0, 1), units="1")
        mean = np.sinc(frequency * patch / 2 / np.pi)  # of the harmonic over the patch
        height += coefficient * float(mean * np.sqrt(value) / size) * wave(frequency * place)
    return height


def quarter_car(road: sympy.Expr) -> uqmbd.Mechanism:
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


def transfer(angular_frequency: Array) -> NDArray[np.complex128]:
    """Return transfer functions (N, 4) from the height of the road to the outputs, at frequencies (N,), rad/s."""
    ms, mu, ks, cs, kt, ct = 300.0, 40.0, 20_000.0, 1_200.0, 180_000.0, 100.0
    s = 1j * angular_frequency
    suspension, tyre = ks + cs * s, kt + ct * s
    # (ms s^2 + suspension) zs = suspension zu;  (mu s^2 + suspension + tyre) zu = suspension zs + tyre h
    ratio = suspension / (ms * s**2 + suspension)
    wheel = tyre / (mu * s**2 + suspension + tyre - suspension * ratio)
    body = ratio * wheel
    return np.stack([body, s**2 * body, body - wheel, tyre * (1 - wheel)], axis=1)


def exact(patch: float, top: float = 1e5) -> Array:
    """Return standard deviations (4,) of the outputs of the stationary motion, up to an angular frequency in rad/s."""
    rate = SPEED / CORRELATION
    edges = np.concatenate([np.linspace(0, 400, 801), np.arange(410, top + 1, 10)])
    x, w = np.polynomial.legendre.leggauss(6)
    omega = ((edges[1:, None] + edges[:-1, None]) / 2 + np.diff(edges)[:, None] / 2 * x).ravel()
    weight = (np.diff(edges)[:, None] / 2 * w).ravel()
    density = DEVIATION**2 * 2 * rate / (omega**2 + rate**2) / np.pi
    density *= np.sinc(omega / SPEED * patch / 2 / np.pi) ** 2
    return np.asarray(np.sqrt((weight * density) @ np.abs(transfer(omega)) ** 2))


def computed(terms: int, patch: float) -> Array:
    """Return standard deviations (4,) of the outputs, root mean square over the second half, by a chaos of order 1."""
    mechanism = quarter_car(random_road(terms, patch))
    method = Collocation(order=1, method="regression", verify=0)
    times = np.linspace(0, DURATION, 41)
    study = uqmbd.Study("road", mechanism, times, [method], start="equilibrium")
    std = study.propagate(method)["statistics"]["std"]
    half = std.sel(output=list(OUTPUTS)).transpose("output", "time").values[:, len(times) // 2 :]
    return np.asarray(np.sqrt(np.mean(half**2, axis=1)))


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--terms", type=int, nargs="+", default=[12, 24, 48, 96, 192])
    terms = parser.parse_args().terms
    for patch in (PATCH, 0.0):
        limit = exact(patch)
        print(f"\nContact patch of {patch:g} m\n\n| terms | {' | '.join(OUTPUTS)} |\n|{'---|' * 5}")
        for count in terms:
            found = computed(count, patch)
            shares = [f"{f:.4g} ({100 * f / e:.1f} %)" for f, e in zip(found, limit, strict=True)]
            print(f"| {count} | {' | '.join(shares)} |", flush=True)
        print(f"| all, to 1e5 rad/s | {' | '.join(f'{e:.4g}' for e in limit)} |", flush=True)


if __name__ == "__main__":
    main()
