"""Estimate rare events of known probability: bias, scatter, cost, and coverage of the 95 % intervals.

The limit states are functions of standard normal variables.  Their probabilities are closed forms or integrals over one
variable.  They include planes in 2 and in 40 dimensions, a kink, several design points, and corners.  For curved limit
states FORM is wrong by two orders of magnitude; spheres have no design point.  Two limit states are designed to mislead
methods: the "black swan" of K. Breitung, where the slope near the origin leads away, and an island behind it.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/limit_states.py [--seeds N] [--only NAME ...] [--method NAME]``.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import quad
from scipy.stats import chi2, ncx2, norm

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE)]

from uqmbd_reliability.analysis import analyse
from uqmbd_reliability.subset import subset_probability


@dataclass(frozen=True)
class LimitState:
    """A margin of standard normal variables (K, d), and the probability that it is negative."""

    margin: Callable[[np.ndarray], np.ndarray]
    dimension: int
    probability: float

    def __call__(self, points):
        """Return margins (K, 1), and a mask (K,) without failed realisations."""
        return self.margin(points)[:, None], np.zeros(len(points), dtype=bool)


def plane(beta, dimension):
    """Return a plane of probability Phi(-beta)."""
    return LimitState(lambda u: beta - u.sum(axis=1) / np.sqrt(dimension), dimension, float(norm.sf(beta)))


def slab(beta, dimension):
    """Return a limit state with two opposite design points."""
    return LimitState(lambda u: beta - np.abs(u[:, 0]), dimension, 2 * float(norm.sf(beta)))


def branches(depth=3.0, side=3.5):
    """Return a limit state of four branches, two of them curved."""

    def margin(u):
        along, across = (u[:, 0] + u[:, 1]) / np.sqrt(2), (u[:, 0] - u[:, 1]) / np.sqrt(2)
        return np.minimum(depth + 0.2 * across**2 - np.abs(along), np.sqrt(2) * (side - np.abs(across)))

    inner = quad(lambda b: norm.pdf(b) * 2 * norm.sf(depth + 0.2 * b**2), -side, side, epsabs=0)[0]
    return LimitState(margin, 2, 2 * float(norm.sf(side)) + inner)


def paraboloid(beta, curvature, dimension):
    """Return a paraboloid that curves away from the origin, or around it for a negative curvature."""

    def density(s):
        return chi2.pdf(s, dimension - 1) * norm.sf(beta + curvature * s)

    probability = quad(density, 0, 20 + 4 * dimension, epsabs=0, limit=500)[0]
    return LimitState(lambda u: beta + curvature * (u[:, 1:] ** 2).sum(axis=1) - u[:, 0], dimension, probability)


def sphere(radius, dimension):
    """Return a limit state violated outside a sphere: all directions are equally likely."""
    outside = float(chi2.sf(radius**2, dimension))
    return LimitState(lambda u: radius - np.linalg.norm(u, axis=1), dimension, outside)


def kink(first, second):
    """Return a limit state violated beyond either of two perpendicular planes: the worse of two peaks."""
    return LimitState(
        lambda u: np.minimum(first - u[:, 0], second - u[:, 1]), 2, 1 - float(norm.cdf(first) * norm.cdf(second))
    )


def corner(first, second):
    """Return a limit state violated beyond both of two perpendicular planes."""
    both = float(norm.sf(first) * norm.sf(second))
    return LimitState(lambda u: np.maximum(first - u[:, 0], second - u[:, 1]), 2, both)


def black_swan():
    """Return a margin that falls fast towards rare violations, and slowly towards more frequent ones."""

    def margin(u):
        rare = np.where(u[:, 1] > 2, 0.5 - 0.1 * u[:, 1], 2.3 - u[:, 1])
        frequent = np.where(u[:, 0] > 3.5, 4 - u[:, 0], 0.85 - 0.1 * u[:, 0])
        return np.minimum(rare, frequent)

    return LimitState(margin, 2, 1 - float(norm.cdf(4) * norm.cdf(5)))


def island(beta=4.2, distance=3.5, radius=0.7):
    """Return a limit state violated beyond a plane, and in a disc elsewhere, which is more probable."""

    def margin(u):
        return np.minimum(beta - u[:, 0], np.hypot(u[:, 0], u[:, 1] + distance) - radius)

    return LimitState(margin, 2, float(norm.sf(beta) + ncx2.cdf(radius**2, 2, distance**2)))


CASES = {
    "plane": plane(3.0, 2),
    "plane, 1e-8": plane(5.612, 2),
    "plane, 40 inputs": plane(3.0, 40),
    "plane, 40 inputs, 1e-8": plane(5.612, 40),
    "frequent": plane(1.0, 3),
    "kink": kink(3.0, 3.2),
    "two design points": slab(3.5, 2),
    "two design points, 40 inputs": slab(4.0, 40),
    "four branches": branches(),
    "curved": paraboloid(3.0, 0.3, 2),
    "curved round the origin, 40 inputs": paraboloid(3.0, -0.02, 40),
    "curved, 10 inputs, 1e-9": paraboloid(5.0, 0.2, 10),
    "corner": corner(3.0, 2.5),
    "black swan": black_swan(),
    "island": island(),
    "circle": sphere(5.0, 2),
    "sphere, 10 inputs": sphere(5.5, 10),
    "sphere, 40 inputs": sphere(9.5, 40),
}


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--only", nargs="*", default=list(CASES))
    parser.add_argument("--method", default="auto", choices=["auto", "form", "subset"])
    options = parser.parse_args()
    print("| limit state | probability | bias | rms error | stated | interval contains it | realisations | largest |")
    print("|---|---|---|---|---|---|---|---|")
    for name in options.only:
        case = CASES[name]
        rows = []
        for seed in range(options.seeds):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                if options.method == "subset":
                    found = subset_probability(case, case.dimension, most=10_000, seed=seed)
                else:
                    generator = np.random.default_rng(seed)
                    found = analyse(case, case.dimension, method=options.method, generator=generator)
            one = found.estimates[0]
            error = one.probability / case.probability - 1
            rows.append((error, one.cov, one.lower <= case.probability <= one.upper, found.ledger.count))
        error, cov, holds, count = np.array(rows).T
        print(
            f"| {name} | {case.probability:.3g} | {error.mean():+.1%} | {np.sqrt((error**2).mean()):.1%} | "
            f"{np.median(cov):.1%} | {holds.mean():.1%} | {np.median(count):.0f} | {count.max():.0f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
