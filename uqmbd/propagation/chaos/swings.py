"""Swings: a motion from extreme to extreme, whose middle and size may change from one to the next.

An extreme is where the rate is zero, a half-swing what lies between two of them.  Each half-swing has its own phase
plane of value and rate, centred and scaled by itself; the phase grows by half a turn in it, and passes the quarter
where the value is midway.  So nothing but what is near in time tells the phase: a swing that dies down, or whose middle
moves, has one, and a steady swing has that of its one phase plane.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from uqmbd.typing import Array

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

__all__ = ["QUARTER", "Swing", "passing"]


QUARTER = np.pi / 2

REST = 1e-3
"""Size of a half-swing, over the largest so far, below which, and for ever, a swing has come to rest."""

FLOOR = 1e-5
"""The same: so far the moments are known nevertheless, where others come to rest somewhat later."""

ROUNDING = 1e-13
"""Size of the largest half-swing, over the largest value, up to which nothing swings."""

EVEN = 0.25
"""Least size of a half-swing over that of its neighbours, where they change slowly: new extremes begin at zero."""

PATIENCE = 3.0
"""So many times the last half-swing without another extreme, and a swing has come to rest."""

STILL = 1e-6
"""Rate at the start, over the largest, below which the start is an extreme."""

NEWTON = 8
"""Steps in which a time is found."""


@dataclass(frozen=True, eq=False)
class Swing:
    """Oscillation of one realisation."""

    values: Array  # (T,) phase at its times, rad: a multiple of a turn at its highest extremes
    first: int  # phase of the first of the moments, quarter turns
    moments: Array  # (M,) s, consecutive multiples of a quarter turn in phase: extremes, and middles between them
    begin: float  # first extreme, s
    rest: float  # last extreme, s
    rests: bool  # whether it has come to rest after the last
    last: float  # phase of the last extreme before rest, or of the last known one, rad
    even: bool  # whether sizes of half-swings change slowly

    @classmethod
    def of(cls, times: Array, values: Array, spline: BSpline) -> Swing | None:
        """Find the swing of values (T,) at times, and of the spline through them; none where there is no half-swing."""
        slope = spline.derivative()
        rate = slope(times)
        extremes, highest = _extremes(times, rate, slope)
        heights = spline(extremes)
        size = np.abs(np.diff(heights)) / 2
        kept, count = (_last(size, least) for least in (REST, FLOOR))
        if kept < 1 or size.max() <= ROUNDING * np.abs(values).max():
            return None
        rests = kept < len(size) or times[-1] - extremes[kept] > PATIENCE * (extremes[kept] - extremes[kept - 1])
        extremes, size, middle = extremes[: count + 1], size[:count], (heights[1:] + heights[:-1])[:count] / 2
        # numbers of half-swings; what lies before the first and behind the last has the plane of its neighbour
        number = np.searchsorted(extremes, times, side="right") - 1
        own = np.clip(number, 0, count - 1)
        fastest = np.zeros(count)
        np.maximum.at(fastest, own, np.where(number == own, np.abs(rate), 0.0))
        # each begins at the extreme (1, 0) of its plane, and ends at (-1, 0)
        side = np.where((number % 2 == 0) == highest, 1.0, -1.0)
        # what stands has half-swings of no size
        x = side * (values - middle[own]) / np.where(size > 0, size, 1.0)[own]
        y = side * -rate / np.where(fastest > 0, fastest, 1.0)[own]
        angle = np.where((number == count) & rests, 0.0, np.arctan2(np.maximum(y, 0.0), x))
        begins = 0 if highest else 2
        # middles, each between the last time before it and the first one behind
        low, high = extremes[:-1].copy(), extremes[1:].copy()
        inside = number == own
        np.maximum.at(low, own[inside & (x > 0)], times[inside & (x > 0)])
        np.minimum.at(high, own[inside & (x <= 0)], times[inside & (x <= 0)])
        moments = np.empty(2 * count + 1)
        moments[::2], moments[1::2] = extremes, passing(spline, slope, middle, low, high)
        first, before = begins, np.flatnonzero((number < 0) & (x <= 0))
        if len(before) and before[0] > 0:
            at = before[:1]
            moments = np.append(passing(spline, slope, middle[:1], times[at - 1], times[at]), moments)
            first -= 1
        smaller, larger = np.minimum(size[1:], size[:-1]), np.maximum(size[1:], size[:-1])
        even = bool((smaller >= EVEN * larger)[: kept - 1].all())
        phases, last = begins * QUARTER + number * np.pi + angle, begins * QUARTER + kept * np.pi
        return cls(
            np.asarray(phases), first, moments, float(extremes[0]), float(extremes[kept]), bool(rests), last, even
        )

    def moved(self, turns: float) -> Swing:
        """Return it with phases that differ by whole turns."""
        return replace(
            self,
            values=self.values + turns * 4 * QUARTER,
            first=self.first + 4 * round(turns),
            last=self.last + turns * 4 * QUARTER,
        )

    def passed(self, marks: Array) -> Array:
        """Return when phases (S,), multiples of a quarter turn, are passed, s; NaN where one is not."""
        at = np.round(marks / QUARTER).astype(int) - self.first
        known = (at >= 0) & (at < len(self.moments))
        return np.where(known, self.moments[np.clip(at, 0, len(self.moments) - 1)], np.nan)

    def reaching(self, phase: float, known: float) -> float:
        """Estimate when a phase, rad, is known to be passed, s, from what is known until a time; inf: never.

        A middle is known when the extreme behind it is.
        """
        passed = float(self.passed(np.array([phase]))[0])
        if np.isfinite(passed) or self.rests:
            return passed if np.isfinite(passed) else np.inf
        turn = self.moments[-5:]
        quarter = (turn[-1] - turn[0]) / (len(turn) - 1)
        left = 2 * np.ceil(phase / QUARTER / 2 - 1e-6) - self.first - len(self.moments) + 1
        return float(max(self.moments[-1] + left * quarter, known + quarter / 2))


def _last(size: Array, least: float) -> int:
    """Return how many half-swings (N,) there are until they are for ever smaller than a part of the largest so far."""
    large = np.flatnonzero(size >= least * np.maximum.accumulate(size))
    return int(large[-1]) + 1 if len(large) else 0


def passing(spline: BSpline, slope: BSpline, wanted: Array, low: Array, high: Array) -> Array:
    """Find times (S,) at which a spline has given values (S,), each between two times where it lies on both sides."""
    start, end = spline(low) - wanted, spline(high) - wanted
    rise = end - start
    # the first guess is linear; Newton's steps stay between the neighbours
    at = low + (high - low) * np.clip(-start / np.where(rise == 0, np.inf, rise), 0, 1)
    for _ in range(NEWTON):
        rate = slope(at)
        at = np.clip(at - (spline(at) - wanted) / np.where(np.sign(rate) * np.sign(rise) <= 0, np.inf, rate), low, high)
    return np.asarray(at)


def _extremes(times: Array, rate: Array, slope: BSpline) -> tuple[Array, bool]:
    """Find where a rate (T,) is zero, and whether the first is a highest; the start is one where it is at rest."""
    fastest = np.abs(rate).max()
    if not fastest > 0:
        return np.zeros(0), True
    sign = np.where(rate >= 0, 1, -1)
    still = abs(rate[0]) <= STILL * fastest
    if still:
        sign[0] = sign[1]
    at = np.flatnonzero(np.diff(sign))
    found = passing(slope, slope.derivative(), np.zeros(len(at)), times[at], times[at + 1])
    if still:
        return np.append(times[0], found), bool(sign[0] < 0)
    return found, bool(sign[0] > 0)
