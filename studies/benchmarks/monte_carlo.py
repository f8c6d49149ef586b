"""Monte Carlo of the slider-crank: uqmbd stacked, one by one and in two processes against CasADi's IDAS and Exudyn.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/monte_carlo.py [--repeat N] [--quick]``.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

# what is measured here is parts of the core (integration without outputs), so the core is imported directly
os.environ.setdefault("OMP_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import numpy as np
import peers
import slider_crank
from measure import Contender, Timers, console, interleave, show, show_parts, timed_callbacks
from numpy.typing import NDArray

from uqmbd.dynamics import Counters, Ensemble, integrate, integrator_class
from uqmbd_montecarlo import MonteCarlo

Array = NDArray[np.float64]

CHUNK = 64
RTOL = 1e-6
COLUMNS = ("median, largest error", "evaluations", "Jacobians", "integrations")
EXUDYN = 400
"""Steps of the first of the two runs from which Exudyn's motion is extrapolated."""


def drawn(samples: int) -> Array:
    """Draw crank and rod lengths, shape (samples, 2)."""
    inputs = slider_crank.mechanism.inputs
    order = [inputs.names.index(name) for name in ("crank_length", "rod_length")]
    values = inputs.from_uniform(np.random.default_rng(1).uniform(size=(samples, len(inputs))))
    if order != [0, 1]:
        raise SystemExit("the study has changed its inputs")
    return values


def stacked(values: Array, times: Array, chunk: int = CHUNK, method: str = "auto") -> tuple[Array, Counters]:
    """Integrate and observe samples in stacks: responses (K, output, T) and what it cost."""
    model, parts, counters = slider_crank.study.model, [], Counters()
    for k in range(0, len(values), chunk):
        ensemble = Ensemble(model, values[k : k + chunk])
        found = integrator_class(method)(stack=chunk).integrate(ensemble, times, RTOL)
        parts.append(ensemble.outputs(times, found.states))
        counters = counters + found.counters
    return np.concatenate(parts), counters


def exudyn(values: Array, times: Array) -> Array:
    """Integrate samples by Exudyn, extrapolated."""
    found = []
    for crank, rod in values:
        once, twice = (peers.exudyn_slider_crank(crank, rod, times, n).outputs for n in (EXUDYN, 2 * EXUDYN))
        found.append((4 * twice - once) / 3)
    return np.array(found)


def relative_error(found: Array, reference: Array) -> str:
    """Median and largest error over the samples, each the largest of any output at any time over its range."""
    error = (np.abs(found[:, :2] - reference).max(axis=2) / np.ptp(reference, axis=2)).max(axis=1)
    return f"{np.median(error):.0e}, {error.max():.0e}"


def one_process(values: Array, times: Array, repeat: int, few: int) -> list[Contender]:
    """Compare everything that runs in this process."""
    count, peer = len(values), "CasADi, one by one"
    reference = peers.slider_crank_reference(values, times)

    def notes(run: Array, part: slice, costs: tuple[float, float, float]) -> tuple[str, ...]:
        return (relative_error(run, reference[part]), *(f"{x:.0f}" for x in costs))

    part, every = slice(0, few), slice(None)
    scale, contenders = count / few, []
    for method, label in (("auto", "uqmbd"), ("ida", "uqmbd by IDA")):
        found, c = stacked(values, times, method=method)
        contenders.append(
            Contender(
                f"{label}, stacks of 64",
                lambda method=method: stacked(values, times, method=method),
                peer,
                notes=notes(found, every, (c.residuals + c.accelerations, c.jacobians, c.integrations)),
            )
        )
        found, c = stacked(values[part], times, 1, method)
        costs = ((c.residuals + c.accelerations) * scale, c.jacobians * scale, c.integrations * scale)
        contenders.append(
            Contender(
                f"{label}, one by one ({few} of them, scaled)",
                lambda method=method: stacked(values[part], times, 1, method),
                peer,
                scale,
                notes=notes(found, part, costs),
            )
        )
    solver = peers.casadi_peer(times, RTOL)
    found, calls, jacobians = [], 0, 0
    for p in values:
        states = solver.integrate(solver.start(peers.slider_crank_pose(*p), p), p)
        found.append(solver.outputs(states, p))
        more = solver.counters()
        calls, jacobians = calls + more[0], jacobians + more[1]
    contenders.append(
        Contender(
            peer,
            lambda: peers.casadi_chunk(values, times, RTOL),
            peer,
            notes=notes(np.array(found), every, (calls, jacobians, count)),
        )
    )
    exu = max(2, few // 4)
    found = exudyn(values[:exu], times)
    contenders.append(
        Contender(
            f"Exudyn, extrapolated ({exu} of them, scaled)",
            lambda: exudyn(values[:exu], times),
            peer,
            count / exu,
            notes=(relative_error(found, reference[:exu]), "", "", f"{2 * count}"),
        )
    )
    interleave(contenders, repeat)
    return contenders


def two_processes(samples: int, times: Array, repeat: int) -> list[Contender]:
    """Compare whole studies, and CasADi likewise, in one process and in two: wall time."""
    study = slider_crank.study.with_propagators([MonteCarlo(samples=samples, seed=1)])
    values, spawn = drawn(samples), multiprocessing.get_context("spawn")
    parts = np.array_split(values, 16)
    with (
        ProcessPoolExecutor(2, mp_context=spawn) as ours,
        ProcessPoolExecutor(2, mp_context=spawn) as theirs,
    ):

        def casadi(executor: ProcessPoolExecutor | None) -> None:
            if executor is None:
                peers.casadi_chunk(values, times, RTOL)
            else:
                n = len(parts)
                list(executor.map(peers.casadi_chunk, parts, [times] * n, [RTOL] * n))

        def fresh() -> None:
            with ProcessPoolExecutor(2, mp_context=spawn) as executor:
                casadi(executor)

        peer = "CasADi, one process"
        contenders = [
            Contender("uqmbd study, one process", lambda: study.run(), peer, wall=True),
            Contender("uqmbd study, two processes, running already", lambda: study.run(workers=ours), peer, wall=True),
            Contender("uqmbd study, two processes, with their start", lambda: study.run(workers=2), peer, wall=True),
            Contender(peer, lambda: casadi(None), peer, wall=True),
            Contender("CasADi, two processes, running already", lambda: casadi(theirs), peer, wall=True),
            Contender("CasADi, two processes, with their start", fresh, peer, wall=True),
        ]
        interleave(contenders, repeat)
    return contenders


def parts_of_a_stack(values: Array, times: Array, repeat: int, method: str) -> None:
    """Print where the time of a stack goes."""
    timers, total = Timers(), 0.0
    chunk, model = values[:CHUNK], slider_crank.study.model
    with timed_callbacks(timers):
        for _ in range(repeat):
            begin = time.process_time()
            ensemble = Ensemble(model, chunk)
            timers.wrap("assembly", lambda e=ensemble: e.start)()
            states = integrate(ensemble, times, RTOL, method=method).states
            timers.wrap("outputs", ensemble.outputs)(times, states)
            total += time.process_time() - begin
    each = 1e3 * total / repeat / len(chunk)
    title = f"Where the time of a stack of {len(chunk)} goes ({method}; {repeat} runs, {each:.2f} ms a realisation)"
    show_parts(title, timers, total, "assembly", "outputs")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=5, help="rounds that count (default 5)")
    parser.add_argument("--quick", action="store_true", help="128 samples, two rounds")
    options = parser.parse_args()
    samples, repeat = (128, 2) if options.quick else (500, options.repeat)
    times, values = slider_crank.study.times, drawn(samples)
    model = slider_crank.study.model
    console.print(f"{samples} samples, {model.layout.unknowns} unknowns in uqmbd, {len(times)} output times")
    found = one_process(values, times, repeat, few=8 if options.quick else 16)
    show(f"{samples} samples with outputs, one process, {repeat} rounds", found, COLUMNS, unit="s")
    parts_of_a_stack(values, times, repeat, "auto")
    parts_of_a_stack(values, times, repeat, "ida")
    rounds = max(1, repeat // 2)
    found = two_processes(samples, times, rounds)
    show(f"{samples} samples, whole studies with statistics, rounds: {rounds}", found, unit="s")


if __name__ == "__main__":
    main()
