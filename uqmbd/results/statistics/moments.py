"""Moments that are gathered chunk by chunk, in memory that does not grow with the number of samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.arguments import Size, shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.typing import Array

__all__ = ["NORMAL", "Moments", "independent_errors", "usual_errors"]


NORMAL = 1.959963984540054
"""Standard errors from the middle of a 95 % interval to its ends, of a normal distribution."""

RAISED = 3.0
"""Relative standard errors of the variance by which its own variance may be too small."""


@typechecked
@dataclass(frozen=True)
class Moments:
    """Number, mean and central sums of samples; two of them merge into that of all samples.

    Attributes
    ----------
    count : int
        Number of samples.
    mean : array, shape (...)
        Their mean.
    second, third, fourth : array, shape (...)
        Sums of powers of the differences from the mean.

    References
    ----------
    P. Pebay, Formulas for robust, one-pass parallel computation of covariances and arbitrary-order statistical
    moments, Sandia report SAND2008-6212 (2008).

    Examples
    --------
    >>> whole = Moments.of([[1.0], [2.0], [6.0], [7.0]])
    >>> merged = Moments.of([[1.0], [2.0]]).merge(Moments.of([[6.0], [7.0]]))
    >>> bool(np.isclose(whole.fourth, merged.fourth).all())
    True
    """

    count: Size
    mean: Array
    second: Array
    third: Array
    fourth: Array

    @classmethod
    def of(cls, samples: ArrayLike) -> Moments:
        """Gather samples, shape (S, ...); S may be zero.

        Raises
        ------
        uqmbd.StudyError
            If the samples are one number.
        """
        x = np.asarray(samples, dtype=float)
        if not x.ndim:
            raise StudyError(f"Moments.of: samples is {shown(samples)}; expected samples of the shape (S, ...).")
        if not len(x):
            zero = np.zeros(x.shape[1:])
            return cls(0, zero, zero, zero, zero)
        # shifted by the first sample: no cancellation for a small spread about a large mean
        mean = x[0] + (x - x[0]).mean(axis=0)
        d = x - mean
        square = d * d
        return cls(len(x), mean, square.sum(axis=0), (square * d).sum(axis=0), (square * square).sum(axis=0))

    def merge(self, other: Moments) -> Moments:
        """Gather the samples of both."""
        if not self.count or not other.count:
            return other if not self.count else self
        a, b = self.count, other.count
        n = a + b
        d = other.mean - self.mean
        second = self.second + other.second + d**2 * a * b / n
        third = (
            self.third + other.third + d**3 * a * b * (a - b) / n**2 + 3 * d * (a * other.second - b * self.second) / n
        )
        fourth = (
            self.fourth
            + other.fourth
            + d**4 * a * b * (a * a - a * b + b * b) / n**3
            + 6 * d**2 * (a * a * other.second + b * b * self.second) / n**2
            + 4 * d * (a * other.third - b * self.third) / n
        )
        return Moments(n, self.mean + d * b / n, second, third, fourth)

    def statistics(self, independent: bool = True) -> dict[str, Array]:
        """Compute the statistics of `uqmbd.results.sample_statistics`, except quantiles.

        Parameters
        ----------
        independent : bool
            As of `uqmbd.results.sample_statistics`.

        Returns
        -------
        dict
            ``mean, std, variance, skewness, kurtosis, std_error_mean, std_error_std``, each of shape (...).

        Raises
        ------
        uqmbd.StudyError
            With fewer than two samples.
        """
        n = self.count
        if n < 2:
            raise StudyError(f"Statistics need at least two successful samples; there are {n}.")
        variance = self.second / (n - 1 if independent else n)
        m2, m3, m4 = self.second / n, self.third / n, self.fourth / n
        constant = m2 <= (32 * np.finfo(float).eps * np.abs(self.mean)) ** 2
        safe = np.where(constant, 1.0, m2)
        std = np.sqrt(variance)
        skewness, kurtosis = np.where(constant, 0.0, m3 / safe**1.5), np.where(constant, 3.0, m4 / safe**2)
        unknown = np.full_like(std, np.nan)
        errors = independent_errors(std, skewness, kurtosis, n) if independent else (unknown, unknown.copy())
        return {
            "mean": self.mean,
            "std": std,
            "variance": variance,
            "skewness": skewness,
            "kurtosis": kurtosis,
            "std_error_mean": errors[0],
            "std_error_std": errors[1],
        }


def independent_errors(std: Array, skewness: Array, kurtosis: Array, count: Any) -> tuple[Array, Array]:
    """Return standard errors of mean and standard deviation of independent samples, so that 1.96 of each hold 95 %.

    `std`: from the unbiased variance, in any units; `skewness`, `kurtosis`: of the samples (divisor `count`; 3 for a
    normal distribution); `count`: number n of samples, two at least. Return in the units of `std`; 0 where nothing
    varies.

    The mean has the interval of Student's t with Johnson's term for a skewness g, for the worse of its ends [1]_:
    ``s / sqrt(n) (t + g (1 + 2 t^2) / (6 sqrt(n)))``.

    The variance is taken as a multiple of chi-square with ``2 / v`` degrees of freedom [2]_. Here v is its relative
    variance, from the kurtosis [3]_; with a kurtosis of 3 and without the raise below, it is the exact interval of
    normal samples. The error is how far above s its upper end is, since the true deviation is above s more often than
    below. Few samples of a long tail have too small a kurtosis, and mostly where s is too small as well. The kurtosis
    less one is therefore raised by three times the relative standard error of the variance. In this error the square of
    the skewness counts once more. The factor of three was chosen by experiment: with two, intervals of ``z^2`` and
    ``exp(z / 2)`` of 30 normal samples z hold in less than 93 %.

    .. [1] N. J. Johnson, Journal of the American Statistical Association 73 (1978) 536-544.
    .. [2] G. E. P. Box, Biometrika 40 (1953) 318-335.
    .. [3] D. G. Bonett, Computational Statistics and Data Analysis 50 (2006) 775-782.
    """
    from scipy.special import chdtri, stdtrit

    n = np.asarray(count, dtype=float)
    t = stdtrit(n - 1.0, 0.975)
    of_mean = std / np.sqrt(n) * (t + np.abs(skewness) * (1.0 + 2.0 * t**2) / (6.0 * np.sqrt(n)))
    raised = 1.0 + RAISED * np.sqrt((kurtosis - 1.0 + skewness**2) / n)
    # by the same divisor as the variance: else the two nearly cancel where the kurtosis is near 1, as of two values
    excess = np.maximum(kurtosis * (n / (n - 1.0)) ** 2 - 1.0, 0.0)
    relative = (excess * raised + 2.0 / (n - 1.0)) / n
    # less than one squared deviation is no sample
    freedom = np.maximum(2.0 / relative, 1.0)
    of_std = std * (np.sqrt(freedom / chdtri(freedom, 0.975)) - 1.0)
    return np.asarray(of_mean / NORMAL), np.asarray(of_std / NORMAL)


def usual_errors(std: Array, kurtosis: Array, count: Any) -> tuple[Array, Array]:
    """Return the usual standard errors of mean and standard deviation of independent samples, which are not widened.

    Of mean and variance they are exact for any distribution; 1.96 of them hold 95 % of many samples with short tails.

    `std`, `kurtosis`, `count`: as of `independent_errors`.
    """
    n = np.asarray(count, dtype=float)
    excess = np.maximum(kurtosis * (n / (n - 1.0)) ** 2 - 1.0, 0.0)
    return np.asarray(std / np.sqrt(n)), np.asarray(std * np.sqrt((excess + 2.0 / (n - 1.0)) / n) / 2.0)
