"""Common interface of univariate distributions of scipy.stats and OpenTURNS, as chaospy needs it.

This module imports neither package when it is loaded: objects of the packages provide the methods.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from uqmbd import logs
from uqmbd.randomness.distributions.inverted import Inverted, invert_distribution
from uqmbd.typing import Array

__all__ = ["Frozen", "Infrastructure", "OpenTurns", "DistributionSource"]

INTEGRALS = {"levy_stable", "studentized_range"}
"""Families of scipy whose density is a numerical integral, which takes milliseconds per value and is not smooth."""


class DistributionSource(Protocol):
    """Univariate distribution of another package; arrays of arguments and results have the shape (N,)."""

    @property
    def discrete(self) -> bool:
        """Whether the distribution is discrete."""

    @property
    def support(self) -> tuple[float, float]:
        """Ends of the support, which may be infinite."""

    def density(self, x: Array) -> Array:
        """Return the density at `x`; for a discrete distribution, the probabilities of the values `x`."""

    def cdf(self, x: Array) -> Array:
        """Return the probability of values up to, and including, `x`."""

    def quantile(self, u: Array) -> Array:
        """Return quantiles at the probabilities `u`."""

    def upper_quantile(self, u: float) -> float:
        """Return the value that is exceeded with probability `u`."""

    def lower_quantile(self, u: float) -> float:
        """Return the quantile of one probability, without a table."""

    def moment(self, order: int) -> float:
        """Return a raw moment; NaN or infinite if it does not exist."""


TURNS = {"vonmises": (-np.pi, np.pi)}
"""Range of the quantiles that scipy returns for a periodic density, by family."""


@dataclass(frozen=True, eq=False)
class Frozen:
    """Frozen distribution of scipy: ``scipy.stats.rv_continuous`` or ``rv_discrete`` with given parameters."""

    given: Any

    @property
    def discrete(self) -> bool:
        """Whether the distribution takes whole numbers only."""
        return hasattr(self.given, "pmf")

    @property
    def support(self) -> tuple[float, float]:
        """Ends of the support."""
        low, high = self.given.support()
        return float(low), float(high)

    def density(self, x: Array) -> Array:
        """Return the density or probabilities at `x`."""
        return np.asarray(self.given.pmf(x) if self.discrete else self.given.pdf(x), dtype=float)

    def cdf(self, x: Array) -> Array:
        """Return the probability of values up to `x`."""
        return np.asarray(self.given.cdf(x), dtype=float)

    def quantile(self, u: Array) -> Array:
        """Return quantiles at `u`, from a table if scipy has no formula for them."""
        if self._table is None:
            return np.asarray(self.given.ppf(u), dtype=float)
        probability = np.asarray(u, dtype=float)
        inside = (probability > 0) & (probability < 1)
        found = self._table.quantile(np.where(inside, probability, 0.5))
        low, high = self.support
        return np.where(inside, found, np.where(probability == 0, low, np.where(probability == 1, high, np.nan)))

    def upper_quantile(self, u: float) -> float:
        """Return the value that is exceeded with probability `u`."""
        return float(self.given.isf(u))

    def lower_quantile(self, u: float) -> float:
        """Return the quantile of one probability, without a table."""
        return float(self.given.ppf(u))

    def moment(self, order: int) -> float:
        """Return a raw moment."""
        # most families have a formula for the mean
        return float(self.given.mean() if order == 1 else self.given.moment(order))

    @cached_property
    def _table(self) -> Inverted | None:
        """Table of quantiles from the density, if scipy has a formula for the density only; else None."""
        from scipy.stats import rv_continuous

        family = getattr(self.given, "dist", None)
        if not isinstance(family, rv_continuous) or family.name in INTEGRALS:
            return None
        kind = type(family)
        if kind._ppf is not rv_continuous._ppf or kind._pdf is rv_continuous._pdf:
            return None
        logs.methods.info("quantiles of scipy.stats.%s: no formula; a table is computed from the density", family.name)
        with np.errstate(all="ignore"):
            quartiles = np.asarray(self.given.ppf([0.25, 0.5, 0.75]), dtype=float)
            found = invert_distribution(self.density, self.cdf, TURNS.get(family.name, self.support), quartiles)
        if found is None:
            logs.methods.info(
                "quantiles of scipy.stats.%s: no table is accurate; a root search computes each", family.name
            )
        return found


@dataclass(frozen=True, eq=False)
class Infrastructure(Frozen):
    """A distribution of scipy's newer infrastructure, such as ``scipy.stats.Normal(mu=1, sigma=0.1)``."""

    @property
    def discrete(self) -> bool:
        """Whether the distribution is discrete."""
        return any(kind.__name__ == "DiscreteDistribution" for kind in type(self.given).__mro__)

    def quantile(self, u: Array) -> Array:
        """Return quantiles at the probabilities `u`."""
        return np.asarray(self.given.icdf(u), dtype=float)

    def upper_quantile(self, u: float) -> float:
        """Return the value that is exceeded with probability `u`."""
        return float(self.given.iccdf(u))

    def lower_quantile(self, u: float) -> float:
        """Return the quantile of one probability."""
        return float(self.given.icdf(u))


@dataclass(frozen=True, eq=False)
class OpenTurns:
    """A distribution of OpenTURNS of dimension one."""

    given: Any

    @property
    def discrete(self) -> bool:
        """Whether the distribution is discrete."""
        return bool(self.given.isDiscrete())

    @property
    def support(self) -> tuple[float, float]:
        """Ends of the support."""
        found = self.given.getRange()
        low = float(found.getLowerBound()[0]) if found.getFiniteLowerBound()[0] else -np.inf
        return low, float(found.getUpperBound()[0]) if found.getFiniteUpperBound()[0] else np.inf

    def density(self, x: Array) -> Array:
        """Return the density or probabilities at `x`."""
        return np.asarray(self.given.computePDF(np.asarray(x)[:, None]), dtype=float).ravel()

    def cdf(self, x: Array) -> Array:
        """Return the probability of values up to `x`."""
        return np.asarray(self.given.computeCDF(np.asarray(x)[:, None]), dtype=float).ravel()

    def quantile(self, u: Array) -> Array:
        """Return quantiles at the probabilities `u`."""
        return np.asarray(self.given.computeQuantile(np.asarray(u).tolist()), dtype=float).ravel()

    def upper_quantile(self, u: float) -> float:
        """Return the value that is exceeded with probability `u`."""
        return float(self.given.computeQuantile(u, True)[0])

    def lower_quantile(self, u: float) -> float:
        """Return the quantile of one probability."""
        return float(self.given.computeQuantile(u)[0])

    def moment(self, order: int) -> float:
        """Return a raw moment; NaN if OpenTURNS raises an error because the moment does not exist."""
        try:
            return float(self.given.getMean()[0] if order == 1 else self.given.getMoment(order)[0])
        except (TypeError, RuntimeError, ValueError):
            return np.nan
