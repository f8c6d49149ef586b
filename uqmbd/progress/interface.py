"""Interface of receivers of progress reports, and choice of a receiver by the argument `progress`."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from uqmbd.errors import StudyError
from uqmbd.progress.lines import Lines
from uqmbd.progress.notebook import Notebook

__all__ = ["Progress", "Silent", "UntilTheEnd", "expected", "failed", "stage", "choose_receiver"]


class Progress(Protocol):
    """Receiver of reports on the progress of a study.

    Further methods are optional. ``expect(totals)`` receives the labels of all methods before the first begins, with
    their numbers of realisations (`AtMost`, or None if unknown). ``fail(label)`` reports that a method has failed.
    ``cost(label, seconds)`` reports the wall time of a method before its end, as in its results, including the time of
    stored work. ``stage(text)`` reports a long task without realisations, which ends when another task begins.

    Examples
    --------
    >>> import chaospy
    >>> import uqmbd
    >>> from uqmbd_montecarlo import MonteCarlo
    >>> class Printed:
    ...     def start(self, label, total):
    ...         print(label, "begins", total)
    ...     def advance(self, label, count=1):
    ...         pass
    ...     def finish(self, label):
    ...         print(label, "ends")
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> mechanism.output("height", stone.position[0], units="m")
    >>> study = uqmbd.Study("throw", mechanism, [0, 1], [MonteCarlo(samples=20, seed=1)])
    >>> result = study.run(progress=Printed())
    monte-carlo begins 20
    monte-carlo ends
    """

    def start(self, label: str, total: int) -> None:
        """Begin the task `label` with `total` realisations, or add `total` to a task that is already running.

        Parameters
        ----------
        label : str
            Label of a method, or of a part of its computation.
        total : int
            Number of realisations, as `AtMost` if the task may end with fewer.
        """

    def advance(self, label: str, count: int = 1) -> None:
        """Report `count` further realisations.

        Parameters
        ----------
        label : str
            Label of a running task.
        count : int
            Number of realisations computed since the last report.
        """

    def finish(self, label: str) -> None:
        """Report the end of the task `label`."""


class Silent:
    """Receiver that ignores all reports."""

    def start(self, label: str, total: int) -> None:
        """Ignore the report."""

    def advance(self, label: str, count: int = 1) -> None:
        """Ignore the report."""

    def finish(self, label: str) -> None:
        """Ignore the report."""


@dataclass
class UntilTheEnd:
    """Receiver that merges consecutive tasks with one label to one reported task with a single end.

    >>> import sys
    >>> from uqmbd.progress import Lines
    >>> whole = UntilTheEnd(Lines(sys.stdout, clock=lambda: 0.0))
    >>> for part in (10, 20):
    ...     whole.start("search", part)
    ...     whole.finish("search")
    search: 0 of 10
    >>> whole.end()
    search: done after 0 s
    """

    receiver: Progress  # receives the reports
    names: Mapping[str, str] = field(default_factory=dict)  # map from labels to reported labels
    lasting: str | None = None  # label of the only task with a postponed end; None: all tasks
    begun: list[str] = field(default_factory=list)  # labels of started tasks

    def start(self, label: str, total: int) -> None:
        """Report the start or the continuation of a task."""
        label = self.names.get(label, label)
        if label not in self.begun:
            self.begun.append(label)
        self.receiver.start(label, total)

    def advance(self, label: str, count: int = 1) -> None:
        """Forward the report."""
        self.receiver.advance(self.names.get(label, label), count)

    def finish(self, label: str) -> None:
        """Postpone the report of the end, because another part may follow."""
        if self.lasting not in (None, label) and label in self.begun:
            self.begun.remove(label)
            self.receiver.finish(self.names.get(label, label))

    def stage(self, text: str) -> None:
        """Forward the report."""
        stage(self.receiver, text)

    def end(self, cost: float | None = None) -> None:
        """Report the completion, and the wall time in the results, s."""
        tell = getattr(self.receiver, "cost", None)
        for label in self.begun:
            if cost is not None and callable(tell):
                tell(label, cost)
            self.receiver.finish(label)
        self.begun.clear()


def expected(progress: Progress, totals: Mapping[str, int | None]) -> None:
    """Report the methods that will run, and their numbers of realisations, to receivers that accept this."""
    if callable(tell := getattr(progress, "expect", None)):
        tell(totals)


def failed(progress: Progress, label: str) -> None:
    """Report the failure of a method to receivers that accept it."""
    if callable(tell := getattr(progress, "fail", None)):
        tell(label)


def stage(progress: Progress, text: str) -> None:
    """Report the start of work without steps to receivers that accept it."""
    if callable(tell := getattr(progress, "stage", None)):
        tell(text)


def in_notebook() -> bool:
    """Return whether the program runs in a notebook, which is IPython with a kernel instead of a terminal."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return getattr(shell, "kernel", None) is not None


def choose_receiver(progress: Progress | bool | None) -> Progress:
    """Return the receiver of progress: the given one, lines (True), none (False), or bars in a notebook (None).

    >>> [type(choose_receiver(progress)).__name__ for progress in (None, True, False)]
    ['Silent', 'Lines', 'Silent']
    """
    if progress is None or isinstance(progress, bool):
        if progress is not False and in_notebook():
            return Notebook()
        return Lines(sys.stderr) if progress else Silent()
    if not all(callable(getattr(progress, name, None)) for name in ("start", "advance", "finish")):
        raise StudyError(
            f"progress is {progress!r}; expected True, False, None, or an object like uqmbd.extend.Progress."
        )
    return progress
