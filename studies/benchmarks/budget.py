"""Measure how often the true error is within a requested accuracy, and how many realisations that needs.

Three outputs of one normal input have moments in closed form.  They need no integration, so the benchmark measures only
the choice of sizes.  The outputs are a linear function, an exponential function and a sine.  The exponential function
gives a lognormal output of kurtosis 41, whose tail a pilot of 64 samples does not contain.  A chaos of any order leaves
an error for the sine.

For Monte Carlo and each accuracy the table lists:

- the share of seeds for which the mean, the standard deviation, and both are within it (95 % is intended for a single
  quantity);
- the number of samples as a multiple of (1.96 / accuracy)^2, which a mean needs;
- the number of sizes in the search, and the number of computed realisations for each one in the results.

For collocation and Galerkin the table lists the chosen order, its stated error and its true error.

Run: python studies/benchmarks/budget.py [SEEDS]
"""

from __future__ import annotations

import json
import math
import sys
import time
import warnings

import chaospy
import numpy as np
import sympy

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo

STD = 0.2

CASES = {
    "linear": (lambda x: x, 0.0, STD),
    "exp, kurtosis 41": (
        lambda x: sympy.exp(4 * x),
        math.exp(0.32),
        math.exp(0.32) * math.sqrt(math.expm1(0.64)),
    ),
    "sine": (
        lambda x: sympy.sin(5 * x),
        0.0,
        math.sqrt((1 - math.exp(-2)) / 2),
    ),
}


def study(of):
    mechanism = uqmbd.Mechanism("drift", uqmbd.Translational())
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(0, STD), units="m/s")
    mass = mechanism.body("mass", mass=1, velocity=(speed, 0))
    mechanism.output("x", of(mass.position[0]), units="m")
    return uqmbd.Study("drift", mechanism, [0.0, 1.0])


def ran(one, method, accuracy):
    tree = one.with_propagators([method]).run(accuracy=accuracy)
    statistics = tree[method.node_name]["statistics"].dataset
    return statistics, json.loads(tree.attrs["budget"])["methods"][method.node_name]


def monte_carlo(seeds):
    print(f"Monte Carlo, {seeds} seeds")
    print(
        f"{'output':<18}{'accuracy':>9}{'mean':>8}{'std':>8}{'both':>8}{'samples':>9}{'sizes':>7}{'computed':>10}{'s':>7}"
    )
    for name, (of, mean, std) in CASES.items():
        one = study(of)
        for accuracy in (0.1, 0.05):
            held, samples, sizes, computed, begin = [], [], [], [], time.perf_counter()
            for seed in range(seeds):
                found, about = ran(one, MonteCarlo(seed=seed), accuracy)
                errors = [abs(float(found[n][0, 1]) - exact) / std for n, exact in (("mean", mean), ("std", std))]
                held.append([error <= accuracy for error in errors])
                samples.append(about["size"] * (accuracy / 1.96) ** 2)
                sizes.append(len(about["stages"]))
                computed.append(about["spent"] / about["size"])
            shares = (*np.mean(held, axis=0), np.mean(np.all(held, axis=1)))
            print(
                f"{name:<18}{accuracy:>8.0%} "
                + "".join(f"{share:>7.1%} " for share in shares)
                + f"{np.median(samples):>8.2f}{np.mean(sizes):>7.1f}{np.mean(computed):>10.2f}"
                + f"{(time.perf_counter() - begin) / seeds:>7.2f}",
                flush=True,
            )


def orders():
    print(f"\n{'method':<13}{'output':<18}{'accuracy':>9}{'order':>7}{'stated':>10}{'true':>10}")
    for name, (of, mean, std) in CASES.items():
        one = study(of)
        for method in (Collocation(), Galerkin()):
            for accuracy in (0.1, 0.01, 1e-3, 1e-4):
                found, about = ran(one, method, accuracy)
                errors = [abs(float(found[n][0, 1]) - exact) / std for n, exact in (("mean", mean), ("std", std))]
                stated = f"{about['stated']:>10.1e}{'' if about['met'] else ' (missed)'}"
                print(f"{method.name:<13}{name:<18}{accuracy:>9g}{about['size']:>7}{stated}{max(errors):>10.1e}")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    monte_carlo(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
    orders()
