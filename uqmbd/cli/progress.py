"""Progress of long work: a bar with the time left on a terminal, a line now and then anywhere else."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol, TextIO

if TYPE_CHECKING:
    from rich.progress import Progress as RichBars
    from rich.progress import TaskID

__all__ = ["Bars", "Lines", "Progress", "shown_progress"]


class Progress(Protocol):
    """What `Study.run` tells while it works."""

    def start(self, label: str, total: int) -> None:
        """Begin something of `total` steps."""

    def advance(self, label: str, count: int = 1) -> None:
        """Say that `count` more steps are done."""

    def finish(self, label: str) -> None:
        """Say that it is done."""


@contextmanager
def shown_progress(stream: TextIO | None = None) -> Iterator[Progress]:
    """Show progress on a stream (the standard error stream by default) while the context lasts."""
    target = stream if stream is not None else sys.stderr
    if not target.isatty():
        yield Lines(target)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as RichBars

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left:"),
        TimeRemainingColumn(),
    )
    with RichBars(*columns, console=Console(file=target)) as bars:
        yield Bars(bars)


@dataclass
class Bars:
    """One bar per label, with the time left."""

    bars: RichBars
    tasks: dict[str, TaskID] = field(default_factory=dict)

    def start(self, label: str, total: int) -> None:
        """Add a bar."""
        if label in self.tasks:
            self.bars.reset(self.tasks[label], total=total)
        else:
            self.tasks[label] = self.bars.add_task(label, total=total)

    def advance(self, label: str, count: int = 1) -> None:
        """Move the bar; one that nobody started does not matter enough to stop the work."""
        if label in self.tasks:
            self.bars.advance(self.tasks[label], count)

    def finish(self, label: str) -> None:
        """Fill the bar and stop its clock."""
        task = self.tasks.get(label)
        if task is None:
            return
        total = next((known.total for known in self.bars.tasks if known.id == task), None)
        self.bars.update(task, completed=total)
        self.bars.stop_task(task)


@dataclass
class _Work:
    total: int
    begin: float
    last: float
    done: int = 0


@dataclass
class Lines:
    """A line when something begins, one per interval, and one at its end: for log files.

    Examples
    --------
    >>> import sys
    >>> seconds = iter([0.0, 4.0, 12.0, 20.0])
    >>> lines = Lines(sys.stdout, clock=lambda: next(seconds))
    >>> lines.start("monte-carlo", 100)
    monte-carlo: 0 of 100
    >>> lines.advance("monte-carlo", 20)
    >>> lines.advance("monte-carlo", 40)
    monte-carlo: 60 of 100 (60 %) after 12 s, about 8 s left
    >>> lines.finish("monte-carlo")
    monte-carlo: done after 20 s
    """

    stream: TextIO
    interval: float = 10.0
    clock: Callable[[], float] = time.monotonic
    works: dict[str, _Work] = field(default_factory=dict)

    def start(self, label: str, total: int) -> None:
        """Write that it begins."""
        now = self.clock()
        self.works[label] = _Work(total, begin=now, last=now)
        self._write(f"{label}: 0 of {total}")

    def advance(self, label: str, count: int = 1) -> None:
        """Write how far it is, if the last line is old enough."""
        work = self.works.get(label)
        if work is None:
            return
        work.done += count
        now = self.clock()
        if now - work.last < self.interval:
            return
        work.last = now
        spent = now - work.begin
        left = spent / work.done * max(work.total - work.done, 0) if work.done else None
        percent = f" ({100 * work.done / work.total:.0f} %)" if work.total else ""
        ending = f", about {seconds(left)} left" if left is not None else ""
        self._write(f"{label}: {work.done} of {work.total}{percent} after {seconds(spent)}{ending}")

    def finish(self, label: str) -> None:
        """Write that it is done."""
        if label in self.works:
            self._write(f"{label}: done after {seconds(self.clock() - self.works[label].begin)}")

    def _write(self, text: str) -> None:
        print(text, file=self.stream, flush=True)


def seconds(value: float) -> str:
    """Write a duration as one would say it.

    >>> [seconds(value) for value in (0.123, 4.21, 75, 7320)]
    ['0.1 s', '4.2 s', '1 min 15 s', '2 h 2 min']
    """
    if value < 60:
        return f"{value:.0f} s" if value >= 10 or value == int(value) else f"{value:.1f} s"
    minutes, rest = divmod(round(value), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    return f"{minutes // 60} h {minutes % 60} min"
