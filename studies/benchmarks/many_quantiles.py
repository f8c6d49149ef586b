"""Measure statistics of samples that are not all in memory: their share of the time of a million pendulums, and memory.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/many_quantiles.py [--samples N] [--memory]``.  With ``--memory``
the run has no folder, so that it counts quantiles while the samples arrive.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import chaospy
import numpy as np

import uqmbd
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_montecarlo.all_samples import Passing, Stored


class Clock:
    """Processor time of some methods."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def watch(self, cls: type, name: str) -> None:
        """Add the processor time of a method from now on."""
        method: Callable[..., Any] = getattr(cls, name)

        def timed(*args: Any) -> Any:
            begin = time.thread_time()
            try:
                return method(*args)
            finally:
                self.seconds += time.thread_time() - begin

        setattr(cls, name, timed)


def study(samples: int) -> uqmbd.Study:
    """Return a pendulum of random length, at 201 times."""
    length = uqmbd.RandomVariable("length", chaospy.Normal(1.0, 0.02), units="m")
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0.0, -9.81)))
    rod = mechanism.body("rod", mass=1.2, inertia=length**2 / 10, position=(length / 2, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-length / 2, 0)))
    mechanism.output("angle", rod.angle, units="rad")
    return uqmbd.Study("pendulum", mechanism, np.linspace(0, 2, 201), [MonteCarlo(samples=samples, seed=1)])


def main() -> None:
    """Run the study once, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--memory", action="store_true")
    given = parser.parse_args()
    clock = Clock()
    for cls, name in ((Stored, "statistics"), (Passing, "statistics"), (Passing, "add")):
        clock.watch(cls, name)
    with tempfile.TemporaryDirectory() as folder:
        begin = time.process_time()
        tree = study(given.samples).run(folder=None if given.memory else Path(folder))
        seconds = time.process_time() - begin
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(f"{given.samples} samples: {seconds:.1f} s of processor time, {peak:.0f} MB")
    print(f"quantiles, extremes and directions: {clock.seconds:.1f} s, {clock.seconds / seconds:.0%}")
    statistics = tree["monte-carlo/statistics"].to_dataset()
    if "quantile_error" in statistics:
        worst = (statistics["quantile_error"] / statistics["std"].where(statistics["std"] > 0)).max()
        print(f"error bound of quantiles: {float(worst):.1e} standard deviations")


if __name__ == "__main__":
    main()
