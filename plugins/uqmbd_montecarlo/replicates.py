"""Standard errors from independent replicates of a design."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm
from scipy.stats import t as student

__all__ = ["replicate_errors"]

Array = NDArray[np.float64]


def replicate_errors(response: Array, sizes: list[int], status: NDArray[np.int64]) -> tuple[Array, Array]:
    """Estimate standard errors of mean and standard deviation by leaving out one replicate at a time.

    Points of one Latin hypercube or Sobol' set are not independent, so the usual formulas do not hold; whole replicates
    are independent of one another.

    Parameters
    ----------
    response : array, shape (sample, output, time)
        Replicate after replicate.
    sizes : list of int
        Sizes of the R replicates.
    status : array of int, shape (sample,)
        0: counts; others are left out.

    Returns
    -------
    std_error_mean, std_error_std : array, shape (output, time)
        Jackknife estimates ``sqrt((R - 1) / R sum_r (theta_r - mean theta)^2)``, widened by Student's t of R - 1
        degrees of freedom, so that 1.96 of them hold 95 % as they would with many replicates; NaN with fewer than two.

    References
    ----------
    B. Efron and C. Stein, Annals of Statistics 9 (1981) 586-596.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.arange(8.0).reshape(8, 1, 1)
    >>> error, _ = replicate_errors(x, [2, 2, 2, 2], np.zeros(8, int))
    >>> bool(np.isclose(error[0, 0], 3.182 / 1.960 * np.std([0.5, 2.5, 4.5, 6.5], ddof=1) / 2, rtol=1e-3))
    True
    """
    edges = np.cumsum([0, *sizes])
    fine = status == 0
    center = response[fine].mean(axis=0)
    counts, sums, squares = [], [], []
    for first, last in zip(edges[:-1], edges[1:], strict=True):
        part = response[first:last][fine[first:last]] - center
        if len(part):
            counts.append(len(part))
            sums.append(part.sum(axis=0))
            squares.append((part**2).sum(axis=0))
    if len(counts) < 2:
        unknown = np.full(response.shape[1:], np.nan)
        return unknown, unknown.copy()
    n = (sum(counts) - np.array(counts, dtype=float))[:, None, None]
    total, square = np.array(sums), np.array(squares)
    means = (total.sum(axis=0) - total) / n
    variances = np.maximum((square.sum(axis=0) - square) / n - means**2, 0.0) * n / (n - 1)
    share = (len(counts) - 1) / len(counts)
    widening = student.ppf(0.975, len(counts) - 1) / norm.ppf(0.975)

    def error(estimates: Array) -> Array:
        spread: Array = widening * np.sqrt(share * ((estimates - estimates.mean(axis=0)) ** 2).sum(axis=0))
        return spread

    return error(means), error(np.sqrt(variances))
