"""Distributions of scipy.stats and OpenTURNS behind one interface, as chaospy needs it for one variable.

Neither package is imported here: objects of them bring what is needed.
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
"""Families of scipy whose density is an integral, which takes milliseconds and is not smooth."""


class DistributionSource(Protocol):
    """A distribution of another package, of one variable; every function takes and returns arrays of shape (N,)."""

    @property
    def discrete(self) -> bool:
        """Whether it takes single values only."""

    @property
    def support(self) -> tuple[float, float]:
        """Its ends, which may be infinite."""

    def density(self, x: Array) -> Array:
        """Density, or the probability of a single value where it is discrete."""

    def cdf(self, x: Array) -> Array:
        """Probability up to, and including, `x`."""

    def quantile(self, u: Array) -> Array:
        """Quantiles."""

    def upper_quantile(self, u: float) -> float:
        """Value that is exceeded with probability `u`."""

    def lower_quantile(self, u: float) -> float:
        """Quantile of one probability, without a table."""

    def moment(self, order: int) -> float:
        """Raw moment; NaN or infinite where there is none."""


TURNS = {"vonmises": (-np.pi, np.pi)}
"""Range of scipy's quantiles of a periodic density."""


@dataclass(frozen=True, eq=False)
class Frozen:
    """A distribution with parameters of ``scipy.stats.rv_continuous`` or ``rv_discrete``."""

    given: Any

    @property
    def discrete(self) -> bool:
        """Whether it takes whole numbers only."""
        return hasattr(self.given, "pmf")

    @property
    def support(self) -> tuple[float, float]:
        """Its ends."""
        low, high = self.given.support()
        return float(low), float(high)

    def density(self, x: Array) -> Array:
        """Density or probability."""
        return np.asarray(self.given.pmf(x) if self.discrete else self.given.pdf(x), dtype=float)

    def cdf(self, x: Array) -> Array:
        """Probability up to `x`."""
        return np.asarray(self.given.cdf(x), dtype=float)

    def quantile(self, u: Array) -> Array:
        """Quantiles, of a table where scipy has no formula of them."""
        if self._table is None:
            return np.asarray(self.given.ppf(u), dtype=float)
        probability = np.asarray(u, dtype=float)
        inside = (probability > 0) & (probability < 1)
        found = self._table.quantile(np.where(inside, probability, 0.5))
        low, high = self.support
        return np.where(inside, found, np.where(probability == 0, low, np.where(probability == 1, high, np.nan)))

    def upper_quantile(self, u: float) -> float:
        """Value that is exceeded with probability `u`."""
        return float(self.given.isf(u))

    def lower_quantile(self, u: float) -> float:
        """Quantile of one probability, without a table."""
        return float(self.given.ppf(u))

    def moment(self, order: int) -> float:
        """Raw moment."""
        # the mean of most has a formula of its own
        return float(self.given.mean() if order == 1 else self.given.moment(order))

    @cached_property
    def _table(self) -> Inverted | None:
        """Quantiles by the density, where it is all that scipy has a formula of."""
        from scipy.stats import rv_continuous

        family = getattr(self.given, "dist", None)
        if not isinstance(family, rv_continuous) or family.name in INTEGRALS:
            return None
        kind = type(family)
        if kind._ppf is not rv_continuous._ppf or kind._pdf is rv_continuous._pdf:
            return None
        logs.methods.info("quantiles of scipy.stats.%s: no formula; a table is made of its density", family.name)
        with np.errstate(all="ignore"):
            quartiles = np.asarray(self.given.ppf([0.25, 0.5, 0.75]), dtype=float)
            found = invert_distribution(self.density, self.cdf, TURNS.get(family.name, self.support), quartiles)
        if found is None:
            logs.methods.info("quantiles of scipy.stats.%s: no table is accurate; each is searched for", family.name)
        return found


@dataclass(frozen=True, eq=False)
class Infrastructure(Frozen):
    """A distribution of scipy's newer infrastructure, such as ``scipy.stats.Normal(mu=1, sigma=0.1)``."""

    @property
    def discrete(self) -> bool:
        """Whether it takes single values only."""
        return any(kind.__name__ == "DiscreteDistribution" for kind in type(self.given).__mro__)

    def quantile(self, u: Array) -> Array:
        """Quantiles."""
        return np.asarray(self.given.icdf(u), dtype=float)

    def upper_quantile(self, u: float) -> float:
        """Value that is exceeded with probability `u`."""
        return float(self.given.iccdf(u))

    def lower_quantile(self, u: float) -> float:
        """Quantile of one probability."""
        return float(self.given.icdf(u))


@dataclass(frozen=True, eq=False)
class OpenTurns:
    """A distribution of OpenTURNS of dimension one."""

    given: Any

    @property
    def discrete(self) -> bool:
        """Whether it takes single values only."""
        return bool(self.given.isDiscrete())

    @property
    def support(self) -> tuple[float, float]:
        """Its ends."""
        found = self.given.getRange()
        low = float(found.getLowerBound()[0]) if found.getFiniteLowerBound()[0] else -np.inf
        return low, float(found.getUpperBound()[0]) if found.getFiniteUpperBound()[0] else np.inf

    def density(self, x: Array) -> Array:
        """Density or probability."""
        return np.asarray(self.given.computePDF(np.asarray(x)[:, None]), dtype=float).ravel()

    def cdf(self, x: Array) -> Array:
        """Probability up to `x`."""
        return np.asarray(self.given.computeCDF(np.asarray(x)[:, None]), dtype=float).ravel()

    def quantile(self, u: Array) -> Array:
        """Quantiles."""
        return np.asarray(self.given.computeQuantile(np.asarray(u).tolist()), dtype=float).ravel()

    def upper_quantile(self, u: float) -> float:
        """Value that is exceeded with probability `u`."""
        return float(self.given.computeQuantile(u, True)[0])

    def lower_quantile(self, u: float) -> float:
        """Quantile of one probability."""
        return float(self.given.computeQuantile(u)[0])

    def moment(self, order: int) -> float:
        """Raw moment; NaN where there is none, which OpenTURNS raises."""
        try:
            return float(self.given.getMean()[0] if order == 1 else self.given.getMoment(order)[0])
        except (TypeError, RuntimeError, ValueError):
            return np.nan
