"""Work and precision of the integrators on stiff mechanisms, and the cost of stiff bushings.

The first table compares `radau`, `dop853` and IDA of uqmbd with the Radau method of SciPy (order 5), which integrates
the accelerations that uqmbd evaluates. The error is the largest one of all positions at 20 times, relative to the
largest position or 1 m. The reference is `radau` at ``rtol = 1e-12``. Its distance from `dop853` at 1e-11, a method of
another family, is also listed. The evaluations of `radau` include derivatives, each as four evaluations; those of SciPy
include finite differences. Times are processor times of one realisation relative to `radau` at the same tolerance.

The second table compares double pendula on stiff bushings with those on pins, including outputs at 101 times.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/stiff.py [--repeat N] [--only NAME ...] [--quick]``.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

# this script times integrations alone, so it imports the core directly
os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path[:0] = [str(Path(__file__).resolve().parent)]

import chaospy
import numpy as np
from measure import Contender, console, interleave, show, table_of
from scipy.integrate import solve_ivp
from stiff_mechanisms import MECHANISMS, double_pendulum

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd.dynamics.integration import integrate_by_dop853

TOLERANCES = (1e-4, 1e-6, 1e-8)
MOST = 15.0
"""Seconds of processor time after which SciPy stops."""

Run = Callable[[float], tuple[Any, str, str]]


def by_name(name: str, ensemble: Any, times: Any, rtol: float) -> tuple[Any, str, str]:
    """Integrate by uqmbd; return states (T, width), evaluations, and Jacobians that they do not include."""
    if name == "dop853":  # also after it finds that a realisation is stiff
        solved = integrate_by_dop853(ensemble, np.arange(1), times, rtol, patient=True)
        states, messages, counters = solved.states, solved.messages, solved.counters
    else:
        found = integrate(ensemble, times, rtol, name)
        states, messages, counters = found.states, found.messages, found.counters
    assert not any(messages), messages
    if name == "ida":
        return states[0], str(counters.residuals), str(counters.jacobians)
    return states[0], str(counters.accelerations), ""


def by_scipy(ensemble: Ensemble, times: Any, rtol: float) -> tuple[Any, str, str]:
    """Integrate by SciPy, with derivatives by finite differences."""
    count, end = 0, time.process_time() + MOST

    def rate(now: float, state: Any) -> Any:
        nonlocal count
        count += 1
        if time.process_time() > end:
            raise TimeoutError
        return ensemble.rates(now, state[None])[0]

    found = solve_ivp(rate, (0, times[-1]), ensemble.start.state[0], "Radau", times, rtol=rtol, atol=1e-3 * rtol)
    assert found.success, found.message
    return found.y.T, str(count), ""


def work_and_precision(make: Callable[[], tuple[uqmbd.Mechanism, float]], repeat: int, quick: bool) -> None:
    """Print the table of a mechanism."""
    mechanism, end = make()
    model = build(mechanism)
    ensemble, times = Ensemble(model, np.zeros((1, 0))), np.linspace(0, end, 21)
    places = slice(0, model.layout.coordinates)
    reference = by_name("radau", ensemble, times, 1e-12)[0][:, places]
    scale = max(1.0, float(np.abs(reference).max()))

    def error(states: Any) -> float:
        return float(np.abs(states[:, places] - reference).max()) / scale

    other = error(by_name("dop853", ensemble, times, 1e-11)[0])
    table = table_of(
        f"{mechanism.name}, {end:g} s; reference off by {other:.1g}",
        *("", "rtol", "error", "evaluations", "Jacobians", "time"),
    )
    runs: dict[str, Run] = {name: partial(by_name, name, ensemble, times) for name in ("radau", "dop853", "ida")}
    runs["SciPy Radau"] = partial(by_scipy, ensemble, times)
    for rtol in TOLERANCES[:2] if quick else TOLERANCES:
        found: dict[str, tuple[Any, str, str]] = {}
        seconds: dict[str, float] = {}
        for name, run in runs.items():
            begin = time.process_time()
            try:
                found[name] = run(rtol)
            except (AssertionError, TimeoutError, np.linalg.LinAlgError) as reason:
                table.add_row(name, f"{rtol:.0e}", "", "", "", str(reason) or f"more than {MOST:g} s")
            seconds[name] = time.process_time() - begin
        contenders = [Contender(name, partial(runs[name], rtol), "radau") for name in found if name != "SciPy Radau"]
        interleave(contenders, 1 if quick else repeat)
        base = np.array(contenders[0].cpu)
        ratios = {c.name: float(np.median(np.array(c.cpu) / base)) for c in contenders}
        # a run of SciPy takes seconds, so one run suffices
        ratios["SciPy Radau"] = seconds["SciPy Radau"] / float(np.median(base))
        for name, (states, *counts) in found.items():
            table.add_row(name, f"{rtol:.0e}", f"{error(states):.1e}", *counts, f"{ratios[name]:.2g}")
    console.print(table)


def bushings(count: int, repeat: int) -> None:
    """Print the costs of double pendula on bushings, relative to those on pins."""
    times = np.linspace(0, 2, 101)

    def run(ensemble: Ensemble, integrator: str) -> None:
        fresh = Ensemble(ensemble.model, ensemble.values)
        fresh.outputs(times, integrate(fresh, times, 1e-6, integrator).states)

    contenders = [
        Contender("pins", partial(run, Ensemble(build(double_pendulum()), np.zeros((count, 0))), "auto"), "pins")
    ]
    for stiffness in (1e4, 1e6, 1e8):
        k = uqmbd.RandomVariable("k", chaospy.Uniform(0.5 * stiffness, 1.5 * stiffness), units="N/m")
        values = np.random.default_rng(0).uniform(0.5 * stiffness, 1.5 * stiffness, (count, 1))
        ensemble = Ensemble(build(double_pendulum(k)), values)
        for integrator in ("radau", "auto"):
            contenders.append(
                Contender(f"{stiffness:.0e} N/m, {integrator}", partial(run, ensemble, integrator), "pins")
            )
    interleave(contenders, repeat)
    show(f"{count} double pendula, 2 s", contenders)


def main() -> None:
    """Run the benchmark."""
    names = [make.__name__ for make in MECHANISMS]
    parser = argparse.ArgumentParser(description="Work and precision of integrators on stiff mechanisms.")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--only", nargs="+", choices=[*names, "costs"], default=[*names, "costs"])
    parser.add_argument("--quick", action="store_true", help="one round, two tolerances")
    options = parser.parse_args()
    for make in MECHANISMS:
        if make.__name__ in options.only:
            work_and_precision(make, options.repeat, options.quick)
    if "costs" in options.only:
        for count in (64, 512):
            bushings(count, 1 if options.quick else 3 * options.repeat)


if __name__ == "__main__":
    main()
