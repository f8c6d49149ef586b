"""Progress of long work: a bar with the time left on a terminal, a line now and then anywhere else."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TextIO

from uqmbd.propagation import Lines, Progress

if TYPE_CHECKING:
    from rich.progress import Progress as RichBars
    from rich.progress import TaskID

__all__ = ["Bars", "Lines", "Progress", "shown_progress"]


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
        """Add a bar; one that has not ended grows."""
        if label in self.tasks:
            known = next(task for task in self.bars.tasks if task.id == self.tasks[label])
            if known.stop_time is None:
                self.bars.update(known.id, total=(known.total or 0) + total)
            else:
                self.bars.reset(known.id, total=total)
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
