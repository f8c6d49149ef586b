"""Receivers of reports on progress: their interface, and the choice of one by the argument `progress`."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from uqmbd.errors import StudyError
from uqmbd.progress.lines import Lines
from uqmbd.progress.notebook import Notebook, in_notebook

__all__ = ["Progress", "Silent", "UntilTheEnd", "expected", "failed", "stage", "choose_receiver"]


class Progress(Protocol):
    """Receiver of reports on the progress of a study.

    Further methods are optional. ``expect(totals)`` receives the labels of all methods before the first begins, with
    their numbers of realisations (`AtMost`, or None: not known). ``fail(label)`` reports that a method has failed.
    ``stage(text)`` reports a long task without realisations, which ends as soon as another begins.

    Examples
    --------
    >>> import chaospy
    >>> import uqmbd
    >>> from uqmbd_montecarlo import MonteCarlo
    >>> class Told:
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
    >>> result = study.run(progress=Told())
    monte-carlo begins 20
    monte-carlo ends
    """

    def start(self, label: str, total: int) -> None:
        """Begin the work called `label`, of `total` realisations; so many more, if it has begun and not ended.

        Parameters
        ----------
        label : str
            Of a method, or of a part of its work.
        total : int
            Realisations; an `AtMost` where they may be fewer.
        """

    def advance(self, label: str, count: int = 1) -> None:
        """Report `count` more of them.

        Parameters
        ----------
        label : str
            As begun.
        count : int
            How many have been computed since.
        """

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
    """Progress that reports consecutive tasks with one label as one task, which ends once.

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
    names: Mapping[str, str] = field(default_factory=dict)  # labels under which others are reported
    begun: list[str] = field(default_factory=list)  # labels

    def start(self, label: str, total: int) -> None:
        """Say that it begins, or that it goes on."""
        label = self.names.get(label, label)
        if label not in self.begun:
            self.begun.append(label)
        self.receiver.start(label, total)

    def advance(self, label: str, count: int = 1) -> None:
        """Pass it on."""
        self.receiver.advance(self.names.get(label, label), count)

    def finish(self, label: str) -> None:
        """Wait: another part may follow."""

    def stage(self, text: str) -> None:
        """Pass it on."""
        stage(self.receiver, text)

    def end(self) -> None:
        """Say that all of it is done."""
        for label in self.begun:
            self.receiver.finish(label)
        self.begun.clear()


def expected(progress: Progress, totals: Mapping[str, int | None]) -> None:
    """Return which methods will run, and how many realisations they take, to who wants to know."""
    if callable(tell := getattr(progress, "expect", None)):
        tell(totals)


def failed(progress: Progress, label: str) -> None:
    """Tell that a method has failed, to who wants to know."""
    if callable(tell := getattr(progress, "fail", None)):
        tell(label)


def stage(progress: Progress, text: str) -> None:
    """Tell of work without a number that begins, to who wants to know."""
    if callable(tell := getattr(progress, "stage", None)):
        tell(text)


def choose_receiver(progress: Progress | bool | None) -> Progress:
    """Return the progress to report to: the given one, lines (True), none (False), or that of a notebook (None).

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
