"""How the benchmarks measure: rounds in which every contender runs once, and ratios within a round."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

__all__ = ["Contender", "Timers", "console", "interleave", "matched", "show", "show_parts", "timed_callbacks"]

Array = NDArray[np.float64]

console = Console(width=160)

EQUATIONS, STEP, POINTS = "equations of motion", "projection of a step", "projection of the output times"


@dataclass
class Contender:
    """Something to be timed.

    Attributes
    ----------
    name : str
        What the table calls it.
    run : callable
        Does it once.
    against : str
        Name of the contender to which its time is compared.
    scale : float
        By how much its time is multiplied (a subset of the samples, say).
    wall : bool
        Whether wall time is compared, as for several processes; else the processor time of this process, which other
        programs on the machine disturb less.
    notes : tuple of str
        Further columns.
    """

    name: str
    run: Callable[[], Any]
    against: str
    scale: float = 1.0
    wall: bool = False
    notes: tuple[str, ...] = ()
    cpu: list[float] = field(default_factory=list)
    clock: list[float] = field(default_factory=list)


def interleave(contenders: Sequence[Contender], repeat: int) -> None:
    """Run every contender once in each round, after one round that does not count."""
    for turn in range(repeat + 1):
        for contender in contenders:
            cpu, clock = time.process_time(), time.perf_counter()
            contender.run()
            spent = time.process_time() - cpu, time.perf_counter() - clock
            if turn:
                contender.cpu.append(spent[0] * contender.scale)
                contender.clock.append(spent[1] * contender.scale)


def matched(errors: Callable[[float], float], ladder: Sequence[float], wanted: float) -> tuple[float, float]:
    """Find the loosest tolerance whose error is at most `wanted`, and that error; the tightest if none is.

    The achieved error is not monotone in the tolerance, so a tolerance counts only if the next one holds it too.
    """
    found = [errors(x) for x in ladder]
    for k, x in enumerate(ladder):
        if max(found[k : k + 2]) <= wanted:
            return x, found[k]
    return ladder[-1], found[-1]


def show(title: str, contenders: Sequence[Contender], columns: Sequence[str] = (), unit: str = "ms") -> None:
    """Print a table of times and ratios."""
    by_name = {c.name: c for c in contenders}
    table = Table(title=title, title_justify="left")
    table.add_column("")
    for column in (f"median, {unit}", "compared with", "ratio", "(range)", *columns):
        table.add_column(column, justify="right")
    factor = {"ms": 1e3, "s": 1.0}[unit]
    for c in contenders:
        other = by_name[c.against]
        mine, theirs = (c.clock, other.clock) if c.wall else (c.cpu, other.cpu)
        ratio = np.array(mine) / np.array(theirs)
        row = [f"{factor * np.median(mine):.3g}{' wall' if c.wall else ''}"]
        if other is c:
            row += ["", "1", ""]
        else:
            row += [c.against, f"{np.median(ratio):.2f}", f"{ratio.min():.2f} to {ratio.max():.2f}"]
        table.add_row(c.name, *row, *c.notes)
    console.print(table)


@dataclass
class Timers:
    """Processor seconds and calls by part."""

    seconds: dict[str, float] = field(default_factory=dict)
    calls: dict[str, int] = field(default_factory=dict)

    def wrap(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that does the same and counts."""
        self.seconds.setdefault(name, 0.0)
        self.calls.setdefault(name, 0)

        def counted(*arguments: Any) -> Any:
            begin = time.process_time()
            result = function(*arguments)
            self.seconds[name] += time.process_time() - begin
            self.calls[name] += 1
            return result

        return counted


@contextmanager
def timed_callbacks(timers: Timers) -> Iterator[None]:
    """Time what the integrators call, and the integrators as a whole."""
    from uqmbd.dynamics.integration import batched, dop853, ida

    callbacks, solver = ida._callbacks, ida._solver
    equations, stack = dop853.BatchEquations, batched.BatchedIntegration
    originals = (equations.rate, equations.excess, dop853._projected, stack.run)

    def timed_callbacks(ensemble: Any) -> tuple[Callable[..., None], Callable[..., None]]:
        residual, jacobian = callbacks(ensemble)
        timed_r, timed_j = timers.wrap(EQUATIONS, residual), timers.wrap("Jacobian", jacobian)

        # the integrator looks at the signatures
        def new_residual(t: float, y: Array, yp: Array, res: Array) -> None:
            timed_r(t, y, yp, res)

        def new_jacobian(t: float, y: Array, yp: Array, res: Array, c: float, jac: Array) -> None:
            timed_j(t, y, yp, res, c, jac)

        return new_residual, new_jacobian

    class Solver:
        def __init__(self, *arguments: Any) -> None:
            self.inner = solver(*arguments)

        def solve(self, *arguments: Any) -> Any:
            return timers.wrap("integrator", self.inner.solve)(*arguments)

    ida._callbacks, ida._solver = timed_callbacks, Solver
    equations.rate, equations.excess = (timers.wrap(n, f) for n, f in ((EQUATIONS, originals[0]), (STEP, originals[1])))
    dop853._projected, stack.run = (
        timers.wrap(n, f) for n, f in ((POINTS, originals[2]), ("integrator", originals[3]))
    )
    try:
        yield
    finally:
        ida._callbacks, ida._solver = callbacks, solver
        equations.rate, equations.excess, dop853._projected, stack.run = originals


def show_parts(title: str, timers: Timers, total: float, before: str, after: str) -> None:
    """Print where the time goes.

    Parameters
    ----------
    title : str
        Of the table.
    timers : Timers
        With the parts that `timed_callbacks` times, `before` and `after`.
    total : float
        Processor seconds of everything.
    before, after : str
        Parts before and after the integration.
    """
    seconds = {name: x for name, x in timers.seconds.items() if timers.calls[name]}
    inner = [name for name in (EQUATIONS, "Jacobian", STEP) if name in seconds]
    parts = {before: seconds[before]} | {name: seconds[name] for name in inner}
    parts["the integrator itself, its linear algebra and wrapper"] = seconds["integrator"] - sum(
        seconds[name] for name in inner
    )
    parts |= {name: seconds[name] for name in (POINTS, after) if name in seconds}
    parts["the rest (packing, memory)"] = total - sum(parts.values())
    table = Table(title=title, title_justify="left")
    for column in ("part", "share", "calls", "us a call"):
        table.add_column(column, justify="left" if column == "part" else "right")
    for name, spent in parts.items():
        calls = timers.calls.get(name, 0)
        table.add_row(
            name, f"{100 * spent / total:.0f} %", str(calls or ""), f"{1e6 * spent / calls:.1f}" if calls else ""
        )
    console.print(table)
