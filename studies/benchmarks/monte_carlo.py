"""Time Monte Carlo of 500 slider-cranks and 500 spatial five-bars: whole studies against CasADi's IDAS at equal error.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/monte_carlo.py [--repeat N] [--quick] [--threads]``.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
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
from measure import Contender, console, interleave, matched, show
from numpy.typing import NDArray

import uqmbd
from uqmbd.dynamics import Ensemble, Model, integrate
from uqmbd_montecarlo import MonteCarlo

Array = NDArray[np.float64]

LADDER = (1e-4, 5e-5, 3e-5, 2e-5, 1e-5, 7e-6, 5e-6, 3e-6, 2e-6, 1e-6, 5e-7, 2e-7)
WANTED = 2e-5
"""Median over the samples of the largest error of any output at any time over the range of that output."""
JUDGED = 24
"""Number of samples with a reference solution."""
FEW = 16
"""Number of samples of slow contenders, whose time is scaled."""
EXUDYN = 400
"""Steps of the first of the two runs for the extrapolation with Exudyn."""

PEER, WHOLE, ALONE = "CasADi, one by one", "uqmbd, whole study", "uqmbd, integration, assembled"
COLUMNS = ("tolerance", "median, largest error", "us a sample")


@dataclass(frozen=True)
class Task:
    """A mechanism with random parameters, as a study for uqmbd and by hand for CasADi.

    Attributes
    ----------
    name : str
        Name of the mechanism among the peers.
    mechanism : uqmbd.Mechanism
        Mechanism whose random variables are, in this order, the parameters of the peer.
    times : array
        Output times, s.
    reference : callable
        Outputs (K, output, T) for values (K, input); errors of further outputs are not computed.
    """

    name: str
    mechanism: uqmbd.Mechanism
    times: Array
    reference: Callable[[Array, Array], Array]

    def study(self, samples: int, rtol: float) -> uqmbd.Study:
        """Return the whole study."""
        method = MonteCarlo(samples=samples, seed=1)
        return uqmbd.Study(self.name, self.mechanism, self.times, [method], rtol=rtol)

    @cached_property
    def model(self) -> Model:
        """Compiled model."""
        return self.study(2, 1e-6).model

    @cached_property
    def values(self) -> Array:
        """Inputs of the samples of the study, the same for all contenders."""
        tree = self.study(500, 1e-4).run()
        return np.asarray(tree["monte-carlo/samples"]["inputs"])

    @cached_property
    def judged(self) -> tuple[Array, Array]:
        """Some of the samples, and their reference solution."""
        values = self.values[:JUDGED]
        return values, self.reference(values, self.times)

    def error(self, found: Array) -> Array:
        """Return the error of each sample with a reference solution."""
        reference = self.judged[1]
        found = found[: len(reference), : reference.shape[1]]
        each = np.abs(found - reference[: len(found)]).max(axis=2) / np.ptp(reference[: len(found)], axis=2)
        return np.asarray(each.max(axis=1))

    def note(self, rtol: float, found: Array) -> tuple[str, str]:
        """Format tolerance and errors for the table."""
        error = self.error(found)
        return f"{rtol:.0e}", f"{np.median(error):.0e}, {error.max():.0e}"

    def ours(self, values: Array, rtol: float, method: str = "auto") -> Array:
        """Integrate samples and compute their outputs, without statistics."""
        ensemble = Ensemble(self.model, values)
        return ensemble.outputs(self.times, integrate(ensemble, self.times, rtol, method=method).states)

    def tolerance(self, run: Callable[[Array, float], Array]) -> tuple[float, tuple[str, str]]:
        """Find the tolerance for the wanted accuracy of a contender, and its cells in the table."""
        values = self.judged[0]
        rtol, _ = matched(lambda x: float(np.median(self.error(run(values, x)))), LADDER, WANTED)
        return rtol, self.note(rtol, run(values, rtol))

    def theirs(self, values: Array, rtol: float) -> Array:
        """Integrate samples and compute their outputs by CasADi, one by one."""
        return peers.casadi_chunk(self.name, values, self.times, rtol)


def compare(task: Task, samples: int, repeat: int) -> list[Contender]:
    """Compare whole studies and their parts with CasADi."""
    values, times, few = task.values[:samples], task.times, task.values[:FEW]
    contenders = []

    def add(name: str, run: Callable[[], Any], notes: tuple[str, str], count: int = samples) -> None:
        contenders.append(Contender(name, run, PEER, samples / count, notes=notes))

    rtol, notes = task.tolerance(task.ours)
    study = task.study(samples, rtol)
    ready = Ensemble(study.model, values)
    assert ready.start.ok.all()
    add(WHOLE, lambda: study.propagate(study.propagators[0]), notes)
    add("uqmbd, states and outputs", lambda: task.ours(values, rtol), notes)
    add("uqmbd, assembly", lambda: Ensemble(task.model, values).start, ("", ""))
    add(ALONE, lambda: integrate(ready, times, rtol), notes)
    add(f"uqmbd, one by one ({FEW}, scaled)", lambda: [task.ours(v[None], rtol) for v in few], notes, FEW)

    def by_ida(values: Array, rtol: float) -> Array:
        return task.ours(values, rtol, "ida")

    implicit, notes = task.tolerance(by_ida)
    add(f"uqmbd by IDA ({FEW}, scaled)", lambda: by_ida(few, implicit), notes, FEW)
    theirs, notes = task.tolerance(task.theirs)
    add(PEER, lambda: task.theirs(values, theirs), notes)
    if task.name == "slider_crank":
        notes = "", task.note(0, exudyn(values[:4], times))[1]
        add("Exudyn, extrapolated (4, scaled)", lambda: exudyn(values[:4], times), notes, 4)
    interleave(contenders, repeat)
    for c in contenders:
        c.notes = (*c.notes, f"{1e6 * float(np.median(c.cpu)) / samples:.3g}")
    return contenders


def exudyn(values: Array, times: Array) -> Array:
    """Integrate slider-cranks by Exudyn with extrapolation."""
    found = []
    for crank, rod in values:
        once, twice = (peers.exudyn_slider_crank(crank, rod, times, n).outputs for n in (EXUDYN, 2 * EXUDYN))
        found.append((4 * twice - once) / 3)
    return np.array(found)


def threads(samples: int, repeat: int) -> list[Contender]:
    """Compare a study in one thread and in two by wall time, which requires an idle machine.

    The main thread starts tasks, gathers results and builds tables.  Its processor time bounds the serial part, also on
    a busy machine.  By Amdahl's law that bounds the ratio of one thread over two.
    """
    task = slider_cranks()
    study = task.study(samples, 1e-6)
    method, one = study.propagators[0], "one thread"
    main: dict[int, list[float]] = {1: [], 2: []}

    def run(workers: int) -> None:
        begin = time.thread_time()
        study.propagate(method, workers=workers)
        main[workers].append(time.thread_time() - begin)

    contenders = [Contender(name, partial(run, n), one, wall=True) for name, n in ((one, 1), ("two threads", 2))]
    interleave(contenders, repeat)
    alone, shared = contenders
    serial = np.median(np.array(main[2][1:]) / shared.cpu)
    alone.notes = (f"{np.median(alone.cpu):.2f}", "", "")
    shared.notes = (f"{np.median(shared.cpu):.2f}", f"{serial:.3f}", f"{2 / (1 + serial):.2f}")
    return contenders


def slider_cranks() -> Task:
    """Return the task of the slider-crank of the study."""
    inputs = slider_crank.mechanism.inputs
    if list(inputs.names) != ["crank_length", "rod_length"]:
        raise SystemExit("the inputs of the study do not match the peer")
    return Task("slider_crank", slider_crank.mechanism, slider_crank.study.times, peers.slider_crank_reference)


def five_bars() -> Task:
    """Return the task of the spatial five-bar with a random centre of mass."""
    times = np.linspace(0, mechanisms.END, 401)

    def reference(values: Array, times: Array) -> Array:
        return np.array([peers.five_bar_reference(p, times) for p in values])

    return Task("five_bar", mechanisms.five_bar(random=True), times, reference)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=5, help="rounds that count (default 5)")
    parser.add_argument("--quick", action="store_true", help="128 samples, two rounds")
    parser.add_argument("--threads", action="store_true", help="compare one thread with two, for 4,000 slider-cranks")
    options = parser.parse_args()
    samples, repeat = (128, 2) if options.quick else (500, options.repeat)
    if options.threads:
        found = threads(512 if options.quick else 4000, repeat)
        show(
            f"{512 if options.quick else 4000} slider-cranks, whole studies, {repeat} rounds",
            found,
            ("processor s", "share of the main thread", "one over two threads, at most"),
            unit="s",
        )
        return
    for task in (slider_cranks(), five_bars()):
        found = compare(task, samples, repeat)
        title = f"{samples} of {task.name}, {len(task.times)} output times, one process, {repeat} rounds"
        show(title, found, COLUMNS, unit="s")
        by_name = {c.name: np.array(c.cpu) for c in found}
        for name in (WHOLE, ALONE):
            ratio = by_name[PEER] / by_name[name]
            console.print(f"CasADi over {name}: {np.median(ratio):.1f} ({ratio.min():.1f} to {ratio.max():.1f})")


if __name__ == "__main__":
    main()
