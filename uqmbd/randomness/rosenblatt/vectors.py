"""Normal vectors, Student vectors and normal mixtures as maps of independent uniform variables."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.special

from uqmbd.randomness.rosenblatt.bisection import bisected
from uqmbd.randomness.rosenblatt.copulas import combined, scores, separated, unscored
from uqmbd.randomness.rosenblatt.expressions import Expression, encoded, evaluated, used
from uqmbd.typing import Array

__all__ = ["NormalMixture", "Vector"]


@dataclass(frozen=True, eq=False)
class Vector:
    """Normal vector, exponential of a normal vector, or Student vector."""

    centre: tuple[Expression, ...]  # of each component
    factor: Array  # (n, n) Cholesky factor of covariance (Student: scale matrix); lower triangular if sorted by `order`
    order: tuple[int, ...]  # components in the order of conditioning
    freedom: float = np.inf  # degrees of freedom; infinite for a normal vector
    exponential: bool = False  # whether components are exponentials

    @property
    def given(self) -> tuple[frozenset[int], ...]:
        """For each component, the other components on which its distribution depends."""
        place = {k: number for number, k in enumerate(self.order)}
        correlated = self.factor != 0 if np.isinf(self.freedom) else np.ones_like(self.factor, dtype=bool)
        return tuple(frozenset(j for j in self.order[: place[k]] if correlated[k, j]) for k in range(len(self.centre)))

    @property
    def outer(self) -> frozenset[int]:
        """Indices of the variables of the larger distribution on which the centre depends."""
        return frozenset().union(*map(used, self.centre))

    @property
    def discrete(self) -> tuple[bool, ...]:
        """Whether each component is discrete: all are continuous."""
        return (False,) * len(self.centre)

    @property
    def invertible(self) -> bool:
        """Whether values determine the uniform variables: always true."""
        return True

    def inverse(self, u: Array, values: Array) -> Array:
        """Map independent uniform variables to components."""
        x = combined(self.factor, self.order, scores(u, self.order, self.freedom)) + self._centres(values)
        return np.asarray(np.exp(x) if self.exponential else x)

    def forward(self, x: Array, values: Array) -> Array:
        """Map components to independent uniform variables."""
        with np.errstate(all="ignore"):
            x = np.log(x) if self.exponential else x
        parts = separated(self.factor, self.order, x - self._centres(values))
        return unscored(parts, self.order, self.freedom)

    def encoded(self) -> Any:
        """Return the distribution as data."""
        freedom = None if np.isinf(self.freedom) else self.freedom
        centre = [encoded(x) for x in self.centre]
        return ["vector", centre, self.factor.tolist(), list(self.order), freedom, self.exponential]

    def _centres(self, values: Array) -> Array:
        shape = values.shape[1]
        return np.stack([np.broadcast_to(np.asarray(evaluated(x, values), dtype=float), shape) for x in self.centre])


@dataclass(frozen=True, eq=False)
class NormalMixture:
    """Mixture of normal vectors."""

    weights: Array  # (m,), with the sum one
    centres: Array  # (m, n)
    factors: Array  # (m, n, n) Cholesky factors of the covariances; lower triangular if sorted by `order`
    order: tuple[int, ...]  # components in the order of conditioning

    @property
    def given(self) -> tuple[frozenset[int], ...]:
        """For each component, all earlier components, on which its distribution depends."""
        place = {k: number for number, k in enumerate(self.order)}
        return tuple(frozenset(self.order[: place[k]]) for k in range(len(self.order)))

    @property
    def outer(self) -> frozenset[int]:
        """Empty set: the parameters are numbers."""
        return frozenset()

    @property
    def discrete(self) -> tuple[bool, ...]:
        """Whether each component is discrete: all are continuous."""
        return (False,) * len(self.order)

    @property
    def invertible(self) -> bool:
        """Whether values determine the uniform variables: always true."""
        return True

    def inverse(self, u: Array, values: Array) -> Array:
        """Map independent uniform variables to components."""
        x, state = np.zeros_like(u), _Conditioned.start(self, u.shape[1])
        for row in self.order:
            middle, spread = state.moments(self, row)
            ends = middle + spread * scipy.special.ndtri(np.clip(u[row], 1e-300, 1 - 2.0**-53))[:, None]
            # the quantile of a mixture is between the quantiles of its members
            x[row] = state.solved(u[row], middle, spread, ends.min(axis=1), ends.max(axis=1))
            state = state.after(self, row, x[row])
        return x

    def forward(self, x: Array, values: Array) -> Array:
        """Map components to independent uniform variables."""
        u, state = np.zeros_like(x), _Conditioned.start(self, x.shape[1])
        for row in self.order:
            middle, spread = state.moments(self, row)
            u[row] = state.cumulated((x[row][:, None] - middle) / spread)
            state = state.after(self, row, x[row])
        return u

    def encoded(self) -> Any:
        """Return the distribution as data."""
        return ["mixture", self.weights.tolist(), self.centres.tolist(), self.factors.tolist(), list(self.order)]


@dataclass(frozen=True, eq=False)
class _Conditioned:
    """Members of a mixture, conditional on known components of N points.

    `probability` (N, m) is the probability of each member. `parts` (n, N, m) are the standard normal variables of the
    known components; they are zero for others.
    """

    probability: Array
    parts: Array

    @classmethod
    def start(cls, mixture: NormalMixture, count: int) -> _Conditioned:
        members, dimension = mixture.centres.shape
        return cls(np.tile(mixture.weights, (count, 1)), np.zeros((dimension, count, members)))

    def moments(self, mixture: NormalMixture, row: int) -> tuple[Array, Array]:
        """Return conditional means (N, m) and deviations (m,) of a component in each member."""
        # parts of unknown components are zero
        middle = np.broadcast_to(mixture.centres[:, row], self.probability.shape)
        for column in range(len(self.parts)):
            if column != row:
                middle = middle + mixture.factors[:, row, column] * self.parts[column]
        return middle, mixture.factors[:, row, row]

    def cumulated(self, standard: Array) -> Array:
        """Return the probability (N,) of a component below a value, given standardised values (N, m) in each member."""
        return np.asarray((self.probability * scipy.special.ndtr(standard)).sum(axis=1))

    def solved(self, u: Array, middle: Array, spread: Array, low: Array, high: Array) -> Array:
        """Return quantiles of a component, by its conditional means and deviations in each member."""

        def missing(x: Array) -> Array:
            return self.cumulated((x[:, None] - middle) / spread) - u

        def density(x: Array) -> Array:
            standard = (x[:, None] - middle) / spread
            heights = self.probability * np.exp(-(standard**2) / 2) / (spread * np.sqrt(2 * np.pi))
            return np.asarray(heights.sum(axis=1))

        return bisected(missing, low, high, density)

    def after(self, mixture: NormalMixture, row: int, x: Array) -> _Conditioned:
        """Return the members, conditional on the values (N,) of one more component."""
        middle, spread = self.moments(mixture, row)
        standard = (x[:, None] - middle) / spread
        with np.errstate(divide="ignore"):
            logarithm = np.log(self.probability) - standard**2 / 2 - np.log(spread)
        density = np.exp(logarithm - logarithm.max(axis=1, keepdims=True))
        parts = self.parts.copy()
        parts[row] = standard
        return _Conditioned(density / density.sum(axis=1, keepdims=True), parts)
