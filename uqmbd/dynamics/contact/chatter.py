"""Speed limit below which bouncing bodies stay together (chatter)."""

from __future__ import annotations

import numpy as np

from uqmbd.typing import Array, Index

__all__ = ["Chatter"]


SLOWEST = 1e-6
"""Impact speed, relative to the fastest previous impact, below which bodies stay together."""
CLUSTER = 100
"""Number of events within `CLUSTER_TIME` that count as a cluster."""
CLUSTER_TIME = 2e-3
"""Time of a cluster, relative to the duration. A cluster increases the speed limit by the factor `COARSER`."""
COARSER = 4.0
COARSEST = 1e4
"""Largest increase of the speed limit. Ten times `CLUSTER_TIME` without an event reset the limit."""


class Chatter:
    """Detector of chatter among the impacts of M realisations; `length` of the mechanism (M,), m; `duration`, s."""

    def __init__(self, length: Array, duration: float) -> None:
        self.least, self.window = 1e-12 * length, CLUSTER_TIME * duration
        self.fastest, self.coarse = np.zeros(len(length)), np.ones(len(length))
        self.recent, self.count = np.zeros((len(length), CLUSTER)), np.zeros(len(length), dtype=np.int64)

    def slow(self, members: Index) -> Array:
        """Return the speeds that count as zero, m/s."""
        return np.maximum(self.coarse[members] * SLOWEST * self.fastest[members], self.least[members])

    def happened(self, members: Index, times: Array) -> None:
        """Count events. A cluster raises the speed limit, because friction in a corner may sustain bounces."""
        count = self.count[members]
        before = self.recent[members, count - 1]
        calm = (count > 0) & (times - before > 10 * self.window)
        self.coarse[members[calm]], self.count[members[calm]] = 1.0, 0
        self.recent[members, self.count[members]] = times
        self.count[members] += 1
        many = members[self.count[members] >= CLUSTER]
        clustered = self.recent[many, -1] - self.recent[many, 0] < self.window
        self.coarse[many[clustered]] = np.minimum(self.coarse[many[clustered]] * COARSER, COARSEST)
        self.recent[many[clustered], 0], self.count[many[clustered]] = self.recent[many[clustered], -1], 1
        rest = many[~clustered]
        self.recent[rest, :-1], self.count[rest] = self.recent[rest, 1:], CLUSTER - 1
