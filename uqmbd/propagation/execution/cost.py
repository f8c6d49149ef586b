"""What work costs, over all runs that it took: what is read from a checkpoint costs what it cost to compute."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

__all__ = ["Clock", "Laps"]


@dataclass
class Clock:
    """A clock that goes on, for work that is not done again, by the time that it once took.

    Differences of its readings are wall times as an undisturbed run would have them.

    Examples
    --------
    >>> clock = Clock()
    >>> begin = clock()
    >>> clock.recover("a chunk", 3600.0)
    >>> clock.recover("a chunk", 3600.0)  # read once more
    >>> round((clock() - begin) / 3600)
    1
    """

    _recovered: float = 0.0
    _known: set[str] = field(default_factory=set)

    def __call__(self) -> float:
        """Seconds, from an arbitrary origin."""
        return time.perf_counter() + self._recovered

    def recover(self, key: str, seconds: float) -> None:
        """Go on by the cost of work that was read, unless it was done or read before in this run."""
        if key not in self._known:
            self._known.add(key)
            self._recovered += seconds

    def knows(self, key: str) -> bool:
        """Tell whether work was done or read in this run."""
        return key in self._known

    def done(self, key: str) -> None:
        """Note that work was done in this run."""
        self._known.add(key)


class Laps:
    """Times from one piece of work to the next."""

    def __init__(self) -> None:
        self._last = time.perf_counter()

    def __call__(self) -> float:
        """Seconds since the last call."""
        before, self._last = self._last, time.perf_counter()
        return self._last - before
