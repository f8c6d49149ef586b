"""Progress of long work, as the command line, scripts and notebooks show it."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from html import escape
from typing import Any, Protocol, TextIO

from uqmbd.errors import StudyError
from uqmbd.wording import format_duration

__all__ = ["Lines", "Notebook", "Progress", "Silent", "UntilTheEnd", "in_notebook", "told"]


class Progress(Protocol):
    """What a study tells of its progress."""

    def start(self, label: str, total: int) -> None:
        """Begin the work called `label`, of `total` realisations; so many more, if it has begun and not ended."""

    def advance(self, label: str, count: int = 1) -> None:
        """Report `count` more of them."""

    def finish(self, label: str) -> None:
        """End it."""


class Silent:
    """Tells nobody."""

    def start(self, label: str, total: int) -> None:
        """Say nothing."""

    def advance(self, label: str, count: int = 1) -> None:
        """Say nothing."""

    def finish(self, label: str) -> None:
        """Say nothing."""


@dataclass
class UntilTheEnd:
    """Tells of work that is done in parts of one label as of one that ends once.

    Attributes
    ----------
    told : Progress
        Whom to tell.
    begun : list of str
        Labels.

    Examples
    --------
    >>> import sys
    >>> whole = UntilTheEnd(Lines(sys.stdout, clock=lambda: 0.0))
    >>> for part in (10, 20):
    ...     whole.start("search", part)
    ...     whole.finish("search")
    search: 0 of 10
    >>> whole.end()
    search: done after 0 s
    """

    told: Progress
    begun: list[str] = field(default_factory=list)

    def start(self, label: str, total: int) -> None:
        """Say that it begins, or that it goes on."""
        if label not in self.begun:
            self.begun.append(label)
        self.told.start(label, total)

    def advance(self, label: str, count: int = 1) -> None:
        """Pass it on."""
        self.told.advance(label, count)

    def finish(self, label: str) -> None:
        """Wait: another part may follow."""

    def end(self) -> None:
        """Say that all of it is done."""
        for label in self.begun:
            self.told.finish(label)
        self.begun.clear()


def told(progress: Progress | bool | None) -> Progress:
    """Return whom to tell: somebody, everybody (True), nobody (False), or who runs a notebook (None).

    Examples
    --------
    >>> type(told(None)).__name__, type(told(True)).__name__, type(told(False)).__name__
    ('Silent', 'Lines', 'Silent')
    """
    if progress is None or isinstance(progress, bool):
        if progress is not False and in_notebook():
            return Notebook()
        return Lines(sys.stderr) if progress else Silent()
    if not all(callable(getattr(progress, name, None)) for name in ("start", "advance", "finish")):
        raise StudyError(
            f"progress is {progress!r}; expected True, False, None, or an object with the methods of uqmbd.Progress."
        )
    return progress


def in_notebook() -> bool:
    """Tell whether this is a notebook: an IPython with a kernel, not one on a terminal."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return getattr(shell, "kernel", None) is not None


@dataclass
class _Work:
    total: int
    begin: float
    last: float
    done: int = 0
    ended: bool = False


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
        """Write that it begins; work that goes on grows without a line."""
        if label in self.works:
            self.works[label].total += total
            return
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
        ending = f", about {format_duration(left, rough=True)} left" if left is not None else ""
        self._write(f"{label}: {work.done} of {work.total}{percent} after {format_duration(spent, rough=True)}{ending}")

    def finish(self, label: str) -> None:
        """Write that it is done."""
        if (work := self.works.pop(label, None)) is not None:
            self._write(f"{label}: done after {format_duration(self.clock() - work.begin, rough=True)}")

    def _write(self, text: str) -> None:
        print(text, file=self.stream, flush=True)


@dataclass
class Notebook:
    """A bar for each label in the output of a notebook's cell, which changes in place.

    Attributes
    ----------
    interval : float
        Least time between two changes, s.
    clock : callable
        Time, s.
    """

    interval: float = 0.2
    clock: Callable[[], float] = time.monotonic
    works: dict[str, _Work] = field(default_factory=dict)
    handles: dict[str, Any] = field(default_factory=dict)

    def start(self, label: str, total: int) -> None:
        """Show a bar; one that has not ended grows, one that has starts again."""
        now = self.clock()
        if (work := self.works.get(label)) is not None and not work.ended:
            work.total += total
            return
        self.works[label] = _Work(total, begin=now, last=now)
        if label in self.handles:
            self._show(label)
        else:
            from IPython.display import HTML, display

            self.handles[label] = display(HTML(self._html(label)), display_id=True)

    def advance(self, label: str, count: int = 1) -> None:
        """Move the bar."""
        work = self.works.get(label)
        if work is None:
            return
        work.done += count
        if self.clock() - work.last >= self.interval:
            work.last = self.clock()
            self._show(label)

    def finish(self, label: str) -> None:
        """Fill the bar and say how long it took."""
        if label in self.works:
            self.works[label].done = max(self.works[label].done, self.works[label].total)
            self.works[label].ended = True
            self._show(label)

    def _show(self, label: str) -> None:
        from IPython.display import HTML

        if self.handles.get(label) is not None:
            self.handles[label].update(HTML(self._html(label)))

    def _html(self, label: str) -> str:
        work = self.works[label]
        spent = format_duration(self.clock() - work.begin, rough=True)
        total = max(work.total, 1)
        return (
            f"<div>{escape(label)} <progress value='{min(work.done, total)}' max='{total}'></progress> "
            f"{work.done} of {work.total}, {spent}</div>"
        )
