"""Progress as plain lines, for log files, pipes and terminals without cursor control."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TextIO

from uqmbd.progress.board import Board, State, TaskProgress
from uqmbd.wording import format_count, format_duration

__all__ = ["Lines"]

SOON, LATER = 1.8, 0.1
"""Minimum time between two lines, s, and its minimum ratio to the elapsed time of the task.  So a short run has
frequent lines, and a run of a day has about a hundred lines."""


@dataclass
class Lines:
    """Progress as lines of text: a line at the start of a task, some lines during the task, and a line at its end."""

    stream: TextIO
    clock: Callable[[], float] = time.monotonic  # time, s
    board: Board = field(default_factory=Board)
    last: float = 0.0

    def expect(self, totals: Mapping[str, int | None]) -> None:
        """Write the number of methods and their total number of realisations."""
        self.board.expect(totals)
        if len(totals) > 1:
            counts = "" if None in totals.values() else f", {self.board.whole().count(realisations=True)}"
            self._write(f"{format_count(len(totals), 'method')}{counts}")

    def stage(self, text: str) -> None:
        """Write the label of a task that begins."""
        self.last = self.clock()
        self.board.stage(text, self.last)
        self._write(f"{text} ...")

    def beat(self) -> None:
        """Write the progress of a task without reports, if the last line is old enough."""
        now = self.clock()
        for label, work in reversed(list(self.board.works.items())):
            if work.state == "running":
                if now - self.last >= max(SOON, LATER * (now - work.begin)):
                    self._print_progress(label, work, now)
                return

    def start(self, label: str, total: int) -> None:
        """Write the start of a task; write nothing if a running task grows."""
        known = self.board.works.get(label)
        going = known is not None and known.state == "running"
        now = known.begin if going and known is not None else self.clock()
        work = self.board.begun(label, total, now)
        if not going:
            self.last = now
            self.board.settle(now)
            self._write(f"{label}: {work.count()}{self._place(label)}")

    def advance(self, label: str, count: int = 1) -> None:
        """Count realisations, and write the progress if the last line is old enough."""
        work = self.board.works.get(label)
        if work is None or work.state != "running":
            return
        work.done += count
        now = self.clock()
        if now - self.last >= max(SOON, LATER * (now - work.begin)):
            self._print_progress(label, work, now)

    def _print_progress(self, label: str, work: TaskProgress, now: float) -> None:
        self.last = now
        spent = format_duration(now - work.begin, rough=True)
        if label in self.board.stages:
            self._write(f"{label} ... {spent}")
            return
        if work.total and work.done >= work.total and not work.at_most:
            self._write(f"{label}: {work.count()}, evaluating ... {spent}")
            return
        left = work.left(now)
        percent = f" ({100 * work.share:.0f} %)" if work.total and not work.at_most else ""
        ending = f", about {format_duration(left, rough=True)} left" if left is not None else ""
        self._write(f"{label}: {work.count()}{percent} after {spent}{ending}")

    def cost(self, label: str, seconds: float) -> None:
        """Record the wall time for the last line, s."""
        self.board.costs(label, seconds)

    def finish(self, label: str) -> None:
        """Write the end of a task."""
        self._end(label, "done")

    def fail(self, label: str) -> None:
        """Write the failure of a task."""
        self._end(label, "failed")

    def close(self) -> None:
        """Write nothing, because each line is complete."""

    def _end(self, label: str, state: State) -> None:
        work: TaskProgress | None = self.board.works.get(label)
        if work is None or work.state not in ("running", "waiting"):
            return
        begun = work.state == "running"
        now = self.clock() if begun else work.begin
        after = f" after {format_duration(work.spent(now), rough=True)}" if begun else ""
        text = f" ({work.done})" if begun and work.at_most else ""
        self.board.ended(label, state, now)
        self._write(f"{label}: {state}{after}{text}")

    def _place(self, label: str) -> str:
        expected = self.board.expected
        return f", method {expected.index(label) + 1} of {len(expected)}" if label in expected[1:] else ""

    def _write(self, text: str) -> None:
        # write the complete line by one call, because two threads may write
        self.stream.write(f"{text}\n")
        self.stream.flush()
