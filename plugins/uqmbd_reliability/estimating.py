"""Probabilities, intervals, and derivatives from weighted samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.special import chdtri, stdtrit

from uqmbd.typing import Array

__all__ = [
    "ProbabilityEstimate",
    "derivatives",
    "estimate",
    "failing",
    "tail_index",
    "weighted_bound",
    "weighted_interval",
    "with_any",
]


CONFIDENCE = 0.95
FEW = 5.0
"""Effective number of violations below which the distribution of their mean is not normal on any scale."""

HEAVY = 0.4
"""Tail index of weights above which the standard error is mostly too small; above 0.5, the variance is infinite."""


@dataclass(frozen=True)
class ProbabilityEstimate:
    """Probability, its standard error, and its 95 % interval."""

    probability: float
    error: float
    lower: float
    upper: float

    @property
    def cov(self) -> float:
        """Coefficient of variation; infinite for a probability of zero."""
        return self.error / self.probability if self.probability > 0 else np.inf


def with_any(margins: Array) -> Array:
    """Append the margin of any violation if there are several requirements: (K, R, ...) to (K, R + 1, ...).

    Only the sign of this margin is meaningful.

    >>> with_any(np.array([[1.0, -2.0], [3.0, 4.0]])).tolist()
    [[1.0, -2.0, -2.0], [3.0, 4.0, 3.0]]
    """
    if margins.shape[1] < 2:
        return margins
    return np.concatenate([margins, margins.min(axis=1, keepdims=True)], axis=1)


def tail_index(weights: Array) -> float:
    """Return the shape of a generalised Pareto distribution fitted to the largest weights.

    The shape is 0.5 for fewer than 25 positive weights, and -1 if the largest weights are nearly equal.
    The estimator is by Zhang and Stephens, Technometrics 51 (2009) 316, shrunk to 0.5 with the weight of ten
    observations. Pareto smoothed importance sampling does the same (Vehtari et al., J. Mach. Learn. Res. 25 (2024) 72).
    SciPy's maximum likelihood fit fails on samples as small as these.
    """
    ordered = np.sort(weights[weights > 0])[::-1]
    tail = int(min(len(ordered) / 5, 3 * np.sqrt(len(ordered))))
    if tail < 5:
        return 0.5
    x = (ordered[:tail] - ordered[tail])[::-1]
    if not x[0] > 0 or not x[int(tail / 4 + 0.5) - 1] > 0:
        return -1.0  # the weights are nearly equal
    count = 30 + int(tail**0.5)
    b = (1 - np.sqrt(count / (np.arange(1, count + 1) - 0.5))) / (3 * x[int(tail / 4 + 0.5) - 1]) + 1 / x[-1]
    k = np.log1p(-b[:, None] * x).mean(axis=1)
    likelihood = tail * (np.log(-b / k) - k - 1)
    share = np.exp(likelihood - likelihood.max())
    mean = float(b @ share / share.sum())
    return float((np.log1p(-mean * x).mean() * tail + 5) / (tail + 10))


def estimate(violations: Array, failures: Array, standard: int, pilot: tuple[int, int] = (0, 0)) -> ProbabilityEstimate:
    """Return the probability of violation from the weights (N,) of violations and of failed realisations.

    Weights of other samples are zero. The probability refers to realisations that do not fail; the interval is valid
    for any margins of the failed realisations. `standard`: number of standard normal samples, for the bound if there is
    no violation; `pilot`: number of standard normal pilot samples, and of failures among them.
    """
    low, high = weighted_interval(violations, standard)
    lost, most_lost = failing(failures, *pilot)
    high = min(high + most_lost, 1.0)
    mean = float(violations.mean())
    share = mean / (1.0 - lost) if lost < 1.0 else 1.0
    error = float(violations.std(ddof=1)) / np.sqrt(len(violations)) / max(1.0 - lost, 1e-12)
    return ProbabilityEstimate(min(max(share, low), high), error, low, high)


def failing(failures: Array, standard: int, failed: int) -> tuple[float, float]:
    """Return the probability that a realisation fails, and its upper bound, from weights (N,) of failed samples.

    Weights of other samples are zero. `failed` of `standard` additional standard normal samples failed.

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
    # failures far from the pilot's points have only weights, but failures of the pilot can also be counted
    return (float(failures.mean()), min(counted, weighted)) if failed else (float(failures.mean()), weighted)


def weighted_bound(weights: Array) -> float:
    """Return the upper bound of a sum of weights of rare events.

    The interval is the gamma interval of Fay and Feuer, Statistics in Medicine 16 (1997) 791, which is valid even for a
    single event.

    >>> round(weighted_bound(np.array([0.0, 0.1, 0.0])), 3)  # one event: that of a count of one
    0.557
    """
    total, square, most = weights.sum(), (weights**2).sum(), weights.max()
    total, square = total + most, square + most**2
    return float(min(square / (2 * total) * chdtri(2 * total**2 / square, 0.5 - CONFIDENCE / 2), 1.0))


def _count_bound(count: int, samples: int) -> float:
    if count >= samples:
        return 1.0
    return float(stats.beta.ppf(0.5 + CONFIDENCE / 2, count + 1, samples - count))


def weighted_interval(weights: Array, standard: int) -> tuple[float, float]:
    """Return bounds of a mean of weights (N,), on a logarithmic scale, because weights and their mean are skewed.

    `standard`: number of standard normal samples, for the bound if all weights are zero.
    """
    total = weights.sum()
    if not total > 0:
        return 0.0, _count_bound(0, max(standard, 1))
    mean = total / len(weights)
    cov = float(weights.std(ddof=1)) / (mean * np.sqrt(len(weights)))
    effective = total**2 / float((weights**2).sum())
    wider = 1.0 + 3.0 * max(tail_index(weights) - HEAVY, 0.0)
    half = float(stdtrit(max(effective - 1.0, 1.0), 0.5 + CONFIDENCE / 2)) * cov * wider
    # avoid overflow of the exponential function
    factor = float(np.exp(min(half, 50.0)))
    high = weighted_bound(weights / len(weights)) if effective < FEW else mean * factor
    return mean / factor, min(high, 1.0)


def derivatives(violations: Array, scores: Array, failures: Array) -> tuple[Array, Array]:
    """Return the derivatives (2, d) of a probability by two parameters of each input, and their covariance (2, 2, d).

    Scores (N, 2, d) are derivatives of the logarithm of the density of the inputs. The derivative of a probability is
    their expectation over the violations, so no additional realisation is needed. Violations and failures (N,) are
    weights.
    """
    kept = max(1.0 - float(failures.mean()), 1e-12)
    terms = violations[:, None, None] * scores / kept
    value = terms.mean(axis=0)
    away = terms - value
    covariance = np.einsum("nid,njd->ijd", away, away) / (len(terms) * max(len(terms) - 1, 1))
    return value, covariance
