"""Largest and smallest values along a motion, and their times."""

from __future__ import annotations

import numpy as np

from uqmbd.dynamics.summaries.resolved import SHARE, StepParts
from uqmbd.typing import Array

__all__ = ["SAME", "find_extremes"]


EQUAL = 1e-14
"""Difference, relative to the largest value, within which values count as equal."""


SAME = 10.0
"""Largest difference of equal peaks, in tolerances of the integration relative to the largest value. Errors of
consecutive peaks differ by several tolerances."""


def find_extremes(parts: StepParts, tolerance: Array, column: int, sign: float) -> tuple[Array, Array]:
    """Return the largest (sign 1) or smallest (-1) value of an output (R,), and its time (R,) in s.

    Of several values within `SAME` tolerances of the integration, the first counts.  The parts are resolved;
    the polynomials have tolerances (R, O).
    """
    most, least, error = (parts.of(name, column) for name in ("most", "least", "error"))
    high = most if sign > 0 else -least
    size = np.maximum.reduceat(np.abs(np.maximum(most, -least)), parts.first)
    slack = SAME / SHARE * tolerance[:, column]
    seen = parts.of("highest", column) if sign > 0 else -parts.of("lowest", column)
    known = np.maximum.reduceat(seen, parts.first)
    which = np.flatnonzero(~(high + error < (known - slack)[parts.number]))
    place, value = parts.fitted(column).peaks(sign, which)
    times, owner = parts.time(which, place), parts.number[which]
    first = np.flatnonzero(np.diff(owner, prepend=-1))
    peak = np.maximum.reduceat(value, first)
    # not a maximum at the end of a part if the next part continues to rise
    beside = (which[1:] == which[:-1] + 1) & (owner[1:] == owner[:-1])
    slope, tiny = np.zeros(len(which), dtype=bool), EQUAL * size[owner[:-1]]
    slope[:-1] |= beside & (place[:-1] == 1.0) & (value[1:] > value[:-1] + tiny)
    slope[1:] |= beside & (place[1:] == -1.0) & (value[:-1] > value[1:] + tiny)
    same = (~slope & (value >= (peak - slack)[owner])) | (value >= peak[owner]) | np.isnan(value)
    chosen = np.flatnonzero(same)
    _, earliest = np.unique(owner[chosen], return_index=True)
    return sign * peak, times[chosen[earliest]]
