"""Measure coverage and width of the 95 % intervals of probabilities of violation.

Four requirements have known probabilities and need no motion, so the benchmark measures only the methods:

- smooth: a product of a lognormal and a normal input stays below a limit;
- kinked: the larger of two normal inputs stays below a limit;
- two design points: a normal input stays within a band whose width depends on a second input;
- 40 inputs: the sum of lognormal inputs stays below a limit (Rackwitz 2001).

For each method the table lists the number of seeds whose interval contains the true probability, and the median width.
It also lists the width of the interval from counting violations in as many independent realisations.

Run: python studies/benchmarks/requirement_intervals.py [SEEDS]
"""

from __future__ import annotations

import sys
import time
import warnings
from typing import Any

import chaospy
import numpy as np
import sympy
from scipy.integrate import quad
from scipy.special import ndtr
from scipy.stats import binom, norm

import uqmbd
from uqmbd.results import clopper_pearson
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo

LIMIT, BETA, MANY = 2.2, 2.0, 40


def smooth(inputs):
    """Require exp(0.1 a) (5 + b) below 8.5; its probability is an integral over b."""
    a, b = inputs
    return sympy.exp(a / 10) * (5 + b) <= 8.5


def smooth_probability():
    return quad(lambda b: norm.pdf(b) * ndtr(-10 * np.log(8.5 / (5 + b))), -4.999, 12, epsabs=1e-14)[0]


def kinked(inputs):
    return sympy.Max(*inputs) <= LIMIT


def two_points(inputs):
    """Require |a| + b / 4 below a limit."""
    a, b = inputs
    return sympy.Abs(a) + b / 4 <= 2.5


def two_points_probability():
    return quad(lambda b: norm.pdf(b) * 2 * ndtr(-(2.5 - b / 4)) if b < 10 else norm.pdf(b), -9, 9, epsabs=1e-14)[0]


def many(inputs):
    """Require the sum of lognormal inputs (mean 1, deviation 0.2) below its mean plus 2 deviations."""
    s = np.sqrt(np.log(1.04))
    return sum(sympy.exp(s * x - s**2 / 2) for x in inputs) <= MANY + BETA * 0.2 * np.sqrt(MANY)


def many_probability(count=4_000_000):
    """Return the probability by samples, without a closed form; its standard error is 1e-4."""
    rng, s, found = np.random.default_rng(12345), np.sqrt(np.log(1.04)), 0
    for _ in range(count // 100_000):
        x = np.exp(s * rng.normal(size=(100_000, MANY)) - s**2 / 2).sum(axis=1)
        found += int(np.count_nonzero(x > MANY + BETA * 0.2 * np.sqrt(MANY)))
    return found / count


CASES = {
    "smooth": (2, smooth, smooth_probability),
    "kinked": (2, kinked, lambda: 1 - ndtr(LIMIT) ** 2),
    "two design points": (2, two_points, two_points_probability),
    "40 inputs": (MANY, many, many_probability),
}
METHODS = {
    "monte-carlo 500": lambda seed, inputs: MonteCarlo(samples=500, seed=seed),
    "order 3, verify 8": lambda seed, inputs: Collocation(seed=seed, **_options(inputs, 3)),
    "order 3, verify 32": lambda seed, inputs: Collocation(seed=seed, verify=32, **_options(inputs, 3)),
    "order 5, verify 32": lambda seed, inputs: Collocation(seed=seed, verify=32, **_options(inputs, 5)),
    "elements, verify 32": lambda seed, inputs: (
        Collocation(seed=seed, verify=32, order=2, elements="adaptive") if inputs < MANY else None
    ),
}


def _options(inputs: int, order: int) -> dict[str, Any]:
    """Return options; with many inputs, terms of single inputs (hyperbolic, order 2 or 3) and twice as many samples."""
    if inputs < MANY:
        return {"order": order}
    lower = (order + 1) // 2
    return {"order": lower, "index_set": "hyperbolic", "method": "regression", "samples": 2 * (1 + inputs * lower)}


def mechanism_of(case):
    """Return a mass at rest, with inputs that affect only the requirement."""
    count, relation, _ = CASES[case]
    mechanism = uqmbd.Mechanism("still", uqmbd.Line())
    mechanism.body("mass", mass=1)
    inputs = [uqmbd.RandomVariable(f"x{k:02d}", chaospy.Normal(0, 1)) for k in range(count)]
    mechanism.require("limit", relation(inputs))
    return mechanism


def coverage(case, method, seeds, probability):
    """Return the number of intervals that contain the truth, all widths, probabilities, and realisations."""
    study = uqmbd.Study("still", mechanism_of(case))
    count = CASES[case][0]
    held, widths, found, cost = 0, [], [], 0
    for seed in range(seeds):
        propagator = METHODS[method](seed, count)
        if propagator is None:
            return None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            node = study.propagate(propagator)
        data = node["requirements"].to_dataset()
        low, high = data["interval"].values[0]
        held += bool(low <= probability <= high)
        widths.append(high - low)
        found.append(float(data["violation_probability"].values[0]))
        cost = node.attrs["realisations"]
    return held / seeds, np.array(widths), np.array(found), cost


def counted_width(probability, count):
    """Return the median width of the interval of as many independent realisations."""
    lower, upper = clopper_pearson(binom.median(count, probability), count)
    return float(upper - lower)


def main(seeds=200):
    heads = {"case": 20, "truth": 10, "method": 22, "contain": 8, "found": 11, "median width": 14, "counted": 10}
    print("".join(f"{name:<{width}}" for name, width in heads.items()) + "realisations")
    for case, (_, _, known) in CASES.items():
        truth = float(known())
        for method in METHODS:
            begin = time.perf_counter()
            result = coverage(case, method, seeds, truth)
            if result is None:
                continue
            held, widths, found, cost = result
            print(
                f"{case:<20}{truth:<10.4g}{method:<22}{held:<8.1%}{np.median(found):<11.4g}{np.median(widths):<14.3g}"
                f"{counted_width(truth, cost):<10.3g}{cost:<6} {time.perf_counter() - begin:.0f} s",
                flush=True,
            )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
