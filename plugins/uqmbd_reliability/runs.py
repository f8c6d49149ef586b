"""The mechanism as a limit state: every realisation is counted and kept with its running margins."""

from __future__ import annotations

from collections import Counter
from typing import Protocol

import numpy as np

import uqmbd
from uqmbd.typing import Array, Index, Mask
from uqmbd_reliability.space import StandardSpace

__all__ = ["Runs"]


class Known(Protocol):
    """Margins of realisations, as they are given beside outputs, and alone."""

    @property
    def values(self) -> Array: ...
    @property
    def running(self) -> Array: ...
    @property
    def failed(self) -> Mask: ...
    @property
    def messages(self) -> tuple[str, ...]: ...


class Runs:
    """Margins of chosen requirements, computed on request."""

    def __init__(self, problem: uqmbd.extend.Problem, space: StandardSpace, chosen: list[int]) -> None:
        self._problem, self._space, self._chosen = problem, space, chosen
        self._running: list[Array] = []
        self.counters: Counter[str] = Counter()
        self.reasons: Counter[str] = Counter()
        self.wall_time = 0.0
        self.failures = self.count = 0
        self.pilot: uqmbd.extend.Realisations | None = None

    def __call__(self, points: Array) -> tuple[Array, Mask]:
        """Return margins (K, requirement) at points (K, d), and which realisations failed.

        The outputs of the first points that are asked for are kept.
        """
        inputs = self._space.to_inputs(points)
        if self.pilot is None:
            self.pilot = self._problem.realise(inputs)
            self.counters.update(self.pilot.counters)
            self.wall_time += self.pilot.wall_time
            # computed beside the outputs, and not again
            found: Known = self.pilot.margins or self._problem.margins(inputs)
        else:
            found = more = self._problem.margins(inputs)
            self.counters.update(more.counters)
            self.wall_time += more.wall_time
        self.count += len(points)
        self.failures += int(np.count_nonzero(found.failed))
        self.reasons.update(message for message in found.messages if message)
        self._running.append(found.running[:, self._chosen])
        return found.values[:, self._chosen], found.failed

    def running(self, rows: Index) -> Array:
        """Return the running margins (K, requirement, T) of some realisations, by their places."""
        return np.asarray(np.concatenate(self._running)[rows])

    @property
    def reason(self) -> str:
        """The most frequent reason of failure, or empty."""
        return self.reasons.most_common(1)[0][0] if self.reasons else ""
