"""Error bounds of mean and standard deviation of a surrogate, from realisations that did not choose the surrogate.

Differences of a mechanism f and its surrogate g at random points give control-variate estimates of the errors of the
moments. The expectation of f - g is the error of the mean. The mean of g is m, and v is the
error of the variance plus the square of the error of the mean. The expectation of (f - g) (f + g - 2 m) is v.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from uqmbd.results.statistics import divisor
from uqmbd.typing import Array

__all__ = ["FEWEST_FOR_MOMENTS", "Stratum", "moment_bounds"]

FEWEST_FOR_MOMENTS = 30
"""Minimum number of realisations of bounds: 32 verification realisations without the two at extremes."""

TOO_SMALL = 0.025, 0.05
"""Probabilities of a too small estimate: of a single one (a 95 % interval), and of any of several looks together."""


@dataclass(frozen=True, eq=False)
class Stratum:
    """Realisations of a part of the germ space: probability, surrogate and response (V, O, T), weights (V,)."""

    probability: float
    surrogate: Array
    response: Array
    weights: Array

    def mean_of(self, values: Array) -> tuple[Array, Array]:
        """Return the weighted mean of values (V, O, T) and the variance of this mean, each (O, T)."""
        share = (self.weights / self.weights.sum()).reshape(-1, 1, 1)
        mean = (share * values).sum(axis=0)
        count = len(values)
        if count < 2:
            return mean, np.full_like(mean, np.inf)
        return mean, count / (count - 1) * (share**2 * (values - mean) ** 2).sum(axis=0)


def moment_bounds(mean: Array, std: Array, strata: Sequence[Stratum], looks: int = 1) -> tuple[Array, Array]:
    """Return bounds (O, T) of the errors of the mean and of the standard deviation, with 95 % confidence.

    `mean`, `std` (O, T): moments of the surrogate. The bounds are the distances of the moments from the far ends of
    their confidence intervals. At one of several `looks`, the level follows from Bonferroni's inequality. The intervals
    use Student's t with the degrees of freedom of Welch and Satterthwaite.

    A surrogate 0 of the signs of a fair coin, at 64 points: the mean is 0, and the standard deviation is wrong by 1.

    >>> sign = np.tile([1.0, -1.0], 32)[:, None, None]
    >>> own = Stratum(1.0, 0 * sign, sign, np.ones(64))
    >>> [float(bound.round(2).item()) for bound in moment_bounds(np.zeros((1, 1)), np.zeros((1, 1)), [own])]
    [0.25, 1.0]
    """
    # units in which squares neither overflow nor underflow
    unit = np.maximum(np.nan_to_num(std).max(axis=-1, keepdims=True, initial=0.0), _largest(strata))
    mean, std = mean / unit, std / unit
    strata = [replace(one, surrogate=one.surrogate / unit, response=one.response / unit) for one in strata]
    wrong = [one.response - one.surrogate for one in strata]
    products = [w * (one.response + one.surrogate - 2 * mean) for w, one in zip(wrong, strata, strict=True)]
    level = 1 - min(TOO_SMALL[0], TOO_SMALL[1] / looks)
    off, half = _interval(strata, wrong, level)
    in_mean = np.abs(off) + half
    off, half = _interval(strata, products, level)
    # the square of the error of the mean, at most that of its bound, reduces the variance
    low, high = std**2 + off - half - in_mean**2, std**2 + off + half
    ends = [np.sqrt(np.maximum(end, 0.0)) for end in (low, high)]
    return unit * in_mean, unit * np.maximum(std - ends[0], ends[1] - std)


def _largest(strata: Sequence[Stratum]) -> Array:
    """Return the largest difference (O, 1) of surrogate and response, at least 1e-300."""
    found = [np.abs(np.nan_to_num(one.response - one.surrogate)).max(axis=(0, 2), initial=1e-300) for one in strata]
    return np.asarray(np.max(found, axis=0)[:, None], dtype=float)


def _interval(strata: Sequence[Stratum], values: Sequence[Array], level: float) -> tuple[Array, Array]:
    """Return the estimate of an expectation and the half-width of its interval, each (O, T)."""
    shape = values[0].shape[1:]
    estimate, variance, spread = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    for one, own in zip(strata, values, strict=True):
        mean, square = one.mean_of(own)
        estimate += one.probability * mean
        part = one.probability**2 * square
        variance += part
        freedom = max(one.weights.sum() ** 2 / (one.weights**2).sum() - 1, 1.0)
        spread += part**2 / freedom
    freedom = np.where(spread > 0, variance**2 / divisor(spread), 1.0)
    return estimate, stdtrit(freedom, level) * np.sqrt(variance)
