"""Integrals along a motion, and when a value is first reached."""

from __future__ import annotations

import numpy as np

from uqmbd.dynamics.summaries.extremes import peaks
from uqmbd.dynamics.summaries.resolved import FINE, NODES, Need, Parts, values_at
from uqmbd.typing import Array, Mask

__all__ = ["first_times", "integrals", "needed_for_crossings", "needed_for_integrals"]


SHORT = 1 / 256
"""Part of the whole time over which a polynomial that is wrong by the tolerance counts fully."""

BISECTIONS = 60
"""Halvings of a part in which a value is reached: to rounding."""


def _weights() -> Array:
    """Weights of Clenshaw and Curtis for the nodes, of an interval of length 1."""
    moments = [1 / (1 - k * k) if k % 2 == 0 else 0.0 for k in range(len(NODES))]
    vander = np.polynomial.chebyshev.chebvander(NODES, len(NODES) - 1)
    return np.asarray(np.linalg.solve(vander.T, moments))


_WEIGHTS = _weights()


def needed_for_integrals(column: int) -> Need:
    """Say what is to be halved to integrate an output."""

    def need(parts: Parts, tolerance: Array) -> Mask:
        length = parts.end - parts.begin
        stops = np.append(parts.first[1:], len(length)) - 1
        whole = (parts.end[stops] - parts.begin[parts.first])[parts.number]
        return np.asarray(parts.error[:, column] * length > tolerance[:, column] * np.maximum(length, SHORT * whole))

    return need


def integrals(parts: Parts, column: int) -> tuple[Array, Array]:
    """Integrate an output over the motion of each realisation, by Clenshaw and Curtis; and the lengths, (R,) each."""
    mean = np.zeros(len(parts.step))
    for k, weight in enumerate(_WEIGHTS.tolist()):
        mean += weight * parts.values[:, k, column]
    length = parts.end - parts.begin
    return np.add.reduceat(mean * length, parts.first), np.add.reduceat(length, parts.first)


def needed_for_crossings(column: int) -> Need:
    """Say what is to be halved to find when an output is zero or above for the first time."""

    def need(parts: Parts, tolerance: Array) -> Mask:
        error = parts.error[:, column]
        above = (parts.values[:, :, column] >= 0).any(axis=1)
        known = np.minimum.reduceat(np.where(above, parts.begin, np.inf), parts.first)[parts.number]
        maybe = (parts.most[:, column] + error >= 0) & (parts.begin <= known)
        return np.asarray((error > tolerance[:, column]) & maybe)

    return need


def first_times(parts: Parts, column: int) -> Array:
    """Find when an output is zero or above for the first time, s, of each realisation, shape (R,).

    NaN: never.  Infinite: not known, as the output is not finite before it is.
    """
    times = _first_times(parts, column)
    undefined = ~np.isfinite(parts.values[:, :, column]).all(axis=1)
    if not undefined.any():
        return times
    since = np.minimum.reduceat(np.where(undefined, parts.begin, np.inf), parts.first)
    return np.where((since < np.inf) & ~(times <= since), np.inf, times)


def _first_times(parts: Parts, column: int) -> Array:
    which = np.flatnonzero(parts.most[:, column] >= 0)
    place, value = peaks(parts, column, 1.0, which)
    above = value >= 0
    which, place = which[above], place[above]
    rows, earliest = np.unique(parts.number[which], return_index=True)
    chosen, place = which[earliest], place[earliest]
    found = np.full(len(parts.first), np.nan)
    if not len(chosen):
        return found
    series = parts.coefficients[chosen][:, :, column]
    fine = np.stack([values_at(series, np.full(len(chosen), x)) for x in FINE.tolist()], axis=1)
    fine[:, [0, -1]] = parts.values[chosen][:, [0, -1], column]
    fine = np.where(FINE >= place[:, None], 0.0, fine)  # there it is
    top = (fine >= 0).argmax(axis=1)
    high, low = np.minimum(FINE[top], place), FINE[np.maximum(top - 1, 0)]
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        over = values_at(series, middle) >= 0
        high, low = np.where(over, middle, high), np.where(over, low, middle)
    at_once = parts.values[chosen, 0, column] >= 0
    found[rows] = np.where(at_once, parts.begin[chosen], parts.time(chosen, high))
    return found
