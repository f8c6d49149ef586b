"""Measure how often 1.96 stated standard errors contain the true mean and standard deviation, by design and control.

The outputs are functions of two inputs with moments in closed form, and need no motion.  The benchmark measures only
the statistics of `MonteCarlo`.  For each design and number of samples it lists the share of seeds whose 95 % interval
contains the true value.  It also lists the bias of the standard deviation, in units of 1 / (2 N) of it.

Run: python studies/benchmarks/standard_errors.py [--seeds N] [--samples N ...] [--design NAME ...]
"""

from __future__ import annotations

import argparse
import sys
import warnings
from pathlib import Path
from typing import Any

import chaospy
import numpy as np
import sympy

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE)]

from measure import console, table_of

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import LowFidelity, MonteCarlo

A, B = (uqmbd.RandomVariable(name, chaospy.Uniform(0, 1)) for name in "ab")
N = uqmbd.RandomVariable("n", chaospy.Normal(0, 1))
UNIT = 1 / np.sqrt(12)


def step(x: Any) -> Any:
    """Return 1 where an expression is positive, else 0."""
    return sympy.Piecewise((1, x > 0), (0, True))


OUTPUTS: dict[str, tuple[Any, float, float]] = {
    "linear": (A, 0.5, UNIT),
    "sum": (A + 2 * B, 1.5, np.sqrt(5) * UNIT),
    "quadratic": (A**2, 1 / 3, np.sqrt(4 / 45)),
    "exponential": (sympy.exp(A), np.e - 1, np.sqrt((np.e**2 - 1) / 2 - (np.e - 1) ** 2)),
    "wave": (sympy.sin(2 * sympy.pi * A), 0.0, np.sqrt(0.5)),
    "product": ((A - 0.5) * (B - 0.5), 0.0, 1 / 12),
    "two values": (step(0.5 - A), 0.5, 0.5),
    "jump": (step(0.3 - A), 0.3, np.sqrt(0.21)),
    "corner": (step(0.6 - A - B), 0.18, np.sqrt(0.18 * 0.82)),
    "normal": (N, 0.0, 1.0),
    "square of a normal": (N**2, 1.0, np.sqrt(2)),
    "lognormal": (sympy.exp(N / 2), np.exp(1 / 8), np.exp(1 / 8) * np.sqrt(np.exp(1 / 4) - 1)),
}
"""Expression, mean, standard deviation."""


def study(shift: float = 0.0) -> uqmbd.Study:
    """Return a body at rest with the outputs, less a part that the low-fidelity study omits."""
    mechanism = uqmbd.Mechanism("rest", uqmbd.Line())
    mechanism.body("body", mass=1, position=0, velocity=0)
    for name, (expression, *_) in OUTPUTS.items():
        mechanism.output(name, expression + shift * sympy.sin(9 * A) * B)
    return uqmbd.Study("rest", mechanism, [0.0, 1.0])


def methods(samples: int) -> dict[str, dict[str, Any]]:
    """Return the options of each design, and of controls if there are enough samples for one."""
    found: dict[str, dict[str, Any]] = {
        name: {"sampling": name} for name in ("random", "latin-hypercube", "sobol", "halton")
    }
    found["chaos"] = {"control": Collocation(order=2, verify=0)}
    found["cheaper study"] = {"control": LowFidelity(study(0.3), cost=0.1, samples=10 * samples)}
    return found


def shares(whole: uqmbd.Study, options: dict[str, Any], samples: int, seeds: int) -> dict[str, list[float]]:
    """Return for each output the coverage of mean and deviation, %, and the bias over 1 / (2 N)."""
    hits = {name: np.zeros(3) for name in OUTPUTS}
    for seed in range(seeds):
        method = MonteCarlo(samples=samples, seed=seed, **options)
        found = whole.propagate(method)["statistics"].to_dataset().isel(time=0)
        for name, (_, mean, std) in OUTPUTS.items():
            at = {key: float(found[key].sel(output=name)) for key in ("mean", "std", "std_error_mean", "std_error_std")}
            hits[name] += [
                abs(at["mean"] - mean) <= 1.96 * at["std_error_mean"] + 1e-9,
                abs(at["std"] - std) <= 1.96 * at["std_error_std"] + 1e-9,
                (at["std"] / std - 1) * 2 * samples / 100,  # a mean, not a share
            ]
    return {name: (100 * count / seeds).tolist() for name, count in hits.items()}


def main() -> None:
    """Print a table for each statistic."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--samples", type=int, nargs="+", default=[64, 128, 512, 2048])
    parser.add_argument("--design", nargs="+", default=list(methods(64)))
    given = parser.parse_args()
    whole = study()
    table = table_of("Seeds in which 1.96 standard errors contain the true value, %", "design", "N", "of", *OUTPUTS)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for design in given.design:
            for samples in given.samples:
                found = shares(whole, methods(samples)[design], samples, given.seeds)
                for k, what in enumerate(("mean", "std", "bias")):
                    shown = (f"{found[name][k]:.{0 if k < 2 else 1}f}" for name in OUTPUTS)
                    table.add_row(design, str(samples), what, *shown)
    console.print(table)


if __name__ == "__main__":
    main()
