"""Compare uqmbd with an earlier version: the same studies run alternately in two processes.

Each version runs in a separate process with a separate cache.  Both compile their models before the timing starts.  The
earlier version is a work tree, for instance from ``git worktree add --detach /elsewhere COMMIT``.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/earlier.py /elsewhere [--repeat N] [--quick] [--only TASK ...]``.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import numpy as np
from measure import console, spent, table_of

GROUP = 8
"""Number of realisations of the chains of four-bars."""
TIMES = 10
"""Number of assemblies in one timing."""
NUMBERS = (1, 2, 5, 10, 20, 40)
"""Numbers of four-bars of a chain."""


@dataclass(frozen=True)
class Task:
    """A timed operation.

    Attributes
    ----------
    title : str
        Name in the table.
    ready : callable
        Prepares and returns the timed operation, from the number of realisations.
    count, few : int
        Numbers of realisations, by default and with `--quick`.
    each : str
        Noun that the numbers count.
    """

    title: str
    ready: Callable[[int], Callable[[], Any]]
    count: int
    few: int
    each: str = "sample"


def monte_carlo(name: str) -> Callable[[int], Callable[[], Any]]:
    """Run Monte Carlo of a study, from the draws to the statistics."""

    def ready(samples: int) -> Callable[[], Any]:
        from uqmbd_montecarlo import MonteCarlo

        study, method = importlib.import_module(name).study, MonteCarlo(samples=samples, seed=1)
        return lambda: study.propagate(method)

    return ready


def whole(name: str) -> Callable[[int], Callable[[], Any]]:
    """Run a whole study with Monte Carlo, including its comparison and result tree."""

    def ready(samples: int) -> Callable[[], Any]:
        from uqmbd_montecarlo import MonteCarlo

        study = importlib.import_module(name).study.with_propagators((MonteCarlo(samples=samples, seed=1),))
        return lambda: study.run()

    return ready


def reliability(most: int) -> Callable[[], Any]:
    """Run Reliability of a motor whose speed is random, from the search of design points to the probabilities."""
    from uqmbd_reliability import Reliability

    study, method = importlib.import_module("limits").study, Reliability(max_realisations=most, seed=1)
    return lambda: study.propagate(method)


def galerkin(_: int) -> Callable[[], Any]:
    """Run Galerkin of order 4 on the Agile Eye without statistics: coefficients of the outputs."""
    import propagation

    task = propagation.Task(importlib.import_module("agile_eye").study)
    return lambda: task.galerkin(4)


def galerkin_study(_: int) -> Callable[[], Any]:
    """Run Galerkin of order 4 on the Agile Eye with statistics, diagnostics and verification."""
    from uqmbd_galerkin import Galerkin

    study = importlib.import_module("agile_eye").study
    return lambda: study.propagate(Galerkin(order=4))


def four_bars(number: int) -> Callable[[int], Callable[[], Any]]:
    """Assemble a group of chains of four-bars, and integrate it for 2 s."""

    def ready(count: int) -> Callable[[], Any]:
        import mechanisms

        from uqmbd.dynamics import Ensemble, build, integrate

        model, times = build(mechanisms.four_bars(number)), np.linspace(0, 2, 201)
        return lambda: integrate(Ensemble(model, np.zeros((count, 0))), times, 1e-6)

    return ready


def assembly(kind: str, *about: Any) -> Callable[[int], Callable[[], Any]]:
    """Assemble realisations, ten times: poses, velocities, accelerations and multipliers."""

    def ready(count: int) -> Callable[[], Any]:
        import mechanisms

        from uqmbd.dynamics import Ensemble, build

        mechanism = getattr(mechanisms, kind)(*about)
        points = np.random.default_rng(0).uniform(size=(count, len(mechanism.inputs.names)))
        model, values = build(mechanism), mechanism.inputs.from_uniform(points)

        def again() -> None:
            for _ in range(TIMES):
                assert not any(Ensemble(model, values).start.messages)

        return again

    return ready


TASKS = {
    "slider-crank": Task("slider-crank, Monte Carlo", monte_carlo("slider_crank"), 500, 128),
    "pendulum": Task("pendulum, Monte Carlo", monte_carlo("pendulum"), 50_000, 2000),
    "bouncing-ball": Task("bouncing ball, impacts", monte_carlo("bouncing_ball"), 200, 64),
    "compliant-ball": Task("bouncing ball, compliant", monte_carlo("bouncing_ball_compliant"), 200, 64),
    "clearance": Task("clearance joint", monte_carlo("clearance"), 100, 32),
    "small-study": Task("pendulum, whole study", whole("pendulum"), 8, 8),
    "limits": Task("limits, Reliability", reliability, 3000, 500),
    "galerkin": Task("Agile Eye, Galerkin of order 4", galerkin, 1, 1, "run"),
    "galerkin-study": Task("Agile Eye, Galerkin of order 4, whole study", galerkin_study, 1, 1, "run"),
} | {f"four-bars-{n}": Task(f"chain of {n} four-bars, group of {GROUP}", four_bars(n), GROUP, GROUP) for n in NUMBERS}
for title, count, kind, size in (
    ("slider-cranks", 500, "slider_crank", 6),
    ("five-bars", 500, "five_bar", True),
    ("six-link chains", 1000, "links", 6),
    ("one slider-crank", 1, "slider_crank", 6),
    ("chains of 40 four-bars", GROUP, "four_bars", 40),
):
    name = f"assembly-{title.replace(' ', '-')}"
    TASKS[name] = Task(f"assembly of {title}, {TIMES} times", assembly(kind, size), count, count)


def serve() -> None:
    """Run requested tasks by name in the process of a version."""
    prepared: dict[str, Callable[[], Any]] = {}
    warnings.simplefilter("ignore")
    out, sys.stdout = sys.stdout, sys.stderr
    for line in sys.stdin:
        name, count = json.loads(line)
        try:
            if name not in prepared:
                prepared[name] = TASKS[name].ready(count)
                prepared[name]()
            answer: Any = spent(prepared[name])
        except Exception as exception:  # prints a failure of one version; the others run
            answer = f"{type(exception).__name__}: {exception}"
        print(json.dumps(answer), file=out, flush=True)


class Version:
    """A process that runs a version."""

    def __init__(self, root: Path, cache: str) -> None:
        path = os.pathsep.join([str(root), str(root / "plugins")])
        environment = dict(os.environ, PYTHONPATH=path, UQMBD_CACHE=cache)
        self.process = subprocess.Popen(
            [sys.executable, __file__, "--serve"],
            env=environment,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )

    def run(self, name: str, count: int) -> float:
        """Return the processor seconds of a task, or NaN if it fails; the error is printed."""
        assert self.process.stdin is not None and self.process.stdout is not None
        print(json.dumps([name, count]), file=self.process.stdin, flush=True)
        answer = json.loads(self.process.stdout.readline())
        if isinstance(answer, str):
            print(f"{name}: {answer}", file=sys.stderr)
            return float("nan")
        return float(answer)


@contextmanager
def versions(*roots: Path) -> Iterator[list[Version]]:
    """Start a process for each work tree."""
    with tempfile.TemporaryDirectory() as folder:
        running = [Version(root, str(Path(folder, str(k)))) for k, root in enumerate(roots)]
        try:
            yield running
        finally:
            for version in running:
                version.process.communicate()


def measured(earlier: Path, names: Sequence[str], repeat: int, quick: bool) -> dict[str, np.ndarray[Any, Any]]:
    """Return the processor seconds of each task, shape (2, repeat): earlier, now."""
    found = {name: np.zeros((2, repeat)) for name in names}
    with versions(earlier, HERE.parent.parent) as both:
        for r in range(repeat):
            for name in names:
                count = TASKS[name].few if quick else TASKS[name].count
                for k, version in enumerate(both):
                    found[name][k, r] = version.run(name, count)
    return found


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("earlier", type=Path, nargs="?", help="work tree of the earlier version")
    parser.add_argument("--repeat", type=int, default=5, help="rounds (default 5)")
    parser.add_argument("--quick", action="store_true", help="few samples, two rounds")
    parser.add_argument("--only", nargs="+", choices=TASKS, default=list(TASKS), metavar="TASK", help=", ".join(TASKS))
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        serve()
        return
    if options.earlier is None or not (options.earlier / "uqmbd").is_dir():
        parser.error("give the work tree of the earlier version")
    repeat = 2 if options.quick else options.repeat
    found = measured(options.earlier.resolve(), options.only, repeat, options.quick)
    columns = ("", "of", "earlier, ms", "now, ms", "earlier over now", "(range)")
    table = table_of(f"Processor time of a sample or a run, medians of {repeat} rounds", *columns)
    for name, seconds in found.items():
        task = TASKS[name]
        count = task.few if options.quick else task.count
        ratio = seconds[0] / seconds[1]
        before, after = (1e3 * np.median(seconds, axis=1)) / count
        cells = f"{np.median(ratio):.1f}", f"{ratio.min():.1f} to {ratio.max():.1f}"
        table.add_row(
            task.title, f"{count} {task.each}{'s' if count > 1 else ''}", f"{before:.3g}", f"{after:.3g}", *cells
        )
    console.print(table)
    chains = [n for n in NUMBERS if f"four-bars-{n}" in found]
    if len(chains) > 1:
        cost = np.array([np.median(found[f"four-bars-{n}"], axis=1) for n in chains])
        slopes = [np.polyfit(np.log(chains), np.log(column), 1)[0] for column in cost.T]
        console.print(f"Exponent of the number of four-bars: earlier {slopes[0]:.2f}, now {slopes[1]:.2f}")


if __name__ == "__main__":
    main()
