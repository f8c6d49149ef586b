"""Measure time and error of all propagation methods on the slider-crank, the Agile Eye and the motorcycle.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/propagation.py [--repeat N] [--quick] [--only STUDY]
[--summaries]``.
"""

from __future__ import annotations

import argparse
import os
import runpy
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

# this script times parts of the core (integration and outputs, without statistics), so it imports the core directly
os.environ.setdefault("OMP_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import agile_eye
import mechanisms
import motorcycle
import numpy as np
import slider_crank
import sympy
from measure import Contender, console, interleave, show, table_of
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

import uqmbd
from uqmbd.dynamics import Ensemble, integrate
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo

Array = NDArray[np.float64]

TARGETS = (0.01, 0.001)
"""Errors of the standard deviation for which the tables list the cost."""
CONVERGED = 20
"""Gauss nodes per input of the reference."""
STACK = 64
"""Realisations per stack, as in a study."""
SAMPLES = {"one by one": 8, "stacked": STACK}
"""Number of timed samples."""


@dataclass(frozen=True)
class Task:
    """A study, and the time at which the error of its standard deviations counts.

    Attributes
    ----------
    study : uqmbd.Study
        Study of the mechanism.
    at : float or None
        Time at which the error counts, relative to the standard deviation at that time.  None means the largest error
        over time, relative to the largest standard deviation.
    """

    study: uqmbd.Study
    at: float | None = None

    @cached_property
    def problem(self) -> uqmbd.extend.Problem:
        """Problem for the propagators."""
        return self.study.problem(Galerkin())

    @cached_property
    def space(self) -> uqmbd.extend.GermSpace:
        """Germ space of the inputs."""
        return uqmbd.extend.GermSpace.of(self.problem.inputs, "rosenblatt")

    @cached_property
    def reference(self) -> tuple[Array, Array, Array]:
        """Converged mean, standard deviation and kurtosis, shape (output, time)."""
        rule = uqmbd.extend.gauss_tensor(self.space, CONVERGED)
        response = self.respond(self.space.to_inputs(rule.nodes), 1e-9)[0]
        mean = np.tensordot(rule.weights, response, 1)
        variance, fourth = (np.tensordot(rule.weights, (response - mean) ** k, 1) for k in (2, 4))
        kurtosis = np.divide(fourth, variance**2, out=np.full_like(fourth, 3.0), where=variance > 1e-20)
        return mean, np.sqrt(variance), kurtosis

    def respond(self, values: Array, rtol: float | None = None, stack: int = STACK) -> tuple[Array, dict[str, Any]]:
        """Integrate realisations and compute their outputs, `stack` at a time."""
        times, found, cost = self.problem.times, [], {"accelerations": 0, "integrations": 0}
        for k in range(0, len(values), stack):
            ensemble = Ensemble(self.problem.model, values[k : k + stack])
            run = integrate(ensemble, times, rtol or self.problem.rtol)
            found.append(ensemble.outputs(times, run.states))
            cost = {name: count + getattr(run.counters, name) for name, count in cost.items()}
        return np.concatenate(found), cost

    def one(self) -> None:
        """Compute one realisation, at the means."""
        self.respond(self.problem.inputs.means[None])

    def nodes(self, order: int) -> tuple[uqmbd.extend.Quadrature, Array]:
        """Return nodes and basis values at them, the same for both expansions."""
        rule = uqmbd.extend.gauss_tensor(self.space, order + 1)
        return rule, self.space.evaluate(rule.nodes, uqmbd.extend.index_set(self.space.dimension, order, "total"))

    def galerkin(self, order: int) -> tuple[Array, dict[str, Any]]:
        """Return coefficients of the outputs, and their cost."""
        rule, basis = self.nodes(order)
        ensemble = Ensemble(self.problem.model, self.space.to_inputs(rule.nodes))
        projected = uqmbd.extend.ProjectedEnsemble(ensemble, basis, rule.weights)
        found = projected.integrate(self.problem.times, self.problem.rtol)
        response = ensemble.outputs(self.problem.times, projected.nodal(found.coefficients))
        return projected.project(response), found.counters | {"unknowns": projected.unknowns}

    def collocation(self, order: int) -> tuple[Array, dict[str, Any]]:
        """Return coefficients of the outputs from stacked realisations at the same nodes."""
        rule, basis = self.nodes(order)
        response, cost = self.respond(self.space.to_inputs(rule.nodes))
        return np.tensordot((basis * rule.weights[:, None]).T, response, 1), cost

    def errors(self, coefficients: Array) -> Array:
        """Return the error of the standard deviation of each output."""
        std = np.sqrt(np.sum(coefficients[1:] ** 2, axis=0))
        return self._judged(np.abs(std - self.reference[1]))

    def samples(self, error: float) -> Array:
        """Count the samples with which Monte Carlo's standard error of the standard deviation is `error`, by output.

        From n samples it is ``std sqrt((kurtosis - 1) / (4 n))``.
        """
        _, std, kurtosis = self.reference
        return (self._judged(std * np.sqrt((kurtosis - 1) / 4)) / error) ** 2

    def _judged(self, error: Array) -> Array:
        std = self.reference[1]
        if self.at is None:
            return np.asarray(error.max(axis=1) / std.max(axis=1))
        k = int(np.abs(self.problem.times - self.at).argmin())
        return np.asarray(error[:, k] / std[:, k])


METHODS: dict[str, Callable[[Task, int], tuple[Array, dict[str, Any]]]] = {
    "Galerkin": Task.galerkin,
    "collocation": Task.collocation,
}


def run(task: Task, orders: range, repeat: int) -> None:
    """Measure one task, and print its tables."""
    outputs = list(task.problem.model.outputs.names)
    contenders = {"one": Contender("one realisation", task.one, "")}
    draws = task.problem.inputs.from_uniform(np.random.default_rng(1).uniform(size=(STACK, len(task.problem.inputs))))
    for how, count in SAMPLES.items():
        respond = partial(task.respond, draws[:count], stack=1 if how == "one by one" else STACK)
        contenders[how] = Contender(how, respond, "", scale=1 / count)
    for method, work in METHODS.items():
        for order in orders:
            contenders[f"{method} {order}"] = Contender("", partial(work, task, order), "")
    for order in (2, 4):
        for kind in (Galerkin, Collocation):
            whole = partial(task.study.propagate, kind(order=order))
            contenders[f"{kind.__name__} {order}, study"] = Contender("", whole, "")
    interleave(list(contenders.values()), repeat)
    cpu = {name: np.array(c.cpu) for name, c in contenders.items()}
    errors = _orders(task, orders, outputs, cpu)
    _targets(task, orders, outputs, cpu, errors)
    _ratios(task, cpu)


def _orders(task: Task, orders: range, outputs: list[str], cpu: dict[str, Array]) -> dict[str, Array]:
    """Print cost and error of each order; return the errors."""
    where = "largest over time" if task.at is None else f"at t = {task.at:g} s"
    found, base = {}, cpu["one"]
    table = table_of(
        f"{task.study.name}: cost and error of the standard deviation ({where}) by order; one realisation: "
        f"{1e3 * np.median(base):.1f} ms",
        "", "nodes", "unknowns", "CPU, ms", "over one realisation", "evaluations", "steps", "iterations", *outputs,
    )  # fmt: skip
    for method, work in METHODS.items():
        for order in orders:
            name = f"{method} {order}"
            coefficients, cost = work(task, order)
            found[name] = task.errors(coefficients)
            table.add_row(
                name,
                str((order + 1) ** task.space.dimension),
                str(cost.get("unknowns", "")),
                f"{1e3 * np.median(cpu[name]):.1f}",
                f"{np.median(cpu[name] / base):.1f}",
                str(cost["accelerations"]),
                str(cost.get("steps", "")),
                str(cost.get("iterations", "")),
                *(f"{100 * e:.2g} %" for e in found[name]),
            )
    console.print(table)
    return found


def _targets(task: Task, orders: range, outputs: list[str], cpu: dict[str, Array], errors: dict[str, Array]) -> None:
    """Print the cost to reach each error of the standard deviations."""
    table = table_of(f"{task.study.name}: CPU time to an error of the standard deviation", "", *(
        f"{name}, {100 * target:g} %" for target in TARGETS for name in (*outputs, "all")
    ))  # fmt: skip
    for method in METHODS:
        cells = []
        for target in TARGETS:
            for part in [*([k] for k in range(len(outputs))), list(range(len(outputs)))]:
                # an order counts if higher orders also reach the target
                wrong = [max(errors[f"{method} {p}"][part].max() for p in orders if p >= order) for order in orders]
                order = next((p for p, e in zip(orders, wrong, strict=True) if e <= target), None)
                cells.append("-" if order is None else f"{np.median(cpu[f'{method} {order}']):.3f} s ({order})")
        table.add_row(f"{method} (order)", *cells)
    for how in SAMPLES:
        cells = []
        for target in TARGETS:
            count = task.samples(target)
            cells += [f"{n * np.median(cpu[how]):.3g} s ({n:.0f})" for n in (*count, count.max())]
        table.add_row(f"Monte Carlo {how} (samples)", *cells)
    console.print(table)


def _ratios(task: Task, cpu: dict[str, Array]) -> None:
    """Print ratios of processor times, medians over the rounds with their ranges."""
    table = table_of(f"{task.study.name}: ratios of CPU times", "", "compared with", "ratio", "(range)")

    def add(name: str, other: str, mine: Array, theirs: Array) -> None:
        ratio = mine / theirs
        table.add_row(name, other, f"{np.median(ratio):.3g}", f"{ratio.min():.3g} to {ratio.max():.3g}")

    need = task.samples(TARGETS[0])
    for order in (2, 4):
        name = f"Galerkin {order}"
        add(name, "one realisation", cpu[name], cpu["one"])
        add(name, f"collocation {order}, same nodes, same stack", cpu[name], cpu[f"collocation {order}"])
        add(
            f"{name}, with statistics, diagnostics, 8 verifications",
            "one realisation",
            cpu[f"{name}, study"],
            cpu["one"],
        )
        add("the same", f"collocation {order} likewise", cpu[f"{name}, study"], cpu[f"Collocation {order}, study"])
    for how in SAMPLES:
        add(f"500 samples {how}", "Galerkin 2, with statistics", 500 * cpu[how], cpu["Galerkin 2, study"])
        for n in (need.min(), need.max()):
            add(f"Monte Carlo {how} to 1 %: {n:.0f} samples", "Galerkin 4", n * cpu[how], cpu["Galerkin 4"])
            add("the same", "collocation 4", n * cpu[how], cpu["collocation 4"])
    console.print(table)


def inputs(counts: range, repeat: int, order: int = 2) -> None:
    """Print the cost per number of inputs."""
    tasks = {
        count: Task(uqmbd.Study("crank", mechanisms.slider_crank(count), slider_crank.study.times)) for count in counts
    }
    contenders = {}
    for count, task in tasks.items():
        contenders["one", count] = Contender("", task.one, "")
        for method, work in METHODS.items():
            contenders[method, count] = Contender("", partial(work, task, order), "")
    interleave(list(contenders.values()), repeat)
    table = table_of(
        f"Slider-crank, order {order}: cost by the number of inputs",
        "inputs", "nodes", "terms", "unknowns", "Galerkin, ms", "over one realisation", "a node", "collocation, ms",
        "Galerkin over collocation", "difference of the standard deviation",
    )  # fmt: skip
    for count, task in tasks.items():
        (a, cost), (b, _) = (work(task, order) for work in METHODS.values())
        mine, other, one = (np.array(contenders[m, count].cpu) for m in ("Galerkin", "collocation", "one"))
        std = [np.sqrt(np.sum(c[1:] ** 2, axis=0)) for c in (a, b)]
        nodes = (order + 1) ** count
        table.add_row(
            str(count),
            str(nodes),
            str(len(a)),
            str(cost["unknowns"]),
            f"{1e3 * np.median(mine):.1f}",
            f"{np.median(mine / one):.1f}",
            f"{np.median(mine / one) / nodes:.2f}",
            f"{1e3 * np.median(other):.1f}",
            f"{np.median(mine / other):.2f}",
            f"{float((np.abs(std[0] - std[1]).max(axis=1) / std[1].max(axis=1)).max()):.0e}",
        )
    console.print(table)


def summaries(samples: int, repeat: int) -> list[Contender]:
    """Compare Monte Carlo with summary outputs or requirements with the same study without them."""
    plain, found = "outputs over time", list[Contender]()

    def add(name: str, extend: Callable[[uqmbd.Mechanism, sympy.Expr], None]) -> None:
        own = runpy.run_path(str(HERE.parent / "slider_crank.py"))
        extend(own["mechanism"], own["pin"].reaction_force[0])
        method = MonteCarlo(samples=samples, seed=1)
        study = uqmbd.Study("slider_crank", own["mechanism"], own["study"].times, [method])
        found.append(Contender(name, lambda: study.propagate(method), plain))

    def four(mechanism: uqmbd.Mechanism, force: sympy.Expr) -> None:
        size = sympy.Abs(force)
        mechanism.output("largest", uqmbd.maximum(size), units="N")
        mechanism.output("when", uqmbd.time_of_maximum(size), units="s")
        mechanism.output("rms", uqmbd.root_mean_square(size), units="N")
        mechanism.output("impulse", uqmbd.integral(size), units="N s")

    add(plain, lambda *_: None)
    # this output needs the same tables as the others, and no motion between the output times
    add("with a last force", lambda m, force: m.output("last", uqmbd.final(force), units="N"))
    add("with a largest force", lambda m, force: m.output("largest", uqmbd.maximum(force), units="N"))
    add("with four summaries of its magnitude", four)
    add("with a limit on it at all times", lambda m, force: m.require("load", sympy.Abs(force) <= 1.5))
    interleave(found, repeat)
    return found


def main() -> None:
    """Measure and print."""
    import warnings

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=9, help="rounds that count (default 9)")
    parser.add_argument("--quick", action="store_true", help="orders to 4, four inputs, two rounds")
    tasks = {
        "slider_crank": Task(slider_crank.study),
        "agile_eye": Task(agile_eye.study, at=0.4),
        "motorcycle": Task(motorcycle.study),
    }
    parser.add_argument("--only", choices=tasks, help="run one study")
    parser.add_argument("--summaries", action="store_true", help="only the cost of summaries and requirements")
    options = parser.parse_args()
    repeat, most, count = (2, 4, 4) if options.quick else (options.repeat, 6, 6)
    if options.summaries:
        title = f"500 slider-cranks, {len(slider_crank.study.times)} output times, one process, {repeat} rounds"
        show(title, summaries(500, repeat))
        return
    with warnings.catch_warnings(), threadpool_limits(limits=1):
        warnings.simplefilter("ignore", UserWarning)  # the columns of errors show these warnings
        for name, task in tasks.items():
            if options.only in (None, name):
                run(task, range(1, most + 1), repeat)
        if options.only is None:
            inputs(range(2, count + 1), max(2, repeat // 3))


if __name__ == "__main__":
    main()
