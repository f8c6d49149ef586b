"""Chatter: speed below which bouncing bodies stay together."""

from __future__ import annotations

import numpy as np

from uqmbd.typing import Array, Index

__all__ = ["Chatter"]


SLOWEST = 1e-6
"""Impact speed, relative to the fastest previous impact, below which bodies stay together."""
CROWD = 100
"""Number of events that count as a crowd within the time `CROWDED`."""
CROWDED = 2e-3
"""Time of a crowd, relative to the duration; a crowd increases the speed limit by the factor `COARSER`."""
COARSER = 4.0
COARSEST = 1e4
"""Largest increase of the speed limit; ten such times without an event reset the limit."""


class Chatter:
    """Detector of chatter among the impacts of M realisations; `length` of the mechanism (M,), m; `duration`, s."""

    def __init__(self, length: Array, duration: float) -> None:
        self.least, self.window = 1e-12 * length, CROWDED * duration
        self.fastest, self.coarse = np.zeros(len(length)), np.ones(len(length))
        self.crowd, self.count = np.zeros((len(length), CROWD)), np.zeros(len(length), dtype=np.int64)

    def slow(self, members: Index) -> Array:
        """Return the speeds that count as zero, m/s."""
        return np.maximum(self.coarse[members] * SLOWEST * self.fastest[members], self.least[members])

    def happened(self, members: Index, times: Array) -> None:
        """Count events; in a crowd bodies stay together earlier, because friction in a corner may sustain bounces."""
        count = self.count[members]
        before = self.crowd[members, count - 1]
        calm = (count > 0) & (times - before > 10 * self.window)
        self.coarse[members[calm]], self.count[members[calm]] = 1.0, 0
        self.crowd[members, self.count[members]] = times
        self.count[members] += 1
        many = members[self.count[members] >= CROWD]
        crowded = self.crowd[many, -1] - self.crowd[many, 0] < self.window
        self.coarse[many[crowded]] = np.minimum(self.coarse[many[crowded]] * COARSER, COARSEST)
        self.crowd[many[crowded], 0], self.count[many[crowded]] = self.crowd[many[crowded], -1], 1
        rest = many[~crowded]
        self.crowd[rest, :-1], self.count[rest] = self.crowd[rest, 1:], CROWD - 1
