"""Measure how the cost of a run, its file and its report grows with the number of outputs.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/many_outputs.py [--outputs 100 200 400 800]``.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import chaospy
import numpy as np

import uqmbd
import uqmbd.report
import uqmbd.results
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo


def study(outputs: int) -> uqmbd.Study:
    """Return a body of random speed, observed at 21 times by several outputs."""
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(1, 0.1), units="m/s")
    mechanism = uqmbd.Mechanism("body", uqmbd.Line())
    body = mechanism.body("body", mass=1, velocity=speed)
    for k in range(outputs):
        mechanism.output(f"x{k}", body.position[0] * (k + 1), units="m")
    methods = [MonteCarlo(samples=200, seed=1), Collocation(order=2, verify=4)]
    return uqmbd.Study("body", mechanism, np.linspace(0, 1, 21), methods)


def measured(outputs: int, folder: Path) -> list[float]:
    """Return the seconds of a run, of its file and of its report (processor time), and the size of the report, MB."""
    made = study(outputs)
    times = [time.process_time()]
    tree = made.run(progress=False)
    times.append(time.process_time())
    uqmbd.results.save(tree, folder / f"{outputs}.nc")
    read = uqmbd.results.load(folder / f"{outputs}.nc")
    times.append(time.process_time())
    report = uqmbd.report.write_report(read, folder / f"{outputs}.html")
    times.append(time.process_time())
    return [*np.diff(times).tolist(), report.stat().st_size / 1e6]


def main() -> None:
    """Measure each number of outputs, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--outputs", type=int, nargs="+", default=[100, 200, 400, 800])
    numbers = parser.parse_args().outputs
    print("| outputs | run, s | save and load, s | report, s | report, MB |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        measured(2, Path(folder))  # imports and caches
        for outputs in numbers:
            print(f"| {outputs} | {' | '.join(f'{x:.1f}' for x in measured(outputs, Path(folder)))} |")


if __name__ == "__main__":
    main()
