"""When a guard falls through zero within a step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy.optimize

from uqmbd.typing import Array

__all__ = ["SAMPLES", "Guard", "fall"]


SAMPLES = 8
"""Parts of a step at whose ends guards are looked at."""


@dataclass
class Guard:
    """What may end a motion without restarts.

    Attributes
    ----------
    kind : str
        ``gap`` (bodies meet), ``lift-off`` (the normal force vanishes), ``slip`` (so does the reserve of friction),
        ``stick`` (so does the sliding speed).
    event : int
        Of the model.
    resting : bool
        Whether it is zero at the beginning, by rounding above or below: it has to rise before it can fall.
    rise : float
        Its rate then, where it is known.
    """

    kind: Literal["gap", "lift-off", "slip", "stick"]
    event: int
    resting: bool = False
    rise: float = 0.0


def fall(guard: Guard, times: Array, values: Array, value: Callable[[float], float], tiny: float) -> float | None:
    """First time at which a guard falls through zero.

    Parameters
    ----------
    guard : Guard
        It is not `resting` any more once it has risen.
    times, values : array, shape (SAMPLES + 1,)
        Of the step.
    value : callable
        From a time to the guard.
    tiny : float
        What cannot be told from zero, of a guard that rests there.
    """
    begin = float(times[0])
    if not guard.resting:
        if values[0] <= 0:
            return begin
        return _plain_fall(times, values, value, dips=guard.kind == "gap")
    # of a known rise, a fall below the beginning is no error of the interpolant
    depth = np.minimum(tiny, 1e-3 * guard.rise * (times[1:] - begin)) if guard.rise > 0 else tiny
    below = np.flatnonzero(values[1:] - values[0] * (guard.rise > 0) < -depth)
    above = np.flatnonzero(values[1:] > tiny)
    if not len(below):
        guard.resting = not len(above)
        return None
    first = int(below[0]) + 1
    end = float(times[first])
    if len(above) and above[0] + 1 < first:
        guard.resting = False
        last = max(int(k) + 1 for k in above if k + 1 < first)
        return _root(value, float(times[last]), end)
    if guard.rise > 0:
        # it rises and falls within a part: what is divided by the time from the beginning falls only
        start = float(values[0])
        found = _root(lambda t: guard.rise if t <= begin else (value(t) - start) / (t - begin), begin, end)
        guard.resting = False
        return found
    return _root(lambda t: value(t) + tiny, begin, end)


def _plain_fall(times: Array, values: Array, value: Callable[[float], float], *, dips: bool) -> float | None:
    for k in range(1, len(times)):
        if values[k] <= 0:
            return _root(value, float(times[k - 1]), float(times[k]))
        # between two samples that are above zero it may be below
        if dips and k > 1 and values[k - 2] >= values[k - 1] <= values[k]:
            left, right = float(times[k - 2]), float(times[k])
            lowest = scipy.optimize.minimize_scalar(value, bounds=(left, right), method="bounded")
            if lowest.fun < 0:
                return _root(value, left, float(lowest.x))
    return None


def _root(function: Callable[[float], float], left: float, right: float) -> float:
    """Root between a time at which a function is positive and one at which it is not."""
    if function(left) <= 0:
        return left
    if function(right) >= 0:
        return right
    found = scipy.optimize.brentq(function, left, right, xtol=1e-15 * max(1.0, abs(right)), rtol=2e-15)
    return float(found)
