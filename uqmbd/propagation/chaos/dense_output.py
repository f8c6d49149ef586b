"""Outputs of realisations between their times: splines through evenly spaced values, with their error."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from uqmbd.arguments import Count, NotNegativeOrInfinite, Size, typechecked
from uqmbd.errors import StudyError
from uqmbd.propagation.problem import Problem, Realisations
from uqmbd.typing import Array

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

__all__ = ["Dense", "dense", "spline_through"]


DEGREE = 7
"""Of the splines: their error falls with the eighth power of the distance of values."""

RESOLVED = 1e-5
"""Error of a spline through every second value, over the range of an output: that through all is 2^8 times better."""

BETWEEN = 0.9
"""Share of the times that decides where there are events."""

ACCEPTABLE = 1e-3
"""The same, where outputs have kinks, and more times than there may be would not resolve them."""

UNSEEN = 0.1
"""Error of a spline that misses what there is: from it no order is seen."""

GROWTH = 4
"""By how much more times are tried next, at most, and at least 1.5 times as many."""

FIRST, MOST = 1024, 1 << 17
"""Times that are tried first, and at most."""

NUMBERS = 1 << 26
"""Values (8 bytes each) of all realisations that are held at once."""


@typechecked
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
    integrations : int
        How often each realisation was integrated, at more times again.

    Examples
    --------
    >>> import numpy as np
    >>> import uqmbd
    >>> times = np.linspace(0, 2, 41)
    >>> found = uqmbd.extend.Dense(times, np.sin(times)[None, None, :], error=1e-6)
    >>> found.spline(0)([0.5, 1.5]).round(4).ravel().tolist()  # sin(0.5), sin(1.5)
    [0.4794, 0.9975]
    >>> len(found.of([0]).values)
    1
    """

    times: Array
    values: Array
    error: NotNegativeOrInfinite
    asked: Array | None = None
    integrations: Count = 1

    degree: ClassVar[int] = DEGREE

    def of(self, rows: Sequence[int]) -> Dense:
        """Return some of the realisations.

        Raises
        ------
        uqmbd.StudyError
            If there is no such realisation.
        """
        self._require(rows)
        chosen = np.asarray(rows, dtype=np.intp)
        return replace(self, values=self.values[chosen], asked=None if self.asked is None else self.asked[chosen])

    def spline(self, k: Size) -> BSpline:
        """Return the outputs of one realisation as a function from times (N,) to (N, O).

        Raises
        ------
        uqmbd.StudyError
            If there is no such realisation.
        """
        self._require([k])
        return self.through(self.values[k].T)

    def _require(self, rows: Sequence[int]) -> None:
        """Refuse numbers of realisations that there are not."""
        count = len(self.values)
        for k in rows:
            if not -count <= k < count:
                raise StudyError(f"Dense: realisation {k} is asked for; expected a number from 0 to {count - 1}.")

    def through(self, values: Array) -> BSpline:
        """Return the spline through values (T,) or (T, N) at the times."""
        return spline_through(self.times, values)


@typechecked
def dense(
    problem: Problem, values: Array, end: float, least: Size = 0, asked: Array | None = None
) -> tuple[Dense, Realisations]:
    """Compute realisations at so many times that splines through them are accurate.

    Parameters
    ----------
    problem : uqmbd.extend.Problem
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
        With the estimated error, where it is not small too: outputs that have kinks are resolved to 0.1 % at best.
    uqmbd.extend.Realisations
        As they were computed.

    Examples
    --------
    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(6, 7), units="rad/s")
    >>> mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    >>> wheel = mechanism.body("wheel", mass=1, inertia=1, angular_velocity=speed)
    >>> mechanism.output("angle", wheel.angle, units="rad")
    >>> study = uqmbd.Study("turning", mechanism, np.linspace(0, 2, 5), [Collocation(order=1)])
    >>> problem = study.problem(study.propagators[0])
    >>> found, told = uqmbd.extend.dense(problem, np.array([[6.0], [7.0]]), end=2.0)
    >>> found.spline(1)(0.3).round(4).tolist(), bool(told.good.all())  # 7 rad/s for 0.3 s
    ([2.1], True)
    """
    rows = problem.labels.shape[0]
    least = max(least, FIRST)
    most = max(least, min(MOST, NUMBERS // max(1, len(values) * rows)))
    tried, spent, count = 0, Counter[str](), least
    while True:
        times = np.linspace(float(problem.times[0]), end, count)
        every = times if asked is None else np.union1d(times, asked)
        found = problem.watching(every).realise(values)
        tried += 1
        spent.update(found.counters)
        evenly = found.response[..., np.searchsorted(every, times)]
        errors = [_error(times[::step], evenly[found.good][..., ::step]) for step in (2, 1)]
        # kinks and jumps at events are never resolved; what lies between them is, where it is so at most times
        between = bool(problem.model.events) and errors[1].size > 0
        coarse, fine = (_largest(np.quantile(x, BETWEEN, axis=0) if between else x) for x in errors)
        following = _next(count, coarse, fine, most)
        if following is None:
            break
        count = following
    others = None if asked is None else found.response[..., np.searchsorted(every, asked)]
    coarser, error = map(_largest, errors)
    left = error / 2 ** _order(coarser, error)
    return Dense(times, evenly, left, others, tried), replace(found, counters=dict(spent))


def spline_through(times: Array, values: Array) -> BSpline:
    """Return the spline through values (T,) or (T, N)."""
    from scipy.interpolate import make_interp_spline

    return make_interp_spline(times, values, DEGREE)


def _largest(wrong: Array) -> float:
    return float(wrong.max(initial=0.0))


def _next(count: int, coarser: float, error: float, most: int) -> int | None:
    """Return how many times are tried next, after so many with their error, and that of half as many; none: enough.

    Smooth outputs follow the order of the splines. Errors may fall so slowly that no admissible number of times
    resolves them (kinks). Then the number is chosen that makes them acceptable, if any does.
    """
    if error <= RESOLVED or count >= most:
        return None
    if error > UNSEEN:
        return min(most, GROWTH * count)
    order = _order(coarser, error)
    last = error * (count / most) ** order
    wanted = ACCEPTABLE if last > RESOLVED else RESOLVED
    if error <= wanted or last > ACCEPTABLE:
        return None
    factor = (error / wanted) ** (1 / max(order, 1.0))
    return min(most, int(count * np.clip(1.1 * factor, 1.5, GROWTH)))


def _order(coarser: float, error: float) -> float:
    """Return with which power of the distance of times an error falls, at most that of the splines."""
    return float(np.clip(np.log2(max(coarser, 1e-300) / max(error, 1e-300)), 0.0, DEGREE + 1))


def _error(times: Array, values: Array) -> Array:
    """Errors of splines through every second value (K, O, T), at the others, over the range of each output: (N, KO)."""
    if not len(values):
        return np.zeros((0, 0))
    rows = values.reshape(-1, len(times)).T
    half = spline_through(times[::2], rows[::2])
    inside = slice(DEGREE, len(times) - DEGREE, 2)
    wrong = np.abs(half(times[inside]) - rows[inside])
    size = np.ptp(rows, axis=0).reshape(values.shape[:2]).max(axis=0)
    scale = np.broadcast_to(np.where(size > 0, size, 1.0), values.shape[:2]).ravel()
    return np.asarray(wrong / scale)
