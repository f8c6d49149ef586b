"""Probabilities, intervals, and derivatives from weighted samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, stdtrit
from scipy.stats import beta as beta_distribution

from uqmbd.typing import Array

__all__ = ["Estimate", "derivatives", "estimate", "failing", "tail_index", "weighted_bound", "with_any"]


CONFIDENCE = 0.95
FEW = 5.0
"""Effective number of violations below which their mean is not normal on any scale."""

HEAVY = 0.4
"""Tail index of weights above which the standard error is too small more often than not; it is infinite above 0.5."""


@dataclass(frozen=True)
class Estimate:
    """A probability, its standard error, and its interval of 95 %."""

    probability: float
    error: float
    lower: float
    upper: float

    @property
    def cov(self) -> float:
        """Coefficient of variation; infinite for a probability of zero."""
        return self.error / self.probability if self.probability > 0 else np.inf


def with_any(margins: Array) -> Array:
    """Append the margin of any violation, where there are several: (K, R) to (K, R + 1), any further axes kept.

    Its sign is right; its size is none.

    Examples
    --------
    >>> with_any(np.array([[1.0, -2.0], [3.0, 4.0]])).tolist()
    [[1.0, -2.0, -2.0], [3.0, 4.0, 3.0]]
    """
    if margins.shape[1] < 2:
        return margins
    return np.concatenate([margins, margins.min(axis=1, keepdims=True)], axis=1)


def tail_index(weights: Array) -> float:
    """Return the shape of a generalised Pareto distribution fitted to the largest weights.

    The estimator of Zhang and Stephens, drawn to 0.5 by what counts as ten observations, as in Pareto smoothed
    importance sampling: SciPy's fit by maximum likelihood fails on samples as small as these.

    References
    ----------
    .. [1] J. Zhang and M. A. Stephens, Technometrics 51 (2009) 316.
    .. [2] A. Vehtari et al., J. Mach. Learn. Res. 25 (2024) 72.

    Examples
    --------
    >>> u = np.random.default_rng(0).random(4000)
    >>> bool(abs(tail_index(u**-0.7) - 0.7) < 0.15), bool(tail_index(u) < 0.0)
    (True, True)
    """
    ordered = np.sort(weights[weights > 0])[::-1]
    tail = int(min(len(ordered) / 5, 3 * np.sqrt(len(ordered))))
    if tail < 5:
        return 0.5
    x = (ordered[:tail] - ordered[tail])[::-1]
    if not x[0] > 0 or not x[int(tail / 4 + 0.5) - 1] > 0:
        return -1.0  # as good as equal
    count = 30 + int(tail**0.5)
    b = (1 - np.sqrt(count / (np.arange(1, count + 1) - 0.5))) / (3 * x[int(tail / 4 + 0.5) - 1]) + 1 / x[-1]
    k = np.log1p(-b[:, None] * x).mean(axis=1)
    likelihood = tail * (np.log(-b / k) - k - 1)
    share = np.exp(likelihood - likelihood.max())
    mean = float(b @ share / share.sum())
    return float((np.log1p(-mean * x).mean() * tail + 5) / (tail + 10))


def estimate(violations: Array, failures: Array, standard: int, pilot: tuple[int, int] = (0, 0)) -> Estimate:
    """Return a probability from the weights of samples, shape (N,).

    Parameters
    ----------
    violations : array, shape (N,)
        Weights of the samples that violate, zero of the others.
    failures : array, shape (N,)
        Weights of the samples that failed, zero of the others.
    standard : int
        Samples of the standard normal distribution itself that are known to have shown no violation, for the bound
        where there is none at all.
    pilot : tuple of int
        Samples of the standard normal distribution, and how many of them failed.

    Returns
    -------
    Estimate
        Of those realisations that do not fail; the interval holds whatever the failed ones would be.
    """
    low, high = _bounds(violations, standard)
    lost, most_lost = failing(failures, *pilot)
    high = min(high + most_lost, 1.0)
    mean = float(violations.mean())
    share = mean / (1.0 - lost) if lost < 1.0 else 1.0
    error = float(violations.std(ddof=1)) / np.sqrt(len(violations)) / max(1.0 - lost, 1e-12)
    return Estimate(min(max(share, low), high), error, low, high)


def failing(failures: Array, standard: int, failed: int) -> tuple[float, float]:
    """Return the probability that a realisation fails, and its upper bound.

    Parameters
    ----------
    failures : array, shape (N,)
        Weights of the samples that failed, zero of the others.
    standard, failed : int
        Further samples of the standard normal distribution, and how many of them failed.

    Examples
    --------
    >>> failing(np.zeros(10), 100, 0)
    (0.0, 0.0)
    >>> share, most = failing(np.zeros(0), 100, 2)
    >>> share, round(most, 3)  # the bound of Clopper and Pearson
    (0.02, 0.07)
    """
    total = failures.sum()
    if not failed and not total > 0:
        return 0.0, 0.0
    counted = _count_bound(failed, standard) if standard else 1.0
    if not total > 0:
        return failed / standard, counted
    weighted = weighted_bound(failures / len(failures))
    # failures far from the pilot's points are known by weights, those among them by counting, too
    return (float(failures.mean()), min(counted, weighted)) if failed else (float(failures.mean()), weighted)


def weighted_bound(weights: Array) -> float:
    """Return the upper bound of a sum of weights of rare events.

    The gamma interval of Fay and Feuer, which holds for a single event, too.

    References
    ----------
    .. [1] M. P. Fay and E. J. Feuer, Statistics in Medicine 16 (1997) 791.

    Examples
    --------
    >>> round(weighted_bound(np.array([0.0, 0.1, 0.0])), 3)  # one event: that of a count of one
    0.557
    """
    total, square, most = weights.sum(), (weights**2).sum(), weights.max()
    total, square = total + most, square + most**2
    return float(min(square / (2 * total) * chdtri(2 * total**2 / square, 0.5 - CONFIDENCE / 2), 1.0))


def _count_bound(count: int, samples: int) -> float:
    if count >= samples:
        return 1.0
    return float(beta_distribution.ppf(0.5 + CONFIDENCE / 2, count + 1, samples - count))


def _bounds(weights: Array, standard: int) -> tuple[float, float]:
    """Bounds of a mean of weights, on the scale of its logarithm: they are skewed, and so is their mean."""
    total = weights.sum()
    if not total > 0:
        return 0.0, _count_bound(0, max(standard, 1))
    mean = total / len(weights)
    cov = float(weights.std(ddof=1)) / (mean * np.sqrt(len(weights)))
    effective = total**2 / float((weights**2).sum())
    wider = 1.0 + 3.0 * max(tail_index(weights) - HEAVY, 0.0)
    half = float(stdtrit(max(effective - 1.0, 1.0), 0.5 + CONFIDENCE / 2)) * cov * wider
    # beyond that an exponential says nothing
    factor = float(np.exp(min(half, 50.0)))
    high = weighted_bound(weights / len(weights)) if effective < FEW else mean * factor
    return mean / factor, min(high, 1.0)


def derivatives(violations: Array, scores: Array, failures: Array) -> tuple[Array, Array]:
    """Return the derivatives of a probability by two parameters of each input.

    The derivative of a probability is the expectation of the scores of the violations: no realisation more is needed.

    Parameters
    ----------
    violations : array, shape (N,)
        Weights of the samples that violate, zero of the others.
    scores : array, shape (N, 2, d)
        Derivatives of the logarithm of the density of the inputs.
    failures : array, shape (N,)
        Weights of the samples that failed.

    Returns
    -------
    value : array, shape (2, d)
    covariance : array, shape (2, 2, d)
        Of both parameters, of each input.
    """
    kept = max(1.0 - float(failures.mean()), 1e-12)
    terms = violations[:, None, None] * scores / kept
    value = terms.mean(axis=0)
    away = terms - value
    covariance = np.einsum("nid,njd->ijd", away, away) / (len(terms) * max(len(terms) - 1, 1))
    return value, covariance
