"""Chatter: the speed from which bodies that bounce stay together."""

from __future__ import annotations

import numpy as np

from uqmbd.typing import Array, Index

__all__ = ["Chatter"]


SLOWEST = 1e-6
"""Speed of an impact, over that of the fastest one before, from which bodies stay together."""
CROWD = 100
"""Number of events ..."""
CROWDED = 2e-3
"""... within this share of the output times let bodies stay together from a speed that `COARSER` times larger ..."""
COARSER = 4.0
COARSEST = 1e4
"""... until it is larger by this at most, or there was no event for ten such times."""


class Chatter:
    """Detector of chatter among the impacts of M realisations; `length` of the mechanism (M,), m; `duration`, s."""

    def __init__(self, length: Array, duration: float) -> None:
        self.least, self.window = 1e-12 * length, CROWDED * duration
        self.fastest, self.coarse = np.zeros(len(length)), np.ones(len(length))
        self.crowd, self.count = np.zeros((len(length), CROWD)), np.zeros(len(length), dtype=np.int64)

    def slow(self, members: Index) -> Array:
        """Speeds that are none, m/s."""
        return np.maximum(self.coarse[members] * SLOWEST * self.fastest[members], self.least[members])

    def happened(self, members: Index, times: Array) -> None:
        """Count events: where they crowd, bodies stay together earlier, as in a corner friction may feed bounces."""
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
