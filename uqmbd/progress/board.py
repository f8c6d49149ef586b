"""Numbers of all reported tasks, and their table in terminals and notebooks."""

from __future__ import annotations

import operator
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from uqmbd.errors import StudyError
from uqmbd.wording import format_duration

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["AtMost", "Board", "State", "TaskProgress"]

State = Literal["waiting", "running", "done", "failed", "stopped"]

NARROW = 72
"""Minimum number of columns of a terminal with bars."""
NAME, SHORT = 26, 17
"""Maximum number of characters of a label, and with few columns; the middle of a longer label is removed."""
_STYLES = {"waiting": "dim", "running": "", "done": "green", "failed": "bold red", "stopped": "yellow"}


class AtMost(int):
    """Maximum of the total number of steps; the task may end with fewer steps.

    Methods that determine their number of realisations automatically report it at their start:
    ``problem.progress.start(problem.label, uqmbd.extend.AtMost(5000))``. Receivers that do not know this class treat it
    as a number.

    Examples
    --------
    >>> import sys
    >>> from uqmbd.progress import Lines
    >>> lines = Lines(sys.stdout, clock=lambda: 0.0)
    >>> lines.start("adaptive", AtMost(5000))
    adaptive: 0 of at most 5000
    >>> lines.advance("adaptive", 1531)
    >>> lines.finish("adaptive")
    adaptive: done after 0 s (1531)
    """

    __slots__ = ()

    def __new__(cls, most: int) -> AtMost:
        """Check the argument."""
        try:
            return super().__new__(cls, operator.index(most))
        except TypeError:
            raise StudyError(f"AtMost: the total is {most!r}; expected a whole number.") from None


@dataclass
class TaskProgress:
    """Progress of one task."""

    total: int | None = None  # number of steps; None: unknown
    at_most: bool = False  # whether the task may end with fewer steps
    done: int = 0  # completed steps
    begun: int = 0  # steps of all parts that have begun
    state: State = "waiting"
    begin: float = 0.0  # start time, s
    end: float = 0.0  # end time, s
    cost: float | None = None  # wall time in the results, s

    @property
    def share(self) -> float:
        """Return the completed share, from 0 to 1."""
        if self.state == "done":
            return 1.0
        return min(self.done / self.total, 1.0) if self.total else 0.0

    def count(self, *, realisations: bool = False) -> str:
        """Return completed and total steps as text; with `realisations`, return the number of realisations."""
        if self.total is None:
            return f"{self.done}" if self.done else ""
        if realisations:
            return f"{'at most ' if self.at_most else ''}{self.total} realisation{'s' * (self.total != 1)}"
        if self.state == "done":
            return f"{self.done or self.total}"
        if self.state == "waiting":
            return f"{'at most ' if self.at_most else ''}{self.total}"
        return f"{self.done} of {'at most ' if self.at_most else ''}{self.total}"

    def left(self, now: float) -> float | None:
        """Return the remaining time at the present rate, s; None if it is unknown."""
        if self.state != "running" or self.at_most or not self.total or not self.done or self.done >= self.total:
            return None  # the time of operations after the last realisation is unknown
        return (now - self.begin) / self.done * (self.total - self.done)

    def spent(self, now: float) -> float:
        """Return the time since the start, or the wall time in the results, s."""
        if self.cost is not None:
            return self.cost
        return (now if self.state == "running" else self.end) - self.begin

    def clock(self, now: float) -> str:
        """Return the elapsed time as text."""
        if self.state == "waiting":
            return "waiting"
        if self.state == "failed" and self.end == self.begin:
            return "failed"
        spent = format_duration(self.spent(now), rough=True)
        if self.state != "running":
            return spent if self.state == "done" else f"{self.state}, {spent}"
        left = self.left(now)
        return spent if left is None else f"{spent}, {format_duration(left, rough=True)} left"


@dataclass
class Board:
    """All tasks, in the order of their announcement."""

    works: dict[str, TaskProgress] = field(default_factory=dict)  # by label
    stages: set[str] = field(default_factory=set)  # labels of tasks without a number of steps
    expected: list[str] = field(default_factory=list)  # labels of the announced methods

    def expect(self, totals: Mapping[str, int | None]) -> None:
        """Announce methods."""
        self.expected = list(totals)
        for label, total in totals.items():
            self.works[label] = TaskProgress(total, isinstance(total, AtMost))

    def stage(self, label: str, now: float) -> None:
        """Begin a task without a number of steps, and end the previous task of this kind."""
        self.settle(now)
        self.stages.add(label)
        self.works[label] = TaskProgress(state="running", begin=now)

    def settle(self, now: float) -> None:
        """End tasks without a number of steps."""
        for label in tuple(self.stages):
            self.ended(label, "done", now)

    def begun(self, label: str, total: int, now: float) -> TaskProgress:
        """Begin a task or a part of it; the total only grows beyond its announced value, and ended tasks restart."""
        work = self.works.get(label)
        if work is None or work.state not in ("running", "waiting"):
            work = self.works[label] = TaskProgress()
        if work.state == "waiting":
            work.state, work.begin = "running", now
        work.begun += total
        # the task may now reduce its announced maximum
        smaller = work.at_most and work.begun == total and isinstance(total, AtMost)
        work.total = int(total) if smaller else max(work.total or 0, work.begun)
        work.at_most = work.at_most or isinstance(total, AtMost)
        return work

    def moved(self, label: str, count: int) -> None:
        """Count steps; ignore steps of unknown tasks."""
        if label in self.works:
            self.works[label].done += count

    def costs(self, label: str, seconds: float) -> None:
        """Record the wall time in the results, s; ignore unknown tasks."""
        if label in self.works:
            self.works[label].cost = seconds

    def ended(self, label: str, state: State, now: float) -> None:
        """End a task."""
        work = self.works.get(label)
        if work is not None and (work.state == "running" or (work.state == "waiting" and state == "failed")):
            work.begin = now if work.state == "waiting" else work.begin
            work.state, work.end = state, now

    def stop(self, now: float) -> None:
        """End all running tasks early."""
        for label in tuple(self.works):
            self.ended(label, "stopped", now)

    def whole(self) -> TaskProgress:
        """Return all announced methods as one task."""
        parts = [self.works[label] for label in self.expected]
        ended = [part.state in ("done", "failed") for part in parts]
        begun = [part.begin for part in parts if part.state != "waiting"]
        if self.counts_methods:
            found = TaskProgress(len(parts), done=sum(ended))
        else:
            # the total of an ended task is the number of its completed steps
            early = [part.state == "failed" or (part.state == "done" and part.done > 0) for part in parts]
            totals = [part.done if end else part.total or 0 for part, end in zip(parts, early, strict=True)]
            steps = [total if end else part.done for total, part, end in zip(totals, parts, ended, strict=True)]
            at_most = any(part.at_most and not end for part, end in zip(parts, ended, strict=True))
            found = TaskProgress(sum(totals), at_most, done=sum(steps))
        found.begin, found.end = min(begun, default=0.0), max((p.end for p in parts), default=0.0)
        over: State = "failed" if any(part.state == "failed" for part in parts) else "done"
        found.state = over if all(ended) else "running" if begun else "waiting"
        if any(part.state == "stopped" for part in parts):
            found.state = "stopped"
        return found

    @property
    def counts_methods(self) -> bool:
        """Return whether methods are counted, because their number of realisations is unknown."""
        return any(self.works[one].total is None and self.works[one].state != "failed" for one in self.expected)

    def table(self, now: float, width: int) -> Table:
        """Return a table of rich with all tasks, for a terminal with `width` columns."""
        from rich.table import Table

        made = Table.grid(padding=(0, 2, 0, 0))
        made.add_column(no_wrap=True, overflow="ellipsis")
        if width >= NARROW:
            made.add_column(width=min(30, width - NAME - 42))
        made.add_column(no_wrap=True, justify="right", overflow="ellipsis")
        made.add_column(no_wrap=True, overflow="ellipsis")
        last = self.expected[-1] if len(self.expected) > 1 else None
        # copy the list, because one thread draws while another thread adds tasks
        for label, work in list(self.works.items()):
            self._add(made, label, work, now, width)
            if label == last:
                self._add(made, "methods" if self.counts_methods else "all methods", self.whole(), now, width)
        return made

    def _add(self, table: Table, label: str, work: TaskProgress, now: float, width: int) -> None:
        from rich.progress_bar import ProgressBar
        from rich.text import Text

        style = _STYLES[work.state]
        bar: Text | ProgressBar = Text("")
        if label not in self.stages:
            known = work.total or (1 if work.state == "done" else None)
            going = work.state == "running" and not known
            bar = ProgressBar(total=1.0, completed=work.share, pulse=going, animation_time=now)
        name = Text(_cut(label, NAME if width >= NARROW else SHORT), style=style)
        table.add_row(name, *([bar] if width >= NARROW else []), Text(work.count()), Text(work.clock(now), style=style))


def _cut(label: str, most: int) -> str:
    half = most // 2
    return label if len(label) <= most else f"{label[: half - 1]}…{label[-(most - half) :]}"
