"""Outputs of realisations between their times: splines through evenly spaced values, with their error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from uqmbd.propagation.problem import Problem, Realisations
from uqmbd.typing import Array

__all__ = ["Dense", "dense"]


DEGREE = 7
"""Of the splines: their error falls with the eighth power of the distance of values."""

RESOLVED = 1e-5
"""Error of a spline through every second value, over the range of an output: that through all is 2^8 times better."""

BETWEEN = 0.9
"""Share of the times that decides where there are events."""

FIRST, MOST = 1024, 1 << 17
"""Times that are tried first, and at most."""

NUMBERS = 1 << 26
"""Values (8 bytes each) of all realisations that are held at once."""


@dataclass(frozen=True, eq=False)
class Dense:
    """Outputs of K realisations as functions of time.

    Attributes
    ----------
    times : array, shape (T,)
        Evenly spaced, s.
    values : array, shape (K, O, T)
        NaN where a realisation failed.
    error : float
        Estimated error of the interpolation, over the range of an output: the largest.
    asked : array, shape (K, O, N), optional
        Outputs at other times that were asked for, computed and not interpolated.
    """

    times: Array
    values: Array
    error: float
    asked: Array | None = None

    degree: ClassVar[int] = DEGREE

    def of(self, rows: Sequence[int]) -> Dense:
        """Return some of the realisations."""
        return replace(self, values=self.values[rows], asked=None if self.asked is None else self.asked[rows])

    def spline(self, k: int) -> BSpline:
        """Return the outputs of one realisation as a function from times (N,) to (N, O)."""
        return make_interp_spline(self.times, self.values[k].T, DEGREE)


def dense(
    problem: Problem, values: Array, end: float, least: int = 0, asked: Array | None = None
) -> tuple[Dense, Realisations]:
    """Compute realisations at so many times that splines through them are accurate.

    Parameters
    ----------
    problem : uqmbd.Problem
        Who computes them; from its first time on.
    values : array, shape (K, input)
        Inputs.
    end : float
        Last time, s.
    least : int
        Times that are tried first, at least.
    asked : array, shape (N,), optional
        Further times, at which outputs are wanted as they are computed.

    Returns
    -------
    Dense
        With the estimated error, where it is not small too: outputs that have kinks are never resolved.
    uqmbd.Realisations
        As they were computed.
    """
    rows = problem.labels.shape[0]
    least = max(least, FIRST)
    most = max(least, min(MOST, NUMBERS // max(1, len(values) * rows)))
    count = least
    while True:
        times = np.linspace(float(problem.times[0]), end, count)
        every = times if asked is None else np.union1d(times, asked)
        found = problem.watching(every).realise(values)
        evenly = found.response[..., np.searchsorted(every, times)]
        wrong = _error(times, evenly[found.good])
        # kinks and jumps at events are never resolved; what lies between them is, where it is so at most times
        decisive = np.quantile(wrong, BETWEEN, axis=0) if problem.model.events and len(wrong) else wrong
        if decisive.max(initial=0.0) <= RESOLVED or 2 * count > most:
            others = None if asked is None else found.response[..., np.searchsorted(every, asked)]
            return Dense(times, evenly, float(wrong.max(initial=0.0)) / 2 ** (DEGREE + 1), others), found
        count *= 2


def _error(times: Array, values: Array) -> Array:
    """Errors of splines through every second value (K, O, T), at the others, over the range of each output: (N, KO)."""
    if not len(values):
        return np.zeros((0, 0))
    rows = values.reshape(-1, len(times)).T
    half = make_interp_spline(times[::2], rows[::2], DEGREE)
    inside = slice(DEGREE, len(times) - DEGREE, 2)
    wrong = np.abs(half(times[inside]) - rows[inside])
    size = np.ptp(rows, axis=0).reshape(values.shape[:2]).max(axis=0)
    scale = np.broadcast_to(np.where(size > 0, size, 1.0), values.shape[:2]).ravel()
    return np.asarray(wrong / scale)
