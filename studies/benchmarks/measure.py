"""Functions of the benchmarks for timing: rounds in which every contender runs once, and ratios within a round."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table

__all__ = ["Contender", "console", "interleave", "matched", "show", "spent", "table_of"]

Array = NDArray[np.float64]

console = Console(width=260)


@dataclass
class Contender:
    """A timed function.

    Attributes
    ----------
    name : str
        Name in the table.
    run : callable
        Function that runs once in each round.
    against : str
        Name of the contender that its time is compared with.
    scale : float
        Factor on its time, for instance for a subset of the samples.
    wall : bool
        Whether to compare wall time, as for several processes.  Otherwise the processor time of this process, which
        other programs on the machine disturb less.
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


def spent(run: Callable[[], Any], least: float = 0.1) -> float:
    """Return the processor seconds of a run, repeated for at least `least` seconds."""
    begin, runs, seconds = time.process_time(), 0, 0.0
    while seconds < least:
        run()
        runs, seconds = runs + 1, time.process_time() - begin
    return seconds / runs


def matched(errors: Callable[[float], float], ladder: Sequence[float], wanted: float) -> tuple[float, float]:
    """Find the loosest tolerance whose error is at most `wanted`, and that error; the tightest if none is.

    The achieved error is not monotone in the tolerance, so the next tolerance must also satisfy the limit.
    """
    found = [errors(x) for x in ladder]
    for k, x in enumerate(ladder):
        if max(found[k : k + 2]) <= wanted:
            return x, found[k]
    return ladder[-1], found[-1]


def show(title: str, contenders: Sequence[Contender], columns: Sequence[str] = (), unit: str = "ms") -> None:
    """Print a table of times and ratios."""
    by_name = {c.name: c for c in contenders}
    table = table_of(title, "", f"median, {unit}", "compared with", "ratio", "(range)", *columns)
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


def table_of(title: str, *columns: str) -> Table:
    """Return an empty table for Markdown whose first column contains names."""
    table = Table(title=title, title_justify="left", box=box.MARKDOWN)
    for k, column in enumerate(columns):
        table.add_column(column, justify="right" if k else "left")
    return table
