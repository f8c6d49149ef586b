"""Chatter: the speed from which bodies that bounce stay together."""

from __future__ import annotations

__all__ = ["Chatter"]


SLOWEST = 1e-6
"""Speed of an impact, over that of the fastest one before, from which bodies stay together."""
CROWD = 100
"""As many events ..."""
CROWDED = 2e-3
"""... within this share of the output times let bodies stay together from a speed that `COARSER` times larger ..."""
COARSER = 4.0
COARSEST = 1e4
"""... until it is larger by this at most, or there was no event for ten such times."""


class Chatter:
    """Watches the impacts of one realisation.

    Parameters
    ----------
    length : float
        Size of the mechanism, m.
    duration : float
        Of the output times, s.
    """

    def __init__(self, length: float, duration: float) -> None:
        self.least, self.window = 1e-12 * length, CROWDED * duration
        self.fastest, self.coarse, self.crowd = 0.0, 1.0, list[float]()

    @property
    def slow(self) -> float:
        """Speed that is none, m/s."""
        return max(self.coarse * SLOWEST * self.fastest, self.least)

    def count(self, time: float) -> None:
        """Count an event: where they crowd, bodies stay together earlier, as in a corner friction may feed bounces."""
        if self.crowd and time - self.crowd[-1] > 10 * self.window:
            self.coarse, self.crowd = 1.0, []
        self.crowd.append(time)
        if len(self.crowd) >= CROWD:
            crowded = self.crowd[-1] - self.crowd[-CROWD] < self.window
            if crowded:
                self.coarse = min(self.coarse * COARSER, COARSEST)
            self.crowd = self.crowd[-1:] if crowded else self.crowd[1:]
