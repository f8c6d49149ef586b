"""Registry of replying workers: an executor does not report its number of workers, and this number may change."""

from __future__ import annotations

from collections import OrderedDict

from uqmbd.errors import IntegrationError
from uqmbd.propagation.execution.transport.identity import Versions, Worker

__all__ = ["AHEAD", "WorkerRegistry"]

AHEAD = 64
"""Minimum number of tasks that are sent before the first reply."""

EACH = 4
"""Number of tasks that are sent for each replying worker, so that new workers also receive tasks."""

PATIENCE = 256
"""Number of consecutive refusals after which the run raises an error."""


class WorkerRegistry:
    """Registry of workers that replied recently, lack a packed object, or refused a task."""

    def __init__(self, expected: Versions) -> None:
        self._expected = expected
        self._last: OrderedDict[tuple[str, int, int], int] = OrderedDict()
        self._answers = 0
        self._lacking: set[tuple[str, int]] = set()
        self._refusers: OrderedDict[tuple[str, int], str] = OrderedDict()
        self.refused = 0
        """Number of refusals since the last accepted task."""
        self.typical = 0.0
        """Typical wall time of a task, s."""

    @property
    def count(self) -> int:
        """Return the number of workers that replied recently."""
        return len(self._last)

    def needs_objects(self, carried: int) -> bool:
        """Return whether the next task includes packed objects, if `carried` other tasks include them.

        Each process that lacks the objects receives them once. If some workers refuse tasks, every task includes the
        objects, because a refusing worker may receive a task that was meant for another worker.
        """
        return len(self._lacking) > (0 if self._refusers else carried)

    @property
    def window(self) -> int:
        """Return the maximum number of tasks that may be submitted at once."""
        if self._refusers:
            # a refusing worker is free at once: it would receive, and refuse, all tasks that wait for other workers
            return max(1, self.count + 1)
        return max(AHEAD, EACH * self.count)

    def done(self, worker: Worker, seconds: float) -> None:
        """Record that a worker has completed a task."""
        self._lacking.discard(worker.key[:2])
        self.refused = 0
        self._answers += 1
        self._last[worker.key] = self._answers
        self._last.move_to_end(worker.key)
        while self._answers - next(iter(self._last.values())) > EACH * max(AHEAD, EACH * len(self._last)):
            self._last.popitem(last=False)
        self.typical += (seconds - self.typical) / min(self._answers, 16)

    def missing(self, worker: Worker) -> None:
        """Record that a worker lacks a packed object."""
        self._lacking.add(worker.key[:2])

    def record_death(self) -> None:
        """Record the death of an unknown worker; workers that lack objects will request them again."""
        self._lacking.clear()

    def refuse(self, worker: Worker) -> None:
        """Record that a worker has other versions of the software."""
        self.refused += 1
        self._refusers[worker.key[:2]] = worker.differs(self._expected)
        while len(self._refusers) > PATIENCE:
            self._refusers.popitem(last=False)

    def raise_if_all_refuse(self) -> None:
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
