"""Mixtures of normal distributions in many dimensions, which differ from the standard one in few directions.

Mixtures of scikit-learn and OpenTURNS have full or diagonal covariances. With 40 inputs, a full covariance has 820
entries to fit to several dozen violations, and the weights of the samples degenerate. OpenTURNS's NAIS gives 1.3e-11
instead of 1.1e-8 for a plane in 40 dimensions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.special import logsumexp

from uqmbd.typing import Array

__all__ = ["WeightedMixture", "Normal", "Outside", "standard_log_density"]


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal distribution with the covariance ``B C B^T + rest (I - B B^T)``."""

    mean: Array  # (d,)
    basis: Array  # (d, k) orthonormal directions B in which it differs from a multiple of the standard distribution
    covariance: Array  # (k, k) C, in these directions
    rest: float = 1.0  # variance in all other directions

    @classmethod
    def round(cls, mean: Array, variance: float = 1.0) -> Normal:
        """Return the distribution with the same variance in all directions."""
        return cls(mean, np.zeros((len(mean), 0)), np.zeros((0, 0)), variance)

    def sample(self, count: int, generator: np.random.Generator) -> Array:
        """Return points (count, d)."""
        z = generator.standard_normal((count, len(self.mean)))
        along = z @ self.basis
        factor = np.linalg.cholesky(self.covariance)
        others = z - along @ self.basis.T
        return np.asarray(self.mean + np.sqrt(self.rest) * others + (along @ factor.T) @ self.basis.T)

    def log_density(self, points: Array) -> Array:
        """Return the logarithm of the density at points (K, d), shape (K,)."""
        away = points - self.mean
        along = away @ self.basis
        factor = np.linalg.cholesky(self.covariance)
        scaled = np.linalg.solve(factor, along.T)
        dimension, width = self.basis.shape
        # avoid a difference of squares if no other direction is left
        others = ((away - along @ self.basis.T) ** 2).sum(axis=1) / self.rest if width < dimension else 0.0
        square = others + (scaled**2).sum(axis=0)
        determinant = np.log(np.diag(factor)).sum() + 0.5 * (dimension - width) * np.log(self.rest)
        return np.asarray(-0.5 * square - determinant - 0.5 * dimension * np.log(2 * np.pi))


@dataclass(frozen=True, eq=False)
class Outside:
    """Standard normal distribution outside a sphere about the origin (radial importance sampling).

    The weight of a point is the same in every direction, unlike for a mixture of few normal distributions. So it suits
    violations without a design point, such as those beyond a sphere (Harbitz, Structural Safety 3 (1986) 109).
    """

    dimension: int
    radius: float

    @classmethod
    def around(cls, nearest: float, dimension: int) -> Outside:
        """Return the distribution outside a sphere somewhat smaller than the sphere through the nearest violation.

        `nearest`: distance of this violation from the origin. The space outside the sphere has twice the probability of
        the space beyond this distance.
        """
        probability = float(np.clip(2.0 * stats.chi2.sf(nearest**2, dimension), 1e-300, 1.0))
        return cls(dimension, float(np.sqrt(stats.chi2.isf(probability, dimension))))

    def sample(self, count: int, generator: np.random.Generator) -> Array:
        """Return points (count, d)."""
        z = generator.standard_normal((count, self.dimension))
        beyond = stats.chi2.sf(self.radius**2, self.dimension) * (1.0 - generator.random(count))
        distance = np.sqrt(stats.chi2.isf(beyond, self.dimension))
        return np.asarray(z * (distance / np.linalg.norm(z, axis=1))[:, None])

    def log_density(self, points: Array) -> Array:
        """Return the logarithm of the density at points (K, d), shape (K,)."""
        outside = (points**2).sum(axis=1) >= self.radius**2
        density = standard_log_density(points) - stats.chi2.logsf(self.radius**2, self.dimension)
        return np.where(outside, density, -np.inf)


@dataclass(frozen=True, eq=False)
class WeightedMixture:
    """Mixture of distributions with weights."""

    parts: tuple[Normal | Outside, ...]
    weights: Array

    @classmethod
    def of(cls, parts: Sequence[Normal | Outside], weights: Sequence[float] | Array) -> WeightedMixture:
        """Return a mixture with weights normalised to the sum one."""
        given = np.asarray(weights, dtype=float)
        return cls(tuple(parts), given / given.sum())

    def sample(self, count: int, generator: np.random.Generator) -> Array:
        """Return points (count, d), with the share of each part randomly rounded to a whole number."""
        offset = generator.random()
        edges = np.floor(np.r_[0.0, np.cumsum(self.weights[:-1]) * count, count] + offset)
        shares = np.diff(edges).astype(int)
        return np.concatenate([part.sample(int(k), generator) for part, k in zip(self.parts, shares, strict=True)])

    def log_densities(self, points: Array) -> Array:
        """Return the logarithms of weight times density of each part at points (K, d), shape (K, part)."""
        found = np.stack([part.log_density(points) for part in self.parts], axis=1)
        return np.asarray(found + np.log(self.weights))

    def ratio(self, points: Array) -> Array:
        """Return the ratio (K,) of the standard normal density to the density of the mixture at points (K, d)."""
        return np.asarray(np.exp(standard_log_density(points) - logsumexp(self.log_densities(points), axis=1)))


def standard_log_density(points: Array) -> Array:
    """Return the logarithm of the standard normal density at points (K, d), shape (K,)."""
    return np.asarray(-0.5 * (points**2).sum(axis=1) - 0.5 * points.shape[1] * np.log(2 * np.pi))
