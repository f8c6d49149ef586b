"""Margins of realisations, computed on request and stored, with the outputs of the first ones."""

from __future__ import annotations

from collections import Counter
from typing import Protocol

import numpy as np

import uqmbd
from uqmbd.typing import Array, Index, Mask
from uqmbd_reliability.space import StandardSpace

__all__ = ["MarginRuns"]


class MarginSource(Protocol):
    """Margins of realisations, with or without outputs."""

    @property
    def values(self) -> Array: ...
    @property
    def running(self) -> Array: ...
    @property
    def failed(self) -> Mask: ...
    @property
    def messages(self) -> tuple[str, ...]: ...


NEAR = 1e-3
"""Tolerance for the minimum of a running margin, relative to its total decrease."""


class MarginRuns:
    """Margins of the selected requirements, computed on request."""

    def __init__(self, problem: uqmbd.extend.Problem, space: StandardSpace, chosen: list[int]) -> None:
        self._problem, self._space, self._chosen = problem, space, chosen
        self._running: list[Array] = []
        self._points: list[Array] = []
        self.counters: Counter[str] = Counter()
        self.reasons: Counter[str] = Counter()
        self.wall_time = 0.0
        self.failures = self.count = 0
        self.pilot: uqmbd.extend.Realisations | None = None

    def __call__(self, points: Array, terms: tuple[Array, Array] | None = None) -> tuple[Array, Mask]:
        """Return margins (K, requirement) at points (K, d), and which realisations failed.

        The outputs of the first requested points are stored. `terms` are the keys and weights (K, process, M) of
        combined paths; without them, the points contain the keys.
        """
        inputs = self._space.to_inputs(points)
        if terms is not None:
            inputs[:, self._space.paths] = terms[0][:, :, 0]
            inputs = uqmbd.extend.combined_paths(inputs, *terms) if terms[0].shape[2] > 1 else inputs
        if self.pilot is None:
            self.pilot = self._problem.realise(inputs)
            self.counters.update(self.pilot.counters)
            self.wall_time += self.pilot.wall_time
            # margins and outputs of the first points are computed together
            found: MarginSource = self.pilot.margins or self._problem.margins(inputs)
        else:
            found = more = self._problem.margins(inputs)
            self.counters.update(more.counters)
            self.wall_time += more.wall_time
        self.count += len(points)
        self.failures += int(np.count_nonzero(found.failed))
        self.reasons.update(message for message in found.messages if message)
        self._running.append(found.running[:, self._chosen])
        self._points.append(points)
        return found.values[:, self._chosen], found.failed

    def running(self, rows: Index) -> Array:
        """Return the running margins (K, requirement, T) of the realisations with the given indices."""
        return np.asarray(np.concatenate(self._running)[rows])

    def time_of(self, point: Array, requirement: int, times: Array) -> float:
        """Return the time of the smallest margin in the realisation nearest to a point (d,); NaN if unknown."""
        if not self._problem.requirements[self._chosen[requirement]].over_time:
            return float("nan")
        running = np.concatenate(self._running)[:, requirement]
        known = np.flatnonzero(np.isfinite(running[:, -1]))
        if not len(known) or running.shape[1] != len(times):
            return float("nan")
        nearest = known[np.argmin(np.linalg.norm(np.concatenate(self._points)[known] - point, axis=1))]
        margin = running[nearest]
        # skip infinite margins before the requirement's interval; a periodic motion reaches the minimum repeatedly
        fall = margin[np.isfinite(margin)][0] - margin[-1]
        return float(times[np.argmax(margin <= margin[-1] + NEAR * fall)])

    @property
    def on_paths(self) -> bool:
        """Whether the realisations have sampled paths."""
        return bool(self._space.paths)

    @property
    def reason(self) -> str:
        """Most frequent reason of failure; an empty text if none failed."""
        return self.reasons.most_common(1)[0][0] if self.reasons else ""
