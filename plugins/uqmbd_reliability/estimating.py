"""Probabilities, intervals, and derivatives from weighted samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit
from scipy.stats import beta as beta_distribution

from uqmbd.typing import Array

__all__ = ["Estimate", "derivatives", "estimate", "tail_index", "with_any"]


CONFIDENCE = 0.95
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


def estimate(violations: Array, failures: Array, standard: int) -> Estimate:
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

    Returns
    -------
    Estimate
        Of those realisations that do not fail; the interval holds whatever the failed ones would be.
    """
    lost = min(float(failures.mean()), 1.0)
    low, high = _bounds(violations, standard)[0], _bounds(violations + failures, standard)[1]
    mean = float(violations.mean())
    share = mean / (1.0 - lost) if lost < 1.0 else 1.0
    error = float(violations.std(ddof=1)) / np.sqrt(len(violations)) / max(1.0 - lost, 1e-12)
    probability = min(max(share, low), high)
    return Estimate(probability, error, low, high)


def _bounds(weights: Array, standard: int) -> tuple[float, float]:
    """Bounds of a mean of weights, on the scale of its logarithm: they are skewed, and so is their mean."""
    total = weights.sum()
    if not total > 0:
        return 0.0, float(beta_distribution.ppf(0.5 + CONFIDENCE / 2, 1, max(standard, 1)))
    mean = total / len(weights)
    cov = float(weights.std(ddof=1)) / (mean * np.sqrt(len(weights)))
    effective = total**2 / float((weights**2).sum())
    wider = 1.0 + 3.0 * max(tail_index(weights) - HEAVY, 0.0)
    half = float(stdtrit(max(effective - 1.0, 1.0), 0.5 + CONFIDENCE / 2)) * cov * wider
    # beyond that an exponential says nothing
    factor = float(np.exp(min(half, 50.0)))
    return mean / factor, min(mean * factor, 1.0)


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
