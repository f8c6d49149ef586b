"""Measure times that users notice and tests omit: help of the command, statistics of a chaos, tables of random values.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/promises.py [--repeat 5]``; processor time, median of the runs.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import chaospy
import numpy as np

import uqmbd
from uqmbd import extend, results
from uqmbd.randomness.germs.germ import Germ
from uqmbd.randomness.index_sets import index_set
from uqmbd.randomness.space.germ_space import GermSpace

HELP = """
import runpy, sys, time
sys.argv = ["uqmbd", "--help"]
try:
    runpy.run_module("uqmbd.cli", run_name="__main__")
except SystemExit:
    pass
print(time.process_time())
"""


def of_help() -> float:
    """Return the processor time of ``uqmbd --help``, from the start of the interpreter on, s."""
    run = subprocess.run([sys.executable, "-c", HELP], capture_output=True, text=True, check=True)
    return float(run.stdout.split()[-1])


def spent(work: Callable[[], Any]) -> float:
    """Return the processor time of this process for a call, s."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def chaos() -> results.PolynomialChaos:
    """Return a chaos of 286 terms (3 inputs, order 10) with ten outputs at 1,000 times."""
    germs = tuple(Germ.classical(f"x{k}", ("hermite", "legendre")[k % 2]) for k in range(3))
    names, index = tuple(g.name for g in germs), index_set(3, 10)
    values = np.random.default_rng(0).normal(size=(len(index), 10, 1000)) * 0.5 ** index.sum(axis=1)[:, None, None]
    axes = extend.labels([f"y{k}" for k in range(10)], names, np.arange(1000.0))
    return results.PolynomialChaos(values, index, GermSpace(names, germs, ()), axes)


def of_indices() -> float:
    """Return the processor time of variance and Sobol' indices up to second order of 10,000 outputs, s."""
    one = chaos()
    return spent(lambda: (one.variance, one.sobol_first, one.sobol_second, one.sobol_total))


def of_shape() -> float:
    """Return the processor time of skewness and kurtosis of 10,000 outputs, s."""
    one = chaos()
    return spent(lambda: (one.skewness, one.kurtosis))


def of_table() -> float:
    """Return the processor time of a table of a thousand random values over time, and of its derivative, s."""
    f, g = (uqmbd.RandomVariable(name, chaospy.Normal(0, 1)) for name in ("f", "g"))
    values = [a * f + b * g for a, b in np.random.default_rng(0).normal(size=(1000, 2))]
    return spent(lambda: uqmbd.spline(list(range(1000)), values).diff(uqmbd.t))


PROMISES = (
    ("`uqmbd --help`", of_help, 0.5),
    ("variance and indices of 10,000 outputs", of_indices, 0.2),
    ("skewness and kurtosis of 10,000 outputs", of_shape, 4.0),
    ("a table of 1,000 random values, differentiated", of_table, 3.0),
)


def main() -> None:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=5)
    repeat = parser.parse_args().repeat
    print("| operation | measured, s | promised, s |\n|---|---|---|")
    for name, measure, promised in PROMISES:
        print(f"| {name} | {statistics.median(measure() for _ in range(repeat)):.2g} | {promised:g} |", flush=True)


if __name__ == "__main__":
    main()
