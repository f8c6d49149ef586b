"""Interpolate outputs of realisations over time: splines through evenly spaced values, with an error estimate."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from uqmbd.arguments import Count, NotNegativeOrInfinite, Size, shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.propagation.problem import Problem, Realisations
from uqmbd.typing import Array

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

__all__ = ["Dense", "dense", "spline_through"]


DEGREE = 7
"""Degree of the splines: their error is proportional to the eighth power of the time step."""

RESOLVED = 1e-5
"""Error limit of a spline through every second value, relative to the range of an output.

The error of the spline through all values is 2^8 times smaller.
"""

BETWEEN = 0.9
"""Share of the times at which the error must be below its limit if there are events."""

ACCEPTABLE = 1e-3
"""Error limit, as `RESOLVED`, for outputs with kinks that no admissible number of times resolves."""

UNSEEN = 0.1
"""Error above which a spline does not represent the output, so that its order of convergence is unknown."""

GROWTH = 4
"""Maximum factor between successive numbers of times; the minimum is 1.5."""

FIRST, MOST = 1024, 1 << 17
"""First and maximum number of times."""

NUMBERS = 1 << 26
"""Maximum number of values (8 bytes each) of all realisations in memory."""


@typechecked
@dataclass(frozen=True, eq=False)
class Dense:
    """Outputs of K realisations as functions of time.

    Attributes
    ----------
    times : array, shape (T,)
        Times, s, evenly spaced.
    values : array, shape (K, O, T)
        Outputs; NaN for failed realisations.
    error : float
        Largest estimated interpolation error, relative to the range of the output.
    asked : array, shape (K, O, N), optional
        Outputs at N further requested times, computed by the integration instead of the interpolation.
    integrations : int
        Number of integrations of each realisation; each has more times than the previous one.

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
            If an index is out of range.
        """
        self._require(rows)
        chosen = np.asarray(rows, dtype=np.intp)
        return replace(self, values=self.values[chosen], asked=None if self.asked is None else self.asked[chosen])

    def spline(self, k: Size) -> BSpline:
        """Return the outputs of one realisation as a function that maps times (N,) in s to values (N, O).

        Raises
        ------
        uqmbd.StudyError
            If there is no such realisation.
        """
        self._require([k])
        return self.through(self.values[k].T)

    def _require(self, rows: Sequence[int]) -> None:
        """Reject indices of realisations that do not exist."""
        count = len(self.values)
        for k in rows:
            if not -count <= k < count:
                raise StudyError(
                    f"Dense: the number of the realisation is {k}; expected a number from 0 to {count - 1}."
                )

    def through(self, values: Array) -> BSpline:
        """Return the spline through values (T,) or (T, N) at the times of the realisations.

        Raises
        ------
        uqmbd.StudyError
            If there are too few times, if the times do not increase, or if values have another shape or are not finite.
        """
        times = self.times
        if len(times) <= DEGREE or not (np.diff(times) > 0).all():
            raise StudyError(f"Dense: times is {shown(times)}; expected at least {DEGREE + 1} increasing times.")
        if values.ndim not in (1, 2) or len(values) != len(times) or not np.isfinite(values).all():
            raise StudyError(
                f"Dense.through: values is {shown(values)}; expected finite numbers of the shape ({len(times)},) or "
                f"({len(times)}, N)."
            )
        return spline_through(times, values)


@typechecked
def dense(
    problem: Problem,
    values: Array,
    end: float,
    least: Size = 0,
    asked: Array | None = None,
    worth: Callable[[Dense], bool] | None = None,
) -> tuple[Dense, Realisations]:
    """Compute realisations at as many times as accurate splines need.

    Parameters
    ----------
    problem : uqmbd.extend.Problem
        Problem that computes the realisations, starting at its first time.
    values : array, shape (K, input)
        Inputs of the realisations.
    end : float
        Last time, s.
    least : int
        Smallest number of times in the first integration.
    asked : array, shape (N,), optional
        Further times in s at which the integration provides outputs without interpolation.
    worth : callable, optional
        Function that returns whether more times justify their cost; the default is always true. The arguments of the
        function are realisations whose splines are within 10 % of the range of an output, but not accurate.

    Returns
    -------
    Dense
        Realisations as functions of time, with the estimated error. The error may be large: the accuracy of outputs
        with kinks is at best 0.1 %.
    uqmbd.extend.Realisations
        Realisations as computed.

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
    >>> found, realisations = uqmbd.extend.dense(problem, np.array([[6.0], [7.0]]), end=2.0)
    >>> found.spline(1)(0.3).round(4).tolist(), bool(realisations.good.all())  # 7 rad/s for 0.3 s
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
        # splines never resolve kinks and jumps at events, so only the error at most of the times counts
        between = bool(problem.model.events) and errors[1].size > 0
        coarse, fine = (_largest(np.quantile(x, BETWEEN, axis=0) if between else x) for x in errors)
        following = _next(count, coarse, fine, most)
        if following is None:
            break
        if worth is not None and fine <= UNSEEN and not worth(Dense(times, evenly, fine)):
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
    """Return the next number of times, from the errors with the current number and half of it.

    Return None if the error is small enough, if the current number is the largest, or if more times cannot help.

    Errors of smooth outputs follow the order of the splines. Errors at kinks may decrease so slowly that no admissible
    number of times resolves them. The next number of times then makes the error acceptable, if possible.
    """
    if error <= RESOLVED or count >= most:
        return None
    if error > UNSEEN:
        return min(most, GROWTH * count)
    order = _order(coarser, error)
    last = error * (count / most) ** order
    limit = ACCEPTABLE if last > RESOLVED else RESOLVED
    if error <= limit or last > ACCEPTABLE:
        return None
    factor = (error / limit) ** (1 / max(order, 1.0))
    return min(most, int(count * np.clip(1.1 * factor, 1.5, GROWTH)))


def _order(coarser: float, error: float) -> float:
    """Return the observed order of convergence with the time step, at most the order of the splines."""
    return float(np.clip(np.log2(max(coarser, 1e-300) / max(error, 1e-300)), 0.0, DEGREE + 1))


def _error(times: Array, values: Array) -> Array:
    """Return the errors (N, KO) of splines through every second value (K, O, T), relative to the range of outputs."""
    if not len(values):
        return np.zeros((0, 0))
    rows = values.reshape(-1, len(times)).T
    half = spline_through(times[::2], rows[::2])
    inside = slice(DEGREE, len(times) - DEGREE, 2)
    wrong = np.abs(half(times[inside]) - rows[inside])
    size = np.ptp(rows, axis=0).reshape(values.shape[:2]).max(axis=0)
    scale = np.broadcast_to(np.where(size > 0, size, 1.0), values.shape[:2]).ravel()
    return np.asarray(wrong / scale)
