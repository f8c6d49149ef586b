"""Half-swings: intervals of a motion between successive extremes, whose centre and amplitude may change.

An extreme is a zero of the rate, and a half-swing is the interval between two extremes. Each half-swing has a separate
phase plane of value and rate, with its own centre and scale. The phase grows by half a turn in a half-swing, and passes
the quarter turn at the mean of the two extremes. The phase therefore depends only on the motion nearby in time.
Decaying oscillations and oscillations with a moving centre have a phase. For a steady oscillation all phase planes are
the same.
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
"""Ratio to the largest half-swing so far; the oscillation is at rest when all later half-swings are below it."""

FLOOR = 1e-5
"""Ratio, as `REST`, down to which times are recorded, because other realisations come to rest later."""

ROUNDING = 1e-13
"""Ratio of the largest half-swing to the largest value up to which there is no oscillation."""

EVEN = 0.25
"""Minimum size ratio of neighbouring half-swings in a slow change; a half-swing between new extremes starts small."""

PATIENCE = 3.0
"""Duration without an extreme, relative to the last half-swing, after which an oscillation is at rest."""

STILL = 1e-6
"""Ratio of the initial to the largest rate below which the start is an extreme."""

NEWTON = 8
"""Number of Newton steps for a time."""


@dataclass(frozen=True, eq=False)
class Swing:
    """Oscillation of one realisation."""

    values: Array  # (T,) phase, rad: a multiple of a turn at maxima
    first: int  # phase at the first of `moments`, quarter turns
    moments: Array  # (M,) times of consecutive quarter turns, s: extremes, and middles between them
    begin: float  # time of the first extreme, s
    rest: float  # time of the last extreme, s
    rests: bool  # whether the oscillation comes to rest after the last extreme
    last: float  # phase of the last extreme before rest, or of the last known extreme, rad
    even: bool  # whether sizes of half-swings change slowly

    @classmethod
    def of(cls, times: Array, values: Array, spline: BSpline) -> Swing | None:
        """Return the oscillation of values (T,) at times (T,) in s, and of their spline; None without a half-swing."""
        slope = spline.derivative()
        rate = slope(times)
        extremes, highest = _extremes(times, rate, slope)
        heights = spline(extremes)
        size = np.abs(np.diff(heights)) / 2
        moving, count = (_last(size, least) for least in (REST, FLOOR))
        if moving < 1 or size.max() <= ROUNDING * np.abs(values).max():
            return None
        rests = moving < len(size) or times[-1] - extremes[moving] > PATIENCE * (
            extremes[moving] - extremes[moving - 1]
        )
        extremes, size, middle = extremes[: count + 1], size[:count], (heights[1:] + heights[:-1])[:count] / 2
        # indices of half-swings; times before the first and after the last one use the plane of their neighbour
        number = np.searchsorted(extremes, times, side="right") - 1
        own = np.clip(number, 0, count - 1)
        fastest = np.zeros(count)
        np.maximum.at(fastest, own, np.where(number == own, np.abs(rate), 0.0))
        # each half-swing begins at the extreme (1, 0) of its plane, and ends at (-1, 0)
        side = np.where((number % 2 == 0) == highest, 1.0, -1.0)
        # at rest, half-swings have the amplitude zero
        x = side * (values - middle[own]) / np.where(size > 0, size, 1.0)[own]
        y = side * -rate / np.where(fastest > 0, fastest, 1.0)[own]
        angle = np.where((number == count) & rests, 0.0, np.arctan2(np.maximum(y, 0.0), x))
        begins = 0 if highest else 2
        # middles, each between the last earlier time and the first later time
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
        even = bool((smaller >= EVEN * larger)[: moving - 1].all())
        phases, last = begins * QUARTER + number * np.pi + angle, begins * QUARTER + moving * np.pi
        return cls(
            np.asarray(phases), first, moments, float(extremes[0]), float(extremes[moving]), bool(rests), last, even
        )

    def moved(self, turns: float) -> Swing:
        """Return the oscillation with phases shifted by whole turns."""
        return replace(
            self,
            values=self.values + turns * 4 * QUARTER,
            first=self.first + 4 * round(turns),
            last=self.last + turns * 4 * QUARTER,
        )

    def passed(self, marks: Array) -> Array:
        """Return the times (S,) in s of phases in rad (multiples of a quarter turn); NaN for phases out of reach."""
        at = np.round(marks / QUARTER).astype(int) - self.first
        known = (at >= 0) & (at < len(self.moments))
        return np.where(known, self.moments[np.clip(at, 0, len(self.moments) - 1)], np.nan)

    def reaching(self, phase: float, known: float) -> float:
        """Estimate the time in s of a phase in rad from the motion until a known time; inf for a phase out of reach.

        A middle is known as soon as the next extreme is known.
        """
        passed = float(self.passed(np.array([phase]))[0])
        if np.isfinite(passed) or self.rests:
            return passed if np.isfinite(passed) else np.inf
        turn = self.moments[-5:]
        quarter = (turn[-1] - turn[0]) / (len(turn) - 1)
        left = 2 * np.ceil(phase / QUARTER / 2 - 1e-6) - self.first - len(self.moments) + 1
        return float(max(self.moments[-1] + left * quarter, known + quarter / 2))


def _last(size: Array, least: float) -> int:
    """Return the number of half-swings (N,) after which all are below a given share of the largest so far."""
    large = np.flatnonzero(size >= least * np.maximum.accumulate(size))
    return int(large[-1]) + 1 if len(large) else 0


def passing(spline: BSpline, slope: BSpline, targets: Array, low: Array, high: Array) -> Array:
    """Return the times (S,) in s at which a spline has given values (S,), each within a bracketing interval."""
    start, end = spline(low) - targets, spline(high) - targets
    rise = end - start
    # the first guess is a linear interpolation; Newton steps stay within the interval
    at = low + (high - low) * np.clip(-start / np.where(rise == 0, np.inf, rise), 0, 1)
    for _ in range(NEWTON):
        rate = slope(at)
        at = np.clip(
            at - (spline(at) - targets) / np.where(np.sign(rate) * np.sign(rise) <= 0, np.inf, rate), low, high
        )
    return np.asarray(at)


def _extremes(times: Array, rate: Array, slope: BSpline) -> tuple[Array, bool]:
    """Return the times (N,) in s of the extremes of a quantity, and whether the first is a maximum.

    `rate` (T,) contains the rates of the quantity at `times`, and `slope` is the spline through them. Extremes are
    zeros of the rate; a start from rest is an extreme.
    """
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
