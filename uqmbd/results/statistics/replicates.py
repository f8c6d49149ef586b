"""Standard errors from independent replicates of a design."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uqmbd.results.statistics.moments import Moments
from uqmbd.typing import Array

__all__ = ["replicate_errors", "studentised"]


def replicate_errors(replicates: Sequence[Moments]) -> tuple[Array, Array]:
    """Estimate standard errors of mean and standard deviation by leaving out one replicate at a time.

    Points of one Latin hypercube or Sobol' set are not independent, so the usual formulas do not hold; whole replicates
    are independent of one another.

    Parameters
    ----------
    replicates : sequence of uqmbd.results.Moments
        Moments of the successful samples of each of R replicates, of shape (...), commonly (output, time).

    Returns
    -------
    std_error_mean, std_error_std : array, shape (...)
        Jackknife estimates ``sqrt((R - 1) / R sum_r (theta_r - mean theta)^2)``, widened by Student's t of R - 1
        degrees of freedom, so that 1.96 of them hold 95 % as they would with many replicates; NaN with fewer than two
        replicates, that of the standard deviation also where one of them has all samples but one.

    References
    ----------
    B. Efron and C. Stein, Annals of Statistics 9 (1981) 586-596.

    Examples
    --------
    >>> import numpy as np
    >>> from uqmbd.results import Moments
    >>> error, _ = replicate_errors([Moments.of([[[x]], [[x + 1.0]]]) for x in (0.0, 2.0, 4.0, 6.0)])
    >>> bool(np.isclose(error[0, 0], 3.182 / 1.960 * np.std([0.5, 2.5, 4.5, 6.5], ddof=1) / 2, rtol=1e-3))
    True
    """
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
    # one sample that is left has no spread
    bessel = np.where(n > 1, n / np.maximum(n - 1, 1.0), np.nan)
    variances = np.maximum((second.sum(axis=0) - second) / n - means**2, 0.0) * bessel
    share = (len(used) - 1) / len(used)
    widening = studentised(len(used))

    def error(estimates: Array) -> Array:
        spread: Array = widening * np.sqrt(share * ((estimates - estimates.mean(axis=0)) ** 2).sum(axis=0))
        return spread

    return error(means), error(np.sqrt(variances))


def studentised(replicates: int) -> float:
    """Return by how much a standard error of so many replicates is widened, so that 1.96 of them hold 95 %.

    Examples
    --------
    >>> round(studentised(4), 3), round(studentised(10_000), 3)
    (1.624, 1.0)
    """
    from scipy.special import ndtri, stdtrit

    return float(stdtrit(replicates - 1, 0.975) / ndtri(0.975))
