"""Largest and smallest values along a motion, where they are, and the smallest value so far."""

from __future__ import annotations

import numpy as np

from uqmbd.dynamics.summaries.resolved import FINE, NODES, Need, Parts, values_at
from uqmbd.typing import Array, Index, Mask

__all__ = ["extremes", "needed_for_extremes", "needed_for_running", "peaks", "running_minima"]


EQUAL = 1e-14
"""Part of the largest value by which others are as large: rounding."""


NEWTON = 5
"""Steps of Newton's method from the largest of `FINE`, which converge where the polynomial is resolved."""


def needed_for_extremes(column: int, sign: float) -> Need:
    """Say what is to be halved to find the largest (sign 1) or smallest (-1) value of an output."""

    def need(parts: Parts, tolerance: Array) -> Mask:
        error = parts.error[:, column]
        high = parts.most[:, column] if sign > 0 else -parts.least[:, column]
        known = (sign * parts.values[:, :, column]).max(axis=1)
        best = np.maximum.reduceat(known, parts.first)[parts.number]
        return np.asarray((error > tolerance[:, column]) & (high + error >= best))

    return need


def needed_for_running(column: int) -> Need:
    """Say what is to be halved to find the smallest value so far of an output."""

    def need(parts: Parts, tolerance: Array) -> Mask:
        error, low = parts.error[:, column], parts.least[:, column] - parts.error[:, column]
        before = _before(parts, parts.values[:, :, column].min(axis=1))
        return np.asarray((error > tolerance[:, column]) & (low < before))

    return need


def _before(parts: Parts, values: Array) -> Array:
    """Smallest value of all parts before each, of the same realisation; infinite where there is none."""
    found = np.full(len(values), np.inf)
    stops = [*parts.first[1:].tolist(), len(values)]
    for first, stop in zip(parts.first.tolist(), stops, strict=True):
        found[first + 1 : stop] = np.minimum.accumulate(values[first : stop - 1])
    return found


def _derivative(coefficients: Array) -> Array:
    """Chebyshev coefficients (E, 8) of the derivatives of series, by the recurrence."""
    found = np.zeros_like(coefficients)
    last = coefficients.shape[1] - 1
    for k in range(last, 0, -1):
        found[:, k - 1] = 2 * k * coefficients[:, k] + (found[:, k + 1] if k < last else 0.0)
    found[:, 0] *= 0.5
    return found


def peaks(parts: Parts, column: int, sign: float, which: Index) -> tuple[Array, Array]:
    """Find where and what the largest values of `sign` times an output are, in some parts: shape (N,) each.

    Where it is constant, that is at the first place.
    """
    series, nodes = sign * parts.coefficients[which][:, :, column], sign * parts.values[which][:, :, column]
    values = np.stack([values_at(series, np.full(len(which), x)) for x in FINE.tolist()], axis=1)
    # at the ends values are known: those on each side of a jump
    values[:, [0, -1]] = nodes[:, [0, -1]]
    rows, tiny = np.arange(len(which)), EQUAL * np.abs(nodes).max(axis=1, initial=0.0)
    top = (values >= (values.max(axis=1, initial=-np.inf) - tiny)[:, None]).argmax(axis=1)
    place, best = FINE[top], values[rows, top]
    low, high = FINE[np.maximum(top - 1, 0)], FINE[np.minimum(top + 1, len(FINE) - 1)]
    slope = _derivative(series)
    bend = _derivative(slope)
    at = place.copy()
    with np.errstate(all="ignore"):
        for _ in range(NEWTON):
            step = values_at(slope, at) / values_at(bend, at)
            at = np.clip(np.where(np.isfinite(step), at - step, at), low, high)
    between = values_at(series, at)
    better = between > best + tiny
    place, best = np.where(better, at, place), np.where(better, between, best)
    # a node may be higher than what lies between: a kink that is resolved to the last
    node = nodes.argmax(axis=1)
    over = nodes[rows, node] > best + tiny
    return np.where(over, NODES[node], place), np.where(over, nodes[rows, node], best)


def extremes(parts: Parts, tolerance: Array, column: int, sign: float, rtol: float) -> tuple[Array, Array]:
    """Find the largest (sign 1) or smallest (-1) value of an output, and when, of each realisation, shape (R,) each.

    Of several that are the same within the tolerance of the integration it is the first.

    Parameters
    ----------
    parts : Parts
        Resolved.
    tolerance : array, shape (R, O)
        Of the polynomials.
    column : int
        Of the output.
    sign : float
    rtol : float
        Relative tolerance of the integration.
    """
    high = parts.most[:, column] if sign > 0 else -parts.least[:, column]
    size = np.maximum.reduceat(np.abs(np.maximum(parts.most[:, column], -parts.least[:, column])), parts.first)
    slack = np.maximum(rtol * size, 4 * tolerance[:, column])
    known = np.maximum.reduceat((sign * parts.values[:, :, column]).max(axis=1), parts.first)
    which = np.flatnonzero(~(high + parts.error[:, column] < (known - 2 * slack)[parts.number]))
    place, value = peaks(parts, column, sign, which)
    times, owner = parts.time(which, place), parts.number[which]
    first = np.flatnonzero(np.diff(owner, prepend=-1))
    peak = np.maximum.reduceat(value, first)
    # a largest value at an end, beside a part that goes on rising there, is none
    beside = (which[1:] == which[:-1] + 1) & (owner[1:] == owner[:-1])
    slope, tiny = np.zeros(len(which), dtype=bool), EQUAL * size[owner[:-1]]
    slope[:-1] |= beside & (place[:-1] == 1.0) & (value[1:] > value[:-1] + tiny)
    slope[1:] |= beside & (place[1:] == -1.0) & (value[:-1] > value[1:] + tiny)
    same = (~slope & (value >= (peak - slack)[owner])) | (value >= peak[owner]) | np.isnan(value)
    chosen = np.flatnonzero(same)
    _, earliest = np.unique(owner[chosen], return_index=True)
    return sign * peak, times[chosen[earliest]]


def running_minima(parts: Parts, column: int, times: Array) -> Array:
    """Smallest value of an output so far, at times (T,) of each realisation: shape (R, T)."""
    place, value = peaks(parts, column, -1.0, np.arange(len(parts.step)))
    lowest = -value
    before = _before(parts, lowest)
    found = np.empty((len(parts.first), len(times)))
    stops = [*parts.first[1:].tolist(), len(parts.step)]
    series = parts.coefficients[:, :, column]
    fine = np.stack([values_at(series, np.full(len(series), x)) for x in FINE.tolist()], axis=1)
    fine[:, [0, -1]] = parts.values[:, [0, -1], column]
    fine = np.minimum.accumulate(fine, axis=1)
    for row, (first, stop) in enumerate(zip(parts.first.tolist(), stops, strict=True)):
        which = first + np.maximum(np.searchsorted(parts.begin[first:stop], times, side="right") - 1, 0)
        with np.errstate(all="ignore"):
            at = 2 * (times - parts.begin[which]) / (parts.end[which] - parts.begin[which]) - 1
        at = np.clip(at, -1.0, 1.0)
        here = np.where(at > -1.0, values_at(series[which], at), parts.values[which, 0, column])
        passed = np.searchsorted(FINE, at, side="right") - 1
        inside = np.minimum(fine[which, passed], np.where(place[which] <= at, lowest[which], np.inf))
        found[row] = np.minimum(before[which], np.minimum(here, inside))
        found[row, -1] = lowest[first:stop].min()
    return np.minimum.accumulate(found, axis=1)
