"""The workers that have answered: nobody says how many an executor has, and they come and go."""

from __future__ import annotations

from collections import OrderedDict

from uqmbd.errors import IntegrationError
from uqmbd.propagation.execution.transport.identity import Versions, Worker

__all__ = ["AHEAD", "WorkerRegistry"]

AHEAD = 64
"""Pieces that are sent at least before one of them is answered."""

EACH = 4
"""Pieces that are sent for each worker that has answered: while some answer, others who have come find work."""

PATIENCE = 256
"""Refusals, one after another, after which nobody is expected to accept."""


class WorkerRegistry:
    """Who has answered lately, who lacks a packed object, and who has refused."""

    def __init__(self, expected: Versions) -> None:
        self._expected = expected
        self._last: OrderedDict[tuple[str, int, int], int] = OrderedDict()
        self._answers = 0
        self._lacking: set[tuple[str, int]] = set()
        self._refusers: OrderedDict[tuple[str, int], str] = OrderedDict()
        self.refused = 0
        """Refusals since somebody accepted."""
        self.typical = 0.0
        """Seconds that a piece takes."""

    @property
    def count(self) -> int:
        """Workers that have answered lately."""
        return len(self._last)

    def wants(self, carried: int) -> bool:
        """Tell whether packed objects go with the next piece, where they are under way with so many others.

        They go once for each process that has asked and has not got them yet; where some refuse, who may take what is
        meant for others, with all.
        """
        return len(self._lacking) > (0 if self._refusers else carried)

    @property
    def window(self) -> int:
        """Pieces that may be under way."""
        if self._refusers:
            # whoever refuses is free at once, and would take all that waits for the others
            return max(1, self.count + 1)
        return max(AHEAD, EACH * self.count)

    def done(self, worker: Worker, seconds: float) -> None:
        """Note that a worker has done a piece."""
        self._lacking.discard(worker.key[:2])
        self.refused = 0
        self._answers += 1
        self._last[worker.key] = self._answers
        self._last.move_to_end(worker.key)
        while self._answers - next(iter(self._last.values())) > EACH * max(AHEAD, EACH * len(self._last)):
            self._last.popitem(last=False)
        self.typical += (seconds - self.typical) / min(self._answers, 16)

    def missing(self, worker: Worker) -> None:
        """Note that a worker lacks a packed object."""
        self._lacking.add(worker.key[:2])

    def gone(self) -> None:
        """Note that a worker has died, nobody knows which: those that lack something will ask again."""
        self._lacking.clear()

    def refuse(self, worker: Worker) -> None:
        """Note that a worker is of another version."""
        self.refused += 1
        self._refusers[worker.key[:2]] = worker.differs(self._expected)
        while len(self._refusers) > PATIENCE:
            self._refusers.popitem(last=False)

    def complain(self) -> None:
        """Raise IntegrationError, with refusals and versions of the workers, if no worker seems to accept calls."""
        if self.refused < PATIENCE:
            return
        reasons: dict[str, list[str]] = {}
        for (host, process), reason in self._refusers.items():
            reasons.setdefault(reason, []).append(f"{host} (process {process})")
        words = "; ".join(f"{', '.join(names)}: {reason}" for reason, names in reasons.items())
        raise IntegrationError(
            "No worker has the same versions as this process; bit-identical results require the same versions. "
            f"{words}. Install the versions of this process on the workers, and restart the workers."
        )
