"""Estimate standard errors from independent replicates of a design."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.results.statistics.moments import NORMAL, Moments, divisor
from uqmbd.typing import Array

__all__ = ["replicate_errors", "studentised"]


@typechecked
def replicate_errors(replicates: Sequence[Moments]) -> tuple[Array, Array]:
    """Estimate standard errors of mean and standard deviation by leaving out one replicate at a time.

    Points of one Latin hypercube or Sobol' set are not independent, so the usual formulas are not valid. Whole
    replicates are independent of one another.

    Parameters
    ----------
    replicates : sequence of uqmbd.extend.Moments
        Moments of the successful samples of each of R replicates, of shape (...), commonly (output, time).

    Returns
    -------
    std_error_mean, std_error_std : array, shape (...)
        Standard errors, widened so that 1.96 of them give a 95 % interval as for many replicates. NaN with fewer than
        two replicates. ``std_error_std`` is also NaN if one replicate has all samples but one.

    Raises
    ------
    uqmbd.StudyError
        If there are no replicates.

    Notes
    -----
    The jackknife error [1]_, ``sqrt((R - 1) / R sum_r (theta_r - mean theta)^2)``, is widened in three steps.

    First, Student's t of R - 1 degrees of freedom accounts for the small number of replicates.

    Second, if replicates are skewed, as for few points of a long tail, t is increased by ``g (1 + 2 t^2) / (6
    sqrt(R))``. A skewness g moves an end of the interval by at most this amount [2]_. Here g is the sum of two terms.
    The first term is the skewness of the replicates minus ``sqrt(6 / R)``, the random skewness of normal replicates.
    The second term is the skewness of the samples. It is needed because few replicates rarely include an outlier. If a
    distribution has a long tail, the outermost points of a design cause most of the sampling error. Means of replicates
    are therefore about as skewed as the samples. For a standard deviation, the skewness of squared samples is taken as
    ``sqrt((2.5 (k - 3))^2 / (k - 1) + 2 g^2)``. Here k and g are kurtosis and skewness of the samples, and k - 3 is at
    least 0;
    `docs/explanation/stated_errors.md` contains measurements of the formula.

    Third, the error of a standard deviation s is proportional to the true value, which is above s more often than
    below. A half-width x, relative to s, therefore becomes ``exp(x + x^2) - 1``. To second order, this is the upper end
    of an interval whose width is proportional to the true value.

    References
    ----------
    .. [1] B. Efron and C. Stein, Annals of Statistics 9 (1981) 586-596.
    .. [2] N. J. Johnson, Journal of the American Statistical Association 73 (1978) 536-544.

    Examples
    --------
    >>> import numpy as np
    >>> from uqmbd.extend import Moments
    >>> error, _ = replicate_errors([Moments.of([[[x]], [[x + 1.0]]]) for x in (0.0, 2.0, 4.0, 6.0)])
    >>> bool(np.isclose(error[0, 0], 3.182 / 1.960 * np.std([0.5, 2.5, 4.5, 6.5], ddof=1) / 2, rtol=1e-3))
    True
    """
    if not len(replicates):
        raise StudyError("replicate_errors: no replicates are given; expected at least one.")
    used = [r for r in replicates if r.count]
    if len(used) < 2:
        unknown = np.full(replicates[0].mean.shape, np.nan)
        return unknown, unknown.copy()
    center = np.mean([r.mean for r in used], axis=0)
    counts = np.array([r.count for r in used], dtype=float).reshape(-1, *[1] * center.ndim)
    first = np.array([r.count * (r.mean - center) for r in used])
    second = np.array([r.second + r.count * (r.mean - center) ** 2 for r in used])
    n = counts.sum() - counts
    means = (first.sum(axis=0) - first) / n
    # a single remaining sample has no standard deviation
    variances = np.where(n > 1, np.maximum((second.sum(axis=0) - second) / n - means**2, 0.0), np.nan)
    total = counts.sum()
    whole = np.maximum(second.sum(axis=0) / total - (first.sum(axis=0) / total) ** 2, 0.0)
    samples = reduce(Moments.merge, used).statistics(independent=False)
    skewness = np.abs(samples["skewness"])
    kurtosis = np.maximum(samples["kurtosis"], 3.0)
    of_squares = np.sqrt((2.5 * (kurtosis - 3.0)) ** 2 / (kurtosis - 1.0) + 2.0 * skewness**2)
    half_widths = _half_width(means, skewness), _half_width(np.sqrt(variances), of_squares)
    return half_widths[0] / NORMAL, _of_proportion(half_widths[1], np.sqrt(whole)) / NORMAL


def _half_width(estimates: Array, of_samples: Array) -> Array:
    """Return the half-width (...) of the 95 % interval from R leave-one-out estimates (R, ...).

    `of_samples` (...): skewness of the contributions of single samples to the estimate.
    """
    count = len(estimates)
    off = estimates - estimates.mean(axis=0)
    unit = divisor(np.abs(off).max(axis=0))
    off = off / unit
    square = (off**2).mean(axis=0)
    skewness = np.abs((off**3).mean(axis=0)) / divisor(square**1.5)
    reach = NORMAL * studentised(count)
    # subtract the standard deviation of the skewness of normal replicates
    skewness = np.maximum(skewness - np.sqrt(6.0 / count), 0.0) + of_samples
    reach = reach + skewness * (1.0 + 2.0 * reach**2) / (6.0 * np.sqrt(count))
    return np.asarray(unit * reach * np.sqrt((count - 1) * square))


def _of_proportion(half_width: Array, std: Array) -> Array:
    """Return the upper side (...) of the interval of a standard deviation from a symmetric half-width (...)."""
    share = np.minimum(half_width / divisor(std), 1.0)
    return np.asarray(np.maximum(half_width, std * np.expm1(share + share**2)))


def studentised(replicates: int) -> float:
    """Return the factor for a standard error from `replicates`, so that 1.96 errors give a 95 % interval.

    >>> round(studentised(4), 3), round(studentised(10_000), 3)
    (1.624, 1.0)
    """
    from scipy.special import ndtri, stdtrit

    return float(stdtrit(replicates - 1, 0.975) / ndtri(0.975))
