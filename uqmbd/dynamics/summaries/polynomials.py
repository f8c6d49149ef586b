"""Polynomials of expressions over the motion of one realisation, for functions of plugins and studies."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uqmbd.compiled import PLACES, SERIES
from uqmbd.typing import Array

__all__ = ["MotionPolynomials"]

_POINTS = 2 * PLACES - 1
"""Places in an interval from -1 to 1 that determine a polynomial."""


@dataclass(frozen=True, eq=False)
class MotionPolynomials:
    """Expressions over the motion of one realisation, as polynomials of degree 7 on successive parts of it.

    Attributes
    ----------
    begin, end : array, shape (P,)
        Begin and end of each part, s. A part begins at the end of the part before it. The parts resolve the
        expressions as `uqmbd.integral` does: to a fiftieth of `rtol`, relative to their largest values.
    coefficients : array, shape (expression, P, 8)
        Chebyshev coefficients of each part, whose time is mapped to -1 to 1. Values may jump between parts.

    Examples
    --------
    The polynomial ``t**2`` between 0 and 2 s, in two parts:

    >>> import numpy as np
    >>> import uqmbd
    >>> series = np.zeros((1, 2, 8))
    >>> series[0, :, :3] = [[0.375, 0.5, 0.125], [2.375, 1.5, 0.125]]
    >>> motion = uqmbd.extend.MotionPolynomials(np.array([0.0, 1.0]), np.array([1.0, 2.0]), series)
    >>> motion.at(np.array([0.5, 1.5]))
    array([[0.25, 2.25]])
    >>> motion.at(np.array([0.5, 1.5]), derivative=1)
    array([[1., 3.]])
    >>> motion.turning_points()
    array([0., 4.])
    """

    begin: Array
    end: Array
    coefficients: Array

    def at(self, times: Array, derivative: int = 0) -> Array:
        """Return values of the expressions, or of their derivatives, at times; a jump has the value after it.

        Parameters
        ----------
        times : array, shape (N,)
            Times within the motion, s.
        derivative : int
            Order of the derivative.

        Returns
        -------
        array, shape (expression, N)
            Values, per s for each order of the derivative. A derivative contains the error of the values divided by
            the length of the part, which matters in very short first steps. Integrals of a derivative do not contain
            this factor.
        """
        part = np.clip(np.searchsorted(self.begin, times, side="right") - 1, 0, len(self.begin) - 1)
        length = np.where(self.end > self.begin, self.end - self.begin, 1.0)[part]  # a run of a single time
        place = 2 * (np.asarray(times) - self.begin[part]) / length - 1
        series = np.polynomial.chebyshev.chebder(self.coefficients, derivative, axis=-1)
        found = np.polynomial.chebyshev.chebval(place, np.moveaxis(series[:, part], -1, 0), tensor=False)
        return np.asarray(found * (2 / length) ** derivative)

    def between(self, begin: float, end: float) -> MotionPolynomials:
        """Return the motion between two times.

        Parameters
        ----------
        begin, end : float
            Times, s; the ends of the motion replace times outside of it.

        Returns
        -------
        MotionPolynomials
            Motion with the parts between the times; parts at their ends are cut.
        """
        low, high = np.maximum(self.begin, begin), np.minimum(self.end, end)
        some = np.flatnonzero(high > low)
        low, high, first, last = low[some], high[some], self.begin[some], self.end[some]
        series = self.coefficients[:, some].copy()
        for k in np.flatnonzero((low > first) | (high < last)).tolist():
            times = low[k] + 0.5 * (1 + _POINTS) * (high[k] - low[k])
            place = 2 * (times - first[k]) / (last[k] - first[k]) - 1
            values = np.polynomial.chebyshev.chebval(place, series[:, k].T)
            series[:, k] = values @ SERIES
        return MotionPolynomials(low, high, series)

    def turning_points(self, expression: int = 0) -> Array:
        """Return the first value, all successive local extremes and the last value of an expression.

        Parameters
        ----------
        expression : int
            Index of the expression.

        Returns
        -------
        array
            Values that rise and fall alternately, with both sides of jumps. Reversals of less than 1e-7 of the largest
            value are omitted: polynomials of successive parts differ by their errors.
        """
        series = self.coefficients[expression]
        fine = np.cos(np.linspace(np.pi, 0, FINEST))
        values = np.polynomial.chebyshev.chebval(fine, series.T)
        middle = values[:, 1:-1]
        peak = (middle - values[:, :-2]) * (middle - values[:, 2:]) > 0
        part, place = np.nonzero(peak)
        values[part, place + 1] = _extremes(series[part], fine[place], fine[place + 2])
        every = values.ravel()
        turns = np.diff(np.sign(np.diff(every))) != 0
        return _without_small_reversals(every[np.concatenate([[True], turns, [True]])])


NEGLIGIBLE = 1e-7
"""Reversal, relative to the largest value, that counts as an error of polynomials."""

FINEST = 33
"""Places in each part at which extremes are searched; a polynomial of degree 7 has at most six."""

ROUNDS = 40
"""Bisections of an interval that contains an extreme."""


def _extremes(series: Array, low: Array, high: Array) -> Array:
    """Return the extremes (E,) of polynomials (E, 8) between places (E,)."""
    slope = np.polynomial.chebyshev.chebder(series, axis=-1).T
    rising = np.polynomial.chebyshev.chebval(low, slope, tensor=False) > 0
    for _ in range(ROUNDS):
        middle = 0.5 * (low + high)
        before = (np.polynomial.chebyshev.chebval(middle, slope, tensor=False) > 0) == rising
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return np.asarray(np.polynomial.chebyshev.chebval(0.5 * (low + high), series.T, tensor=False))


def _without_small_reversals(values: Array) -> Array:
    """Return the turning points of values whose reversals are not negligible."""
    least = NEGLIGIBLE * float(np.abs(values).max())
    found, latest, direction = [float(values[0])], float(values[0]), 0.0
    for value in values[1:].tolist():
        step = value - latest
        if direction == 0 and abs(step) <= least:
            continue
        if step * direction < 0:
            if abs(step) <= least:
                continue
            found.append(latest)
        latest, direction = value, direction if step * direction > 0 or step == 0 else math.copysign(1.0, step)
    return np.array(found if direction == 0 else [*found, latest])
