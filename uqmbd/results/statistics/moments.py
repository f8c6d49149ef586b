"""Moments that are gathered chunk by chunk, in memory that does not grow with the number of samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.errors import StudyError
from uqmbd.results.statistics.scaling import divisor
from uqmbd.typing import Array

__all__ = ["Moments", "error_of_std"]


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

    count: int
    mean: Array
    second: Array
    third: Array
    fourth: Array

    @classmethod
    def of(cls, samples: ArrayLike) -> Moments:
        """Gather samples, shape (S, ...); S may be zero."""
        x = np.asarray(samples, dtype=float)
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
        """Compute what `uqmbd.results.sample_statistics` does, but for quantiles.

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
        return {
            "mean": self.mean,
            "std": std,
            "variance": variance,
            "skewness": np.where(constant, 0.0, m3 / safe**1.5),
            "kurtosis": np.where(constant, 3.0, m4 / safe**2),
            "std_error_mean": std / np.sqrt(n) if independent else np.full_like(std, np.nan),
            "std_error_std": error_of_std(variance, m4, n) if independent else np.full_like(std, np.nan),
        }


def error_of_std(variance: Array, fourth: Array, count: Any, scale: ArrayLike = 1.0) -> Array:
    """Return the standard error of the standard deviation of independent samples over a scale; 0 where nothing varies.

    Parameters
    ----------
    variance, fourth : array
        Unbiased variance, and fourth central moment of the samples (divisor `count`), over the scale.
    count : int or array of int
        Number of samples.
    scale : array_like
        What the samples were divided by.
    """
    std = np.sqrt(variance)
    # by the same divisor as the variance: else the two nearly cancel where the kurtosis is near 1, as of two values
    fourth = fourth * (count / (count - 1)) ** 2
    of_variance = np.sqrt(np.maximum(fourth - (count - 3) / (count - 1) * variance**2, 0.0) / count)
    return np.where(std > 0, scale * of_variance / (2 * divisor(std)), 0.0)
