"""Measure the truncation error of a random road by number of terms: the quarter car against linear random vibration.

The standard deviations are root mean squares from 1 s to 2 s.  Collocation of order 1 computes them on roads of 12 to
192 Karhunen-Loeve terms.  They are relative to those of the stationary motion: the integral of the squared transfer
function times the spectral density of the road.  The tables are with the mean over the contact patch of the tyre, and
without it.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/random_road.py [--terms 12 24 ...]``.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import numpy as np
import quarter_car
from numpy.typing import NDArray

import uqmbd
from uqmbd.typing import Array
from uqmbd_collocation import Collocation

OUTPUTS = ("body_height", "body_acceleration", "suspension_travel", "tyre_force")


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
    rate = quarter_car.SPEED / quarter_car.CORRELATION
    edges = np.concatenate([np.linspace(0, 400, 801), np.arange(410, top + 1, 10)])
    x, w = np.polynomial.legendre.leggauss(6)
    omega = ((edges[1:, None] + edges[:-1, None]) / 2 + np.diff(edges)[:, None] / 2 * x).ravel()
    weight = (np.diff(edges)[:, None] / 2 * w).ravel()
    density = quarter_car.DEVIATION**2 * 2 * rate / (omega**2 + rate**2) / np.pi
    density *= np.sinc(omega / quarter_car.SPEED * patch / 2 / np.pi) ** 2
    return np.asarray(np.sqrt((weight * density) @ np.abs(transfer(omega)) ** 2))


def computed(terms: int, patch: float) -> Array:
    """Return standard deviations (4,) of the outputs, root mean square over the second half, by a chaos of order 1."""
    mechanism = quarter_car.quarter_car(quarter_car.random_road(terms, patch))
    method = Collocation(order=1, method="regression", verify=0)
    times = np.linspace(0, quarter_car.DURATION, 41)
    study = uqmbd.Study("road", mechanism, times, [method], start="equilibrium")
    std = study.propagate(method)["statistics"]["std"]
    half = std.sel(output=list(OUTPUTS)).transpose("output", "time").values[:, len(times) // 2 :]
    return np.asarray(np.sqrt(np.mean(half**2, axis=1)))


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--terms", type=int, nargs="+", default=[12, 24, 48, 96, 192])
    terms = parser.parse_args().terms
    for patch in (quarter_car.PATCH, 0.0):
        limit = exact(patch)
        print(f"\nContact patch of {patch:g} m\n\n| terms | {' | '.join(OUTPUTS)} |\n|{'---|' * 5}")
        for count in terms:
            found = computed(count, patch)
            shares = [f"{f:.4g} ({100 * f / e:.1f} %)" for f, e in zip(found, limit, strict=True)]
            print(f"| {count} | {' | '.join(shares)} |", flush=True)
        print(f"| all, to 1e5 rad/s | {' | '.join(f'{e:.4g}' for e in limit)} |", flush=True)


if __name__ == "__main__":
    main()
