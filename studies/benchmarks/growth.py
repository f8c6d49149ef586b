"""Measure the growth of the cost with the size of a mechanism: a chain of N four-bars.

Hinges connect N + 1 cranks of 1 m to the ground, 1 m apart, and N couplers join their neighbouring tips.  All are
uniform rods of 1 kg.  They hang at rest and start to swing with 3 rad/s, to 50 degrees or so.  The chain is singular in
the pose with all rods in line, which it does not reach.  All cranks swing alike, so one equation gives the exact
motion: ``((N + 1) / 3 + N) phi'' = -((N + 1) / 2 + N) g cos(phi)``.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/growth.py [--repeat 5] [--quick]``.
"""

from __future__ import annotations

import argparse
import os
import sys
from functools import partial
from pathlib import Path
from typing import Any

# this script times parts of the core, so it imports the core directly
os.environ.setdefault("OMP_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE)]

import numpy as np
from measure import console, spent, table_of
from mechanisms import GRAVITY, SPEED, START, four_bars
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from uqmbd.dynamics import Ensemble, build, integrate

Array = NDArray[np.float64]

NUMBERS = (1, 2, 5, 10, 20, 40)
END = 2.0
GROUP, STACK = 8, 64
RTOL = 1e-6


def exact(number: int, times: Array) -> Array:
    """Return the horizontal position of the tip of a crank, from the equation of the only degree of freedom."""
    inertia, weight = (number + 1) / 3 + number, ((number + 1) / 2 + number) * GRAVITY

    def rate(_: float, z: Array) -> list[float]:
        return [z[1], -weight / inertia * np.cos(z[0])]

    found = solve_ivp(rate, (times[0], times[-1]), [START, SPEED], "DOP853", times, rtol=1e-12, atol=1e-12)
    return np.asarray(np.cos(found.y[0]))


def exponent(numbers: tuple[int, ...], cost: Array) -> float:
    """Return the slope of the cost over the number of four-bars, both logarithmic, by a fit to all of them."""
    return float(np.polyfit(np.log(numbers), np.log(cost), 1)[0])


def runs(numbers: tuple[int, ...], repeat: int) -> None:
    """Print sizes, times, counts and errors of all chains."""
    times = np.linspace(0, END, 201)
    models = [build(four_bars(n)) for n in numbers]
    singles, groups, stacks = ([Ensemble(m, np.zeros((count, 0))) for m in models] for count in (1, GROUP, STACK))

    def whole(k: int) -> None:
        fresh = Ensemble(models[k], np.zeros((1, 0)))
        fresh.outputs(times, integrate(fresh, times, RTOL).states)

    ways: dict[str, Any] = {
        "one, with outputs": whole,
        "one by IDA": lambda k: integrate(singles[k], times, RTOL, method="ida"),
        f"of {GROUP}": lambda k: integrate(groups[k], times, RTOL),
        f"of {STACK}": lambda k: integrate(stacks[k], times, RTOL),
    }
    shares = np.array([1, 1, GROUP, STACK]) * END
    cost = np.zeros((len(ways), repeat + 1, len(numbers)))
    for r in range(repeat + 1):  # the first round does not count
        for k in range(len(numbers)):
            for w, run in enumerate(ways.values()):
                cost[w, r, k] = spent(partial(run, k)) / shares[w]
    cost = cost[:, 1:]
    columns = ("N", "unknowns", "steps", "evaluations", "residuals, Jacobians by IDA", "error, m", "energy")
    counts = table_of("Chains of N four-bars", *columns)
    found = ("N", *(text for way in ways for text in (way, "over N = 1 (range)")))
    clock = table_of(f"CPU ms of a realisation per simulated second, tolerance {RTOL:g}, {repeat} rounds", *found)
    for k, n in enumerate(numbers):
        explicit, implicit = (integrate(singles[k], times, RTOL, method=method) for method in ("auto", "ida"))
        error = np.abs(singles[k].outputs(times, explicit.states)[0, 0] - exact(n, times)).max()
        kinetic, potential = singles[k].energies(times, explicit.states)[0]
        drift = np.abs(kinetic + potential - kinetic[0] - potential[0]).max() / kinetic[0]
        counts.add_row(
            str(n),
            str(models[k].layout.unknowns),
            str(explicit.counters.steps),
            str(explicit.counters.accelerations),
            f"{implicit.counters.residuals}, {implicit.counters.jacobians}",
            f"{error:.0e}",
            f"{drift:.0e}",
        )
        row = [str(n)]
        for way in cost:
            ratio = way[:, k] / way[:, 0]
            row.append(f"{1e3 * np.median(way[:, k]):.3g}")
            row.append(f"{np.median(ratio):.3g} ({ratio.min():.3g} to {ratio.max():.3g})")
        clock.add_row(*row)
    console.print(counts)
    console.print(clock)
    large = tuple(n for n in numbers if n >= 10)
    for name, values in zip(ways, np.median(cost, axis=1), strict=True):
        text = f"{name}: N^{exponent(numbers, values):.2f}"
        if len(large) > 1:
            text += f", from N = 10 on N^{exponent(large, values[-len(large) :]):.2f}"
        console.print(text)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=5, help="rounds that count (default 5)")
    parser.add_argument("--quick", action="store_true", help="up to ten four-bars, two rounds")
    options = parser.parse_args()
    runs(NUMBERS[:4] if options.quick else NUMBERS, 2 if options.quick else options.repeat)


if __name__ == "__main__":
    main()
