"""Tables of quantile functions: monotone cubic interpolation over the probit scale, and its inverse."""

from __future__ import annotations

import numpy as np
import scipy.special
from numpy.typing import NDArray

from uqmbd.typing import Array

__all__ = ["KNOTS", "interpolate", "invert", "probit", "slope_at"]


KNOTS: Array = np.linspace(-8.25, 8.25, 6601)
"""Standard normal values at which quantile functions are tabulated; their probabilities are 8e-17 to 1 - 1.1e-16."""

SMALLEST = 1e-300
LARGEST = 1 - 2.0**-53


def probit(uniform: Array) -> Array:
    """Return standard normal quantiles; move 0 and 1 into the open interval first.

    >>> probit(np.array([0.5, 1.0])).round(2).tolist()
    [0.0, 8.21]
    """
    values: Array = scipy.special.ndtri(np.clip(uniform, SMALLEST, LARGEST))
    return values


def slopes(knots: Array, values: Array) -> Array:
    """Return derivatives at the knots that keep a cubic Hermite interpolant monotone.

    Five points give derivatives of fourth order, which are limited to three times the smaller neighbouring secant. This
    limit is the sufficient condition of Fritsch and Carlson, SIAM J. Numer. Anal. 17 (1980) 238. The interpolation
    error decreases with the fourth power of the distance between knots where the limit is not reached. In the two cells
    at each end, slopes and errors have a lower order.
    """
    secants = np.diff(values) / np.diff(knots)
    result = np.empty_like(values)
    result[1:-1] = (secants[1:] + secants[:-1]) / 2
    # equidistant knots: (-f2 + 8 f1 - 8 f-1 + f-2) / (12 h)
    result[2:-2] = (7 * (secants[1:-2] + secants[2:-1]) - (secants[:-3] + secants[3:])) / 12
    result[0], result[-1] = secants[0], secants[-1]
    bound = 3 * np.minimum(np.r_[secants[0], secants], np.r_[secants, secants[-1]])
    return np.clip(result, 0, bound)


def interpolate(table: Array, where: Array) -> Array:
    """Evaluate a table (2, M) of knots and non-decreasing values; extrapolate linearly beyond its ends.

    >>> interpolate(np.array([KNOTS, 2 * KNOTS]), np.array([0.123, 10.0])).round(12).tolist()
    [0.246, 20.0]
    """
    knots, values = table
    slope = slopes(knots, values)
    x = np.asarray(where, dtype=float)
    cell = np.clip(np.searchsorted(knots, x, side="right") - 1, 0, len(knots) - 2)
    inside = np.clip(x, knots[0], knots[-1])
    result = _cubic(cell, inside - knots[cell], knots, values, slope)
    result += (x - inside) * np.where(x > inside, slope[-1], slope[0])
    return result


def slope_at(table: Array, where: Array) -> Array:
    """Return the derivative of :func:`interpolate`.

    >>> slope_at(np.array([KNOTS, 2 * KNOTS]), np.array([0.123, 10.0])).round(9).tolist()
    [2.0, 2.0]
    """
    knots, values = table
    slope = slopes(knots, values)
    x = np.asarray(where, dtype=float)
    cell = np.clip(np.searchsorted(knots, x, side="right") - 1, 0, len(knots) - 2)
    width, rise = knots[cell + 1] - knots[cell], values[cell + 1] - values[cell]
    t = np.clip((x - knots[cell]) / width, 0.0, 1.0)
    first, last = slope[cell] * width, slope[cell + 1] * width
    found: Array = (first + t * (2 * (3 * rise - 2 * first - last) + 3 * t * (first + last - 2 * rise))) / width
    return found


def invert(table: Array, values_at: Array) -> Array:
    """Return points at which a table (2, M) of knots and non-decreasing values takes the given values, by bisection.

    If the table takes a value in an interval, the result is the upper end of the interval. The exception is the largest
    value: if the last cell is flat, the result is the lower end of this cell. Beyond its ends, the table continues
    linearly; beyond a flat end, results are infinite.

    >>> invert(np.array([KNOTS, 2 * KNOTS]), np.array([0.246])).round(12).tolist()
    [0.123]
    """
    knots, values = table
    slope = slopes(knots, values)
    y = np.asarray(values_at, dtype=float)
    inside = np.clip(y, values[0], values[-1])
    cell = np.clip(np.searchsorted(values, inside, side="right") - 1, 0, len(knots) - 2)
    low, high = np.zeros_like(y), knots[cell + 1] - knots[cell]
    for _ in range(60):
        middle = (low + high) / 2
        below = _cubic(cell, middle, knots, values, slope) < inside
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    result: Array = knots[cell] + (low + high) / 2
    steep = np.where(y > inside, slope[-1], slope[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        beyond = np.where(y == inside, 0.0, (y - inside) / steep)
    result += beyond
    return result


def _cubic(cell: NDArray[np.int64], offset: Array, knots: Array, values: Array, slope: Array) -> Array:
    width = knots[cell + 1] - knots[cell]
    t = offset / width
    rise = values[cell + 1] - values[cell]
    first, last = slope[cell] * width, slope[cell + 1] * width
    # without cancellation: the value at the left plus a cubic of the fraction
    return values[cell] + t * (first + t * ((3 * rise - 2 * first - last) + t * (first + last - 2 * rise)))
