"""Measure the cost of output times: integration and outputs at 401 times, relative to 2 times.

The mechanisms are a slider-crank (2 s), a spherical five-bar (0.5 s) and an open chain of 20 spatial links that hangs
at rest (1 s).  A hanging chain takes the fewest steps, so that its output times weigh most.  Realisations of a group
are integrated and observed together, as in a study.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/output_times.py [--repeat N] [--samples N]``.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import mechanisms
import numpy as np
import slider_crank
from measure import console, spent, table_of

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate

RTOL = 1e-6
COUNTS = 2, 401
CASES: dict[str, tuple[Callable[[], uqmbd.Mechanism], float]] = {
    "slider-crank": (lambda: slider_crank.mechanism, 2.0),
    "five-bar": (lambda: mechanisms.five_bar(random=True), mechanisms.END),
    "20 spatial links": (lambda: mechanisms.spatial_links(20), 1.0),
}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=9, help="rounds (default 9)")
    parser.add_argument("--samples", type=int, default=64, help="realisations of a group (default 64)")
    options = parser.parse_args()
    columns = (
        "",
        *(f"{count} times, us a sample" for count in COUNTS),
        "ratio (range)",
        "ratio of the integration",
        "steps",
    )
    table = table_of(f"Output times: processor time of groups of {options.samples}, tolerance {RTOL:g}", *columns)
    for name, (make, end) in CASES.items():
        mechanism = make()
        model, samples = build(mechanism), options.samples
        points = np.random.default_rng(1).uniform(size=(samples, len(mechanism.inputs)))
        ensemble = Ensemble(model, mechanism.inputs.from_uniform(points) if len(mechanism.inputs) else points)
        ensemble.start  # noqa: B018 - assembled now
        seconds = np.empty((options.repeat, 2, len(COUNTS)))
        for turn in range(-1, options.repeat):  # the first round does not count
            for k, count in enumerate(COUNTS):
                times = np.linspace(0, end, count)
                found = integrate(ensemble, times, RTOL)
                moved = partial(integrate, ensemble, times, RTOL)
                observed = partial(ensemble.outputs, times, found.states)
                if turn >= 0:
                    seconds[turn, :, k] = spent(moved, 0.02), spent(observed, 0.02)
        whole = seconds.sum(axis=1)
        ratios, alone = whole[:, 1] / whole[:, 0], seconds[:, 0, 1] / seconds[:, 0, 0]
        table.add_row(
            name,
            *(f"{1e6 * x / samples:.3g}" for x in np.median(whole, axis=0)),
            f"{np.median(ratios):.2f} ({ratios.min():.2f} to {ratios.max():.2f})",
            f"{np.median(alone):.2f}",
            f"{integrate(ensemble, np.linspace(0, end, COUNTS[-1]), RTOL).counters.steps / samples:.1f}",
        )
    console.print(table)


if __name__ == "__main__":
    main()
