"""Integrals along a motion, and when a value is first reached."""

from __future__ import annotations

import numpy as np

from uqmbd.compiled import FINE
from uqmbd.dynamics.summaries.resolved import Parts, values_at
from uqmbd.typing import Array

__all__ = ["first_times", "integrals"]


BISECTIONS = 60
"""Halvings of a part in which a value is reached: to rounding."""


def integrals(parts: Parts, column: int) -> tuple[Array, Array]:
    """Integrate an output over the motion of each realisation, by Clenshaw and Curtis; and the lengths, (R,) each."""
    length = parts.end - parts.begin
    return np.add.reduceat(parts.of("mean", column) * length, parts.first), np.add.reduceat(length, parts.first)


def first_times(parts: Parts, column: int) -> Array:
    """Find when an output is zero or above for the first time, s, of each realisation, shape (R,).

    NaN: never.  Infinite: not known, as the output is not finite before it is.
    """
    times = _first_times(parts, column)
    undefined = np.isnan(parts.of("highest", column))
    if not undefined.any():
        return times
    since = np.minimum.reduceat(np.where(undefined, parts.begin, np.inf), parts.first)
    return np.where((since < np.inf) & ~(times <= since), np.inf, times)


def _first_times(parts: Parts, column: int) -> Array:
    which = np.flatnonzero(parts.of("most", column) >= 0)
    place, value = parts.fitted(column).peaks(1.0, which)
    above = value >= 0
    which, place = which[above], place[above]
    rows, earliest = np.unique(parts.number[which], return_index=True)
    chosen, place = which[earliest], place[earliest]
    found = np.full(len(parts.first), np.nan)
    if not len(chosen):
        return found
    series, values = (parts.of(name, column, chosen) for name in ("coefficients", "values"))
    fine = np.stack([values_at(series, np.full(len(chosen), x)) for x in FINE.tolist()], axis=1)
    fine[:, [0, -1]] = values[:, [0, -1]]
    fine = np.where(FINE >= place[:, None], 0.0, fine)  # there it is
    top = (fine >= 0).argmax(axis=1)
    high, low = np.minimum(FINE[top], place), FINE[np.maximum(top - 1, 0)]
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        over = values_at(series, middle) >= 0
        high, low = np.where(over, middle, high), np.where(over, low, middle)
    at_once = values[:, 0] >= 0
    found[rows] = np.where(at_once, parts.begin[chosen], parts.time(chosen, high))
    return found
