"""The clock of tests: durations are counted, not measured, so that no test depends on how busy the machine is."""

from __future__ import annotations

TICK = 1e-3
"""What the clock goes on by whenever it is read, s."""


class CountedClock:
    """Stands in for `time.perf_counter` and `time.process_time`."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        self.now += TICK
        return self.now

    def spend(self, seconds: float) -> None:
        """Go on by the cost of some work."""
        self.now += seconds


CLOCK = CountedClock()
"""That of all tests of a process; processes of workers have their own, which measure."""
