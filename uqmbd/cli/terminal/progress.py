"""Progress of a command: a live table on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol, TextIO

from uqmbd.progress import Board, Lines, Progress

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult
    from rich.live import Live

__all__ = ["Screen", "Staged", "plain_progress", "shown_progress"]

PICTURES = 8
"""Frames per second."""
BEAT = 0.2
"""Time between two checks for a due line, s."""


class Staged(Progress, Protocol):
    """Progress of a whole command."""

    def stage(self, text: str) -> None:
        """Start work without a bar."""

    def close(self) -> None:
        """Stop the display after all work."""


@contextmanager
def shown_progress(stream: TextIO | None = None) -> Iterator[Staged]:
    """Show progress on a stream (the standard error stream by default) while the context lasts."""
    target = stream if stream is not None else sys.stderr
    if not target.isatty():
        with plain_progress(target) as lines:
            yield lines
        return
    from rich.console import Console
    from rich.live import Live

    console = Console(file=target)
    if console.is_dumb_terminal:
        with plain_progress(target) as lines:
            yield lines
        return
    # other output appears above the table; a redirected standard output is not affected
    live = Live(
        console=console,
        refresh_per_second=PICTURES,
        redirect_stdout=sys.stdout.isatty(),
        vertical_overflow="crop",
    )
    screen = Screen(live)
    live.update(screen)
    with live:
        try:
            yield screen
        finally:
            screen.board.stop(screen.clock())


@contextmanager
def plain_progress(stream: TextIO) -> Iterator[Lines]:
    """Write lines of progress, also at intervals during computations without progress reports."""
    import threading

    lines = Lines(stream)
    over = threading.Event()

    def beat() -> None:
        while not over.wait(BEAT):
            lines.beat()

    thread = threading.Thread(target=beat, name="uqmbd-progress", daemon=True)
    thread.start()
    try:
        yield lines
    finally:
        over.set()
        thread.join()


@dataclass
class Screen:
    """Live table on a terminal, which rich redraws in a separate thread."""

    live: Live
    clock: Callable[[], float] = time.monotonic
    board: Board = field(default_factory=Board)

    def expect(self, totals: Mapping[str, int | None]) -> None:
        """Show all methods."""
        self.board.settle(self.clock())
        self.board.expect(totals)

    def stage(self, text: str) -> None:
        """Show the current stage."""
        self.board.stage(text, self.clock())

    def start(self, label: str, total: int) -> None:
        """Show a bar, or extend one that is still active."""
        self.board.settle(self.clock())
        self.board.begun(label, total, self.clock())

    def advance(self, label: str, count: int = 1) -> None:
        """Advance the bar."""
        self.board.moved(label, count)

    def cost(self, label: str, seconds: float) -> None:
        """Set the wall time in the row, s."""
        self.board.costs(label, seconds)

    def finish(self, label: str) -> None:
        """Fill the bar and stop its clock."""
        self.board.ended(label, "done", self.clock())

    def fail(self, label: str) -> None:
        """Mark the bar as failed."""
        self.board.ended(label, "failed", self.clock())

    def close(self) -> None:
        """Stop the display and leave the table on the screen."""
        self.board.settle(self.clock())
        self.live.stop()

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Draw the table."""
        yield self.board.table(self.clock(), options.max_width)
