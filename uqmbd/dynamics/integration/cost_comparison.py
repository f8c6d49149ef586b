"""Comparison of the costs of an implicit and the explicit method for one realisation, by counts of operations.

The implicit method is that of the driver, or IDA if the systems are too large for the driver. It integrates the
realisation from the same start to the time that the explicit method has reached, and is selected if it costs less. The
cost of IDA is compared with the cost of an explicit realisation in a group of eight. The comparison stops at the cost
of the explicit integration so far, and depends only on the realisation. Comparisons are rare: the first one takes place
after many steps or checks of the rank, and each following one after several times as many.

The implicit method integrates stiff realisations without a comparison, up to the cost that the explicit method is
expected to need for the whole motion.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from uqmbd.compiled import LANES, Dynamics
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.integration.costs import RANK_CHECK, attempt_cost
from uqmbd.dynamics.integration.trajectories import Counters
from uqmbd.typing import Array

__all__ = ["FIRST", "Comparison", "Rival"]

Rival = Callable[[Batch, Array, float, float], tuple[bool, Counters]]
"""Function that returns whether a method integrates the only realisation to the end within a cost, and its counters."""


FIRST = 2000
"""Number of attempted steps of an interval before the first comparison of costs."""
CHECKS = 500
"""Number of checks of the rank before the first comparison of costs."""
LATER = 8
"""Factor on the number of steps or checks before the next comparison of costs."""
WORTH = 2e7
"""Least cost, in operations, for a comparison: about 20 ms."""


class Comparison:
    """Comparison of the costs of two integrators for the realisations of a batch, at output times (T,), s.

    The explicit method evaluates `dynamics`; the other one is `rival`.
    """

    def __init__(self, batch: Batch, times: Array, rtol: float, dynamics: Dynamics, rival: Rival) -> None:
        self.batch, self.times, self.rtol, self.dynamics, self.rival = batch, times, rtol, dynamics, rival
        self.counters = Counters()
        self.allowed: dict[int, tuple[int, int]] = {}
        self.checks: dict[int, int] = {}

    @cached_property
    def attempt(self) -> float:
        """Cost of an attempted step."""
        return attempt_cost(self.dynamics)

    def attempts(self, member: int, interval: int, steps: int, now: float, most: int) -> int | None:
        """Return the number of further attempts in an interval, at most `most` in total; None: the rival costs less."""
        before, allowed = self.allowed.get(member, (interval, FIRST))
        allowed = allowed if before == interval else FIRST
        if allowed < most and self._cheaper(member, now, max(steps, allowed)):
            return None
        more = min((LATER - 1) * allowed, most - allowed)
        self.allowed[member] = interval, allowed + more
        return more

    def rank_checked(self, member: int, steps: int, now: float) -> bool:
        """Count a check of the rank, and return whether the implicit method costs less."""
        checks = self.checks[member] = self.checks.get(member, 0) + 1
        due = CHECKS
        while due < checks:
            due *= LATER
        return checks == due and self._cheaper(member, now, steps)

    def expected(self, member: int, steps: int, now: float) -> float:
        """Return the cost of the whole motion by the explicit method at the present rate, in operations."""
        begin, end = float(self.times[0]), float(self.times[-1])
        spent = LANES * steps * self.attempt + self.checks.get(member, 0) * RANK_CHECK
        return spent * (end - begin) / (now - begin)

    def _cheaper(self, member: int, now: float, steps: int) -> bool:
        spent = steps * self.attempt + self.checks.get(member, 0) * RANK_CHECK
        if spent < WORTH or now <= self.times[0]:
            return False
        times = np.append(self.times[self.times < now], now)
        found, counters = self.rival(self.batch.select(np.array([member])), times, self.rtol, spent)
        self.counters = self.counters + counters
        return found
