"""How the cost grows with a mechanism: a chain of N four-bars.

N + 1 cranks of 1 m are hinged to the ground, 1 m apart, and N couplers join their neighbouring tips; all are uniform
rods of 1 kg.  From hanging at rest they are set swinging with 3 rad/s, to 50 degrees or so: the pose in which all rods
are in line, where the chain is singular, is not reached.  All cranks swing alike, so that one equation gives the exact
motion: ``((N + 1) / 3 + N) phi'' = -((N + 1) / 2 + N) g cos(phi)``.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/growth.py [--repeat 5] [--quick]``.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

# what is measured here is parts of the core, so the core is imported directly
os.environ.setdefault("OMP_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE)]

import numpy as np
from measure import console
from numpy.typing import NDArray
from rich.table import Table
from scipy.integrate import solve_ivp

import uqmbd
from uqmbd.dynamics import Ensemble, Model, build, integrate
from uqmbd.dynamics.equations import state_arguments
from uqmbd.dynamics.linear import elimination, index1, system, unrolled
from uqmbd.dynamics.linear.system import index1_system
from uqmbd_joints import Revolute

Array = NDArray[np.float64]

NUMBERS = (1, 2, 5, 10, 20, 40)
GRAVITY, SPEED, START, END = 9.81, 3.0, -np.pi / 2, 2.0
STACK = 64
LONGEST_PLAN = 200
"""Unknowns up to which the elimination in one piece is tried: its order alone takes seconds beyond."""


def chain(number: int) -> uqmbd.Mechanism:
    """Make a chain of four-bars; its output is the horizontal position of the first crank's tip."""
    mechanism = uqmbd.Mechanism(f"chain_{number}", uqmbd.Planar(gravity=(0.0, -GRAVITY)))
    rod: dict[str, Any] = {"mass": 1.0, "inertia": 1 / 12}
    x, y = np.cos(START), np.sin(START)
    cranks = []
    for k in range(number + 1):
        speed = {} if k else {"angular_velocity": SPEED}
        cranks.append(mechanism.body(f"crank{k}", **rod, position=(k + x / 2, y / 2), angle=START, **speed))
        mechanism.add(Revolute(f"bearing{k}", mechanism.ground, cranks[k], point_i=(k, 0), point_j=(-0.5, 0)))
    for k in range(number):
        coupler = mechanism.body(f"coupler{k}", **rod, position=(k + x + 0.5, y), angle=0.0)
        mechanism.add(Revolute(f"left{k}", cranks[k], coupler, point_i=(0.5, 0), point_j=(-0.5, 0)))
        mechanism.add(Revolute(f"right{k}", cranks[k + 1], coupler, point_i=(0.5, 0), point_j=(0.5, 0)))
    mechanism.output("tip", cranks[0].point((0.5, 0))[0], units="m")
    return mechanism


def exact(number: int, times: Array) -> Array:
    """Horizontal position of a crank's tip, from the equation of the only degree of freedom."""
    inertia, weight = (number + 1) / 3 + number, ((number + 1) / 2 + number) * GRAVITY

    def rate(_: float, z: Array) -> list[float]:
        return [z[1], -weight / inertia * np.cos(z[0])]

    found = solve_ivp(rate, (times[0], times[-1]), [START, SPEED], "DOP853", times, rtol=1e-12, atol=1e-12)
    return np.asarray(np.cos(found.y[0]))


def build_seconds(number: int) -> tuple[float, float]:
    """Wall seconds to make the model in fresh processes: with nothing cached, and from the cache."""
    script = (
        f"import sys, time; sys.path[:0] = {sys.path[:1]!r}; import growth, symengine, scipy.linalg; "
        f"m = growth.chain({number}); t = time.perf_counter(); growth.build(m); print(time.perf_counter() - t)"
    )
    with tempfile.TemporaryDirectory() as folder:
        environment = dict(os.environ, UQMBD_CACHE=folder)

        def seconds() -> float:
            done = subprocess.run(
                [sys.executable, "-W", "ignore", "-c", script],
                env=environment,
                capture_output=True,
                text=True,
                check=True,
            )
            return float(done.stdout)

        return seconds(), seconds()


def exponent(numbers: tuple[int, ...], cost: Array) -> float:
    """Slope of the cost over the number of four-bars, both logarithmic: a fit to all of them."""
    return float(np.polyfit(np.log(numbers), np.log(cost), 1)[0])


def spent(run: Callable[[], Any]) -> float:
    """Processor seconds of a run."""
    begin = time.process_time()
    run()
    return time.process_time() - begin


def kind(model: Model) -> str:
    """How the index-1 system is solved."""
    found = model.system
    if found.fronts is not None:
        return f"blocks, {found.fronts.operations}"
    if found.solve is None:
        return "factorised"
    pattern = (found.rows, found.columns, found.source, found.motion[None, :])
    operations, _ = unrolled.eliminated(found.elimination, *pattern, found.solve.given, found.size)
    return f"one piece, {len(operations)}"


def table_of(title: str, columns: tuple[str, ...]) -> Table:
    """Make an empty table."""
    table = Table(title=title, title_justify="left")
    for column in columns:
        table.add_column(column, justify="right")
    return table


def runs(numbers: tuple[int, ...], repeat: int) -> None:
    """Print sizes, times, counts and errors of all chains."""
    times = np.linspace(0, END, 201)
    builds = np.array([build_seconds(n) for n in numbers])
    models = [build(chain(n)) for n in numbers]
    singles, stacks = ([Ensemble(m, np.zeros((count, 0))) for m in models] for count in (1, STACK))
    cost = np.zeros((3, repeat + 1, len(numbers)))
    found: dict[str, list[Any]] = {"auto": [], "ida": []}
    for r in range(repeat + 1):  # the first round does not count
        for k, ensemble in enumerate(singles):

            def whole(ensemble: Ensemble = ensemble) -> None:
                fresh = Ensemble(ensemble.model, ensemble.values)
                fresh.outputs(times, integrate(fresh, times, 1e-6).states)

            cost[0, r, k] = spent(whole)
            cost[1, r, k] = spent(lambda e=ensemble: integrate(e, times, 1e-6, method="ida"))
            cost[2, r, k] = spent(lambda k=k: integrate(stacks[k], times, 1e-6)) / STACK
            if not r:
                for method, results in found.items():
                    results.append(integrate(ensemble, times, 1e-6, method=method))
    cost = cost[:, 1:] / END
    first = ("N", "unknowns", "index-1 system", "elimination, operations", "build, s", "from the cache", "steps")
    counts = table_of(
        "Chains of N four-bars", (*first, "evaluations", "residuals, Jacobians by IDA", "error", "energy")
    )
    columns = (
        "N",
        "one",
        "over N = 1 (range)",
        "one by IDA",
        "over N = 1 (range)",
        f"of {STACK}",
        "over N = 1 (range)",
    )
    clock = table_of(f"CPU ms per simulated second, tolerance 1e-6, {repeat} rounds", columns)
    for k, n in enumerate(numbers):
        model, explicit, implicit = models[k], found["auto"][k], found["ida"][k]
        error = np.abs(singles[k].outputs(times, explicit.states)[0, 0] - exact(n, times)).max()
        kinetic, potential = singles[k].energies(times, explicit.states)[0]
        drift = np.abs(kinetic + potential - kinetic[0] - potential[0]).max() / kinetic[0]
        counts.add_row(
            str(n),
            str(model.layout.unknowns),
            str(model.system.size),
            kind(model),
            *(f"{x:.2f}" for x in builds[k]),
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
    middle = np.median(cost, axis=1)
    parts = {
        "one realisation": middle[0],
        "by IDA": middle[1],
        f"a stack of {STACK}": middle[2],
        "build": builds[:, 0],
        "build from the cache": builds[:, 1],
    }
    large = tuple(n for n in numbers if n >= 10)
    for name, values in parts.items():
        text = f"{name}: N^{exponent(numbers, values):.2f}"
        if len(large) > 1:
            text += f", from N = 10 on N^{exponent(large, values[-len(large) :]):.2f}"
        console.print(text)


def best(run: Callable[[], Any], count: int = 20) -> float:
    """Least processor time of a call, in microseconds."""
    run()
    return 1e6 * min(spent(run) for _ in range(count))


def routes(numbers: tuple[int, ...]) -> None:
    """Print what a solution of the index-1 system costs on each route."""
    columns = ("N", "unknowns", "one piece", "made in, s", "blocks", "made in, s", "SuperLU", "LAPACK")
    table = table_of(f"One solution of the index-1 system, us (in a stack of {STACK})", columns)
    for n in numbers:
        model = build(chain(n))
        motion = model.system.motion[None, :]
        bare = index1_system(model, None)
        pattern, size = (bare.rows, bare.columns, bare.source), bare.size
        start = Ensemble(model, np.zeros((1, 0))).start
        block = Ensemble(model, np.zeros((STACK, 0))).block
        state = state_arguments(0.0, start.state).repeat(STACK, axis=0)
        values = model.evaluators["acceleration"](state, block)
        # as in a build: the pose, and another one near it
        state[1] += np.random.default_rng(0).uniform(0.1, 0.3, state.shape[1])
        typical = model.evaluators["acceleration"](state[:2], block[:2])

        def one_piece(
            bare: Any = bare, pattern: Any = pattern, typical: Array = typical, motion: Any = motion, size: int = size
        ) -> Any:
            order = elimination.plan(*pattern[:2], bare.matrix(typical))
            return unrolled.unroll(order, *pattern, motion, typical.shape[1], size)

        def blocks(model: Model = model, bare: Any = bare, typical: Array = typical) -> Any:
            return system._by_blocks(model, bare, typical).solve

        row = [str(n), str(size)]
        for make in (one_piece, blocks):
            if make is one_piece and size > LONGEST_PLAN:
                row += ["", ""]
                continue
            with tempfile.TemporaryDirectory() as folder, cache_in(folder):
                begin = time.perf_counter()
                code = make()
                seconds = time.perf_counter() - begin
            one, many = (best(lambda v=values[:k], c=code: c(v)) / k for k in (1, STACK))
            row += [f"{one:.0f} ({many:.1f})", f"{seconds:.2f}"]
        single = values[:1]
        right = bare.right(single)
        row.append(f"{best(lambda b=bare, v=single, r=right: b.pattern.factorise(v).solve(r)):.0f}")
        row.append(f"{best(lambda b=bare, v=single, r=right: index1._lapack(b.matrix(v), r), 3):.0f}")
        table.add_row(*row)
    console.print(table)


@contextmanager
def cache_in(folder: str) -> Iterator[None]:
    """Compile as if nothing were cached."""
    before = os.environ.get("UQMBD_CACHE")
    os.environ["UQMBD_CACHE"] = folder
    try:
        yield
    finally:
        del os.environ["UQMBD_CACHE"]
        if before is not None:
            os.environ["UQMBD_CACHE"] = before


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=5, help="rounds that count (default 5)")
    parser.add_argument("--quick", action="store_true", help="to ten four-bars only, two rounds")
    options = parser.parse_args()
    numbers = NUMBERS[:4] if options.quick else NUMBERS
    runs(numbers, 2 if options.quick else options.repeat)
    routes(numbers)


if __name__ == "__main__":
    main()
