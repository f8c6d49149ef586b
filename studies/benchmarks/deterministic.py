"""Time one realisation: uqmbd against CasADi's IDAS and Exudyn at equal accuracy.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/deterministic.py [--repeat N] [--quick]``.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

# this script times parts of the core (integration without outputs), so it imports the core directly
os.environ.setdefault("OMP_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import mechanisms
import numpy as np
import peers
import slider_crank
from measure import Contender, console, interleave, matched, show, table_of
from numpy.typing import NDArray

import uqmbd
from uqmbd.dynamics import Ensemble, Model, build, integrate

Array = NDArray[np.float64]

LADDER = (1e-4, 5e-5, 3e-5, 2e-5, 1e-5, 7e-6, 5e-6, 3e-6, 2e-6, 1e-6, 5e-7, 2e-7, 1e-7)
WANTED = {"slider_crank": 2e-5, "five_bar": 2e-5}
"""Accuracy of the comparison: largest error at any output time over the range of the output."""

COLUMNS = ("tolerance", "error", "residuals", "Jacobians", "integrations")


def relative_error(found: Array, reference: Array) -> float:
    """Return the largest error of any output at any time, over the range of that output."""
    return float((np.abs(found - reference).max(axis=1) / np.ptp(reference, axis=1)).max())


def error_of(run: Callable[..., tuple[float, str]], how: Any, tolerance: float) -> float:
    """Return the error of a method at a tolerance."""
    return run(tolerance, how)[0]


def ladder_table(name: str, ours: Callable[[float], tuple[float, str]], theirs: Callable[[float], tuple[float, str]]):
    """Print error and residual calls of both for the same tolerances."""
    columns = ("tolerance", "uqmbd error", "calls", "CasADi error", "calls")
    table = table_of(f"{name}: error and residual calls by tolerance", *columns)
    for tolerance in (1e-4, 1e-5, 1e-6, 1e-7):
        a, b = ours(tolerance), theirs(tolerance)
        table.add_row(f"{tolerance:.0e}", f"{a[0]:.1e}", a[1], f"{b[0]:.1e}", b[1])
    console.print(table)


def compare(
    model: Model, p: Array, times: Array, reference: Array, repeat: int, pose: Array, peer: Any, quick: bool
) -> list[Contender]:
    """Time uqmbd and CasADi on one mechanism."""
    name, count = model.name, len(reference)
    wanted = WANTED[name]

    def ensemble() -> Ensemble:
        return Ensemble(model, p[None, :])

    ready = ensemble()
    assert ready.start.ok.all()

    def ours(rtol: float, method: str = "auto") -> tuple[float, str]:
        found = integrate(ready, times, rtol, method=method)
        calls = found.counters.residuals + found.counters.accelerations
        return relative_error(ready.outputs(times, found.states)[0, :count], reference), str(calls)

    made: dict[tuple[float, int], Any] = {}

    def make(tolerance: float, index: int) -> Any:
        if (tolerance, index) not in made:
            made[tolerance, index] = peers.CasadiPeer(peer, times, tolerance, index)
        return made[tolerance, index]

    def theirs(tolerance: float, index: int = 2) -> tuple[float, str]:
        run = make(tolerance, index)
        found = run.outputs(run.integrate(run.start(pose, p), p), p)
        return relative_error(found[:count], reference), str(run.counters()[0])

    if not quick:
        ladder_table(name, ours, theirs)
    contenders = []
    for method, label in (("auto", "uqmbd"), ("ida", "uqmbd by IDA")):
        rtol, error = matched(partial(error_of, ours, method), LADDER, wanted)
        c = integrate(ready, times, rtol, method=method).counters
        calls = c.residuals + c.accelerations
        notes = (f"{rtol:.0e}", f"{error:.1e}", str(calls), str(c.jacobians), str(c.integrations))

        def part(rtol: float = rtol, method: str = method) -> None:
            integrate(ready, times, rtol, method=method)

        def whole(rtol: float = rtol, method: str = method) -> None:
            fresh = ensemble()
            fresh.outputs(times, integrate(fresh, times, rtol, method=method).states)

        contenders.append(Contender(f"{label}, integration", part, "CasADi, integration", notes=notes))
        contenders.append(Contender(f"{label}, complete", whole, "CasADi, complete", notes=notes))
    for index, label in ((2, "CasADi"), (1, "CasADi index 1")):
        tolerance, error = matched(partial(error_of, theirs, index), LADDER, wanted)
        run = make(tolerance, index)
        begin = run.start(pose, p)
        run.integrate(begin, p)
        calls, jacobians = run.counters()
        notes = (f"{tolerance:.0e}", f"{error:.1e}", str(calls), str(jacobians), "1")

        def alone(run: Any = run, begin: Any = begin) -> None:
            run.integrate(begin, p)

        def complete(run: Any = run) -> None:
            run.outputs(run.integrate(run.start(pose, p), p), p)

        contenders.append(Contender(f"{label}, integration", alone, "CasADi, integration", notes=notes))
        contenders.append(Contender(f"{label}, complete", complete, "CasADi, complete", notes=notes))
    console.print(
        f"{name}: {model.layout.unknowns} unknowns in uqmbd ({len(model.layout.frozen)} coordinates frozen), "
        f"{make(LADDER[0], 2).unknowns} in CasADi (index 1: {make(LADDER[0], 1).unknowns})"
    )
    if name == "slider_crank":
        contenders += exudyn_contenders(p, times, reference, wanted)
    interleave(contenders, repeat)
    return contenders


def exudyn_contenders(p: Array, times: Array, reference: Array, wanted: float) -> list[Contender]:
    """Return two contenders of Exudyn: plain, and extrapolated from two step sizes."""
    intervals = len(times) - 1
    crank, rod = p

    def plain(steps: int) -> list[Any]:
        return [peers.exudyn_slider_crank(crank, rod, times, steps)]

    def extrapolated(steps: int) -> list[Any]:
        return [peers.exudyn_slider_crank(crank, rod, times, n) for n in (steps, 2 * steps)]

    def error(runs: list[Any]) -> float:
        found = runs[0].outputs if len(runs) == 1 else (4 * runs[1].outputs - runs[0].outputs) / 3
        return relative_error(found, reference)

    result = []
    for label, run in (("Exudyn, trapezoidal", plain), ("Exudyn, extrapolated", extrapolated)):
        steps = next(
            (k * intervals for k in (1, 2, 4, 6, 8, 12, 16) if error(run(k * intervals)) <= wanted), 16 * intervals
        )
        runs = run(steps)
        notes = (
            " + ".join(str(steps * 2**k) for k in range(len(runs))) + " steps",
            f"{error(runs):.1e}",
            str(sum(r.newton for r in runs)),
            str(sum(r.jacobians for r in runs)),
            str(len(runs)),
        )
        result.append(Contender(label, partial(run, steps), "CasADi, complete", notes=notes))
    return result


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=25, help="rounds that count (default 25)")
    parser.add_argument("--quick", action="store_true", help="slider-crank only, five rounds, no table of tolerances")
    options = parser.parse_args()
    repeat = 5 if options.quick else options.repeat
    import warnings

    warnings.simplefilter("ignore", uqmbd.RedundantConstraintWarning)
    lengths, times = np.array([0.15, 0.35]), slider_crank.study.times
    reference = peers.slider_crank_reference(lengths[None, :], times)[0]
    pose, peer = peers.slider_crank_pose(*lengths), peers.casadi_slider_crank()
    model = slider_crank.study.model
    found = compare(model, lengths, times, reference, repeat, pose, peer, options.quick)
    show(f"Slider-crank, {repeat} rounds", found, COLUMNS)
    if options.quick:
        return
    times = np.linspace(0, mechanisms.END, 401)
    model = build(mechanisms.five_bar(random=True))
    centre = np.array(mechanisms.BODIES["body1"][1][:2])
    reference = peers.five_bar_reference(centre, times)
    found = compare(model, centre, times, reference, repeat, peers.five_bar_pose(), peers.casadi_five_bar(), False)
    show(f"Spherical five-bar, {repeat} rounds", found, COLUMNS)


if __name__ == "__main__":
    main()
