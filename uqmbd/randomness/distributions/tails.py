"""Tails of distributions: whether moments are finite, and whether moments determine the distribution."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uqmbd.randomness.distributions.decomposed import AffineDistribution
from uqmbd.typing import Array

__all__ = ["FEWEST", "Tail", "heaviest_tail", "tail_of"]


DEPTH = np.array([1e-4, 1e-5, 1e-8, 1e-9])
"""Probabilities between which tails are measured."""

NO_MOMENTS = {"cauchy", "folded_cauchy", "levy"}
"""Families without an expectation for any parameters."""

FEWEST = 4.0
"""Order of moments that must be finite, for the kurtosis of an input and standard errors of standard deviations."""

POWER_LAW = 1.15
"""Growth of the tail index from the probability 1e-5 to 1e-9 below which the tail is a power law."""

SLOWEST = 9.5
"""Tail index at 1e-9 below which polynomials do not converge: ``exp(-sqrt(x))``, the limit of determinacy, has 9.8."""

SLOWEST_GROWTH = 1.6
"""Limit of the growth of the tail index, which is 2 for ``exp(-x**c)`` and 1.4 for a lognormal distribution."""


@dataclass(frozen=True)
class Tail:
    """Rate of decrease of the tail of a distribution.

    The index is minus the slope of log probability over log distance from the median, at the probability 1e-9. Moments
    of an order below the index are finite if the index does not grow.
    """

    index: float
    growth: float  # ratio of the index to the index at the probability 1e-5; 1 for a power law

    @property
    def power_law(self) -> bool:
        """Whether moments of high order are infinite."""
        return self.growth < POWER_LAW and self.index < np.inf

    @property
    def moments(self) -> float:
        """Order below which moments are finite."""
        return self.index if self.power_law else np.inf

    @property
    def bounded(self) -> bool:
        """Whether the support seems to be bounded."""
        return self.growth > 4

    @property
    def polynomial(self) -> bool:
        """Whether polynomials in the variable can represent functions of it."""
        return self.index >= SLOWEST and (self.growth >= SLOWEST_GROWTH or not np.isfinite(self.index))


def heaviest_tail(law: AffineDistribution) -> Tail:
    """Estimate the heavier of both tails."""
    if law.cut is None and law.kind in NO_MOMENTS:
        return Tail(1.0 if law.kind != "levy" else 0.5, 1.0)
    return tail_of(law.far_quantile)


def tail_of(quantile: Callable[[Array], Array]) -> Tail:
    """Estimate the heavier tail from a quantile function.

    >>> tail = tail_of(lambda u: np.tan(np.pi * (u - 0.5)))
    >>> round(tail.index, 2), tail.power_law
    (1.0, True)
    """
    low, middle, high = quantile(np.array([0.25, 0.5, 0.75]))
    tails = []
    for probabilities in (DEPTH, 1 - DEPTH):
        distance = np.abs(quantile(probabilities) - middle)
        grown = np.diff(distance)[[0, 2]]
        if not np.all(grown > 1e-6 * np.maximum(high - low, distance[[1, 3]])):  # the support ends there
            tails.append(Tail(np.inf, np.inf))
            continue
        first, second = np.log(10) / np.log(distance[[1, 3]] / distance[[0, 2]])
        tails.append(Tail(float(second), float(second / first)))
    return min(tails, key=lambda tail: (not tail.power_law, tail.polynomial, tail.index))
