"""Progress of derivations, which take minutes for mechanisms of hundreds of bodies."""

from __future__ import annotations

import logging
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from uqmbd.cli.terminal.progress import Staged
from uqmbd.logs import derivation

__all__ = ["shown_derivation"]

SOON = 2.0
"""Minimum duration of work before it is shown, s; the derivation of most mechanisms is shorter."""


COUNTED = re.compile(r"(.+): (\d+) of (\d+)")
"""Message with the number of finished parts."""


@contextmanager
def shown_derivation(progress: Staged, clock: Callable[[], float] = time.monotonic) -> Iterator[None]:
    """Show the progress of derivations from their logger within the context.

    `progress` is the display; `clock` returns the time, s.
    """
    if derivation.isEnabledFor(logging.DEBUG):  # the caller already receives these records
        yield
        return
    shown = _ProgressHandler(progress, clock)
    before = derivation.level, derivation.propagate
    derivation.addHandler(shown)
    derivation.setLevel(logging.DEBUG)
    derivation.propagate = False
    try:
        yield
    finally:
        derivation.removeHandler(shown)
        derivation.setLevel(before[0])
        derivation.propagate = before[1]
        shown.end()


class _ProgressHandler(logging.Handler):
    """Handler that shows records with a label and two numbers as a progress bar."""

    def __init__(self, progress: Staged, clock: Callable[[], float]) -> None:
        super().__init__()
        self.progress = progress
        self.clock = clock
        self.label = ""
        self.begun = clock()
        self.shown: int | None = None
        self.slow = False

    def emit(self, record: logging.LogRecord) -> None:
        """Show or advance a bar for slow work; show messages without numbers only after slow work."""
        found = COUNTED.fullmatch(record.getMessage())
        if found is None:
            self.end()
            if self.slow:
                self.progress.stage(record.getMessage())
            return
        label, done, total = found[1], int(found[2]), int(found[3])
        if label != self.label:
            self.end()
            self.label, self.begun = label, self.clock()
        if self.shown is None and self.clock() - self.begun >= SOON:
            self.progress.start(label, total)
            self.shown, self.slow = 0, True
        if self.shown is not None:
            self.progress.advance(label, done - self.shown)
            self.shown = done
        if done == total:
            self.end()

    def end(self) -> None:
        """Close the bar."""
        if self.shown is not None:
            self.progress.finish(self.label)
        self.label, self.shown = "", None
