"""Compute moments and Sobol' indices of surrogates from coefficients of one or more elements, or from samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.results.chaos.decay import top_order
from uqmbd.results.chaos.sampling import affordable, sampled_shape, spread_germs
from uqmbd.results.chaos.terms import (
    REPLICATES,
    PowerSums,
    closed_variance,
    constant_columns,
    first_order_masks,
    interaction_mask,
    second_order_masks,
    shape_route,
    skewness_kurtosis,
    standard_deviation,
    total_order_masks,
    variance_shares,
)
from uqmbd.threads import one_thread
from uqmbd.typing import Array, Index, Mask

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox, GermSpace

__all__ = [
    "FEWER",
    "MOMENTS",
    "TOPS",
    "ExactMoments",
    "MergedMoments",
    "SampledMoments",
    "frozen_germs",
    "moment_germs",
]

FEWER = 8192
"""Number of surrogate samples for quantiles of all outputs and times, and for sampled skewness and kurtosis."""

MOMENTS = 16_384
"""Initial number of surrogate samples for mean and standard deviation; it is doubled if the sampling error is large."""
MOST_MOMENTS = 131_072
"""Maximum number of surrogate samples for mean and standard deviation."""
MOST_VALUES = 2**26
"""Maximum product of the numbers of samples, outputs and times; the computation takes about half a second."""
MOMENT_ERROR = 2.5e-4
"""Sampling error of mean and standard deviation, over the largest standard deviation, that is small enough."""
SMALL_SHARE = 0.3
"""Sampling error, over the root mean square error of the surrogate, that is small enough."""
FROZEN = 4_096
"""Number of pairs of samples for Sobol' indices."""
TOPS = 256
"""Number of surrogate samples for the energy of the top order."""


@dataclass(frozen=True, eq=False)
class ExactMoments:
    """Moments of a sum of orthonormal terms (P, d) with coefficients (P, O, T)."""

    space: GermSpace
    multi_index: Index
    coefficients: Array

    sampling_errors: ClassVar[Array | None] = None

    @property
    def summands(self) -> int:
        """Number of terms in the sum of the standard deviation."""
        return len(self.coefficients)

    @property
    def mean(self) -> Array:
        """Expectation, shape (O, T)."""
        return np.asarray(self.coefficients[0])

    @cached_property
    def spread(self) -> Array:
        """Standard deviation and variance, shape (2, O, T)."""
        std = standard_deviation(self._flat).reshape(self.mean.shape)
        return np.stack([std, std**2])

    @cached_property
    def shape_samples(self) -> int:
        """Number of surrogate samples for skewness and kurtosis; 0 if these are exact."""
        exact = self._route != "samples"
        return 0 if exact else affordable(FEWER, len(self.multi_index), self._flat.shape[1])

    @cached_property
    def sobol(self) -> Array:
        """First-order and total indices, shape (2, germ, O, T)."""
        return np.stack([self._shares(masks(self.multi_index)) for masks in (first_order_masks, total_order_masks)])

    @cached_property
    def sobol_second(self) -> Array:
        """Indices of pairs, shape (germ, germ, O, T)."""
        count = self.multi_index.shape[1]
        rows, columns = np.triu_indices(count, 1)
        found = np.zeros((count, count, *self.mean.shape))
        found[rows, columns] = found[columns, rows] = self._shares(second_order_masks(self.multi_index))
        return found

    @property
    def tops(self) -> Array:
        """Sum of squared coefficients of the top order (1 + d, O, T), in total and by germ."""
        _, edge = top_order(self.multi_index)
        return np.concatenate([[np.sum(self.coefficients[edge] ** 2, axis=0)], self.by_germ(edge)])

    def interaction(self, germs: Sequence[int]) -> Array:
        """Return the share (O, T) of the variance due to the interaction of all these germs."""
        return np.asarray(self._shares(interaction_mask(self.multi_index, germs)[None])[0])

    @property
    def _flat(self) -> Array:
        """Coefficients as (P, C)."""
        return self.coefficients.reshape(len(self.coefficients), -1)

    @cached_property
    def _route(self) -> str:
        return shape_route(self._flat, self.multi_index, self.space.germs)

    @cached_property
    def shape(self) -> Array:
        """Skewness and kurtosis, shape (2, O, T)."""
        if self.shape_samples:
            std = self.spread[0]
            varying = np.where(constant_columns(self.mean, std, self.summands), 0.0, std).ravel()
            found = sampled_shape(self.space, self._flat, self.multi_index, varying, self.shape_samples)
        else:
            found = skewness_kurtosis(self._flat, self.multi_index, self.space.germs, self._route)
        return np.reshape(found, (2, *self.mean.shape))

    def by_germ(self, terms: Mask | slice) -> Array:
        """Return the sum of squares of coefficients by germ (d, O, T), with terms divided in proportion to degrees."""
        own = self.multi_index[terms]
        degrees = own / np.maximum(own.sum(axis=1, keepdims=True), 1)
        found: Array = np.einsum("pd,p...->d...", degrees, self.coefficients[terms] ** 2)
        return found

    def _shares(self, masks: Mask) -> Array:
        found = variance_shares(self._flat, masks, self.spread[0].ravel())
        return found.reshape(len(masks), *self.mean.shape)


@dataclass(frozen=True, eq=False)
class MergedMoments:
    """Moments of expansions in E boxes, with coefficients (E, P, O, T) of common terms (P, d)."""

    parts: Sequence[Any]
    boxes: Sequence[GermBox]
    multi_index: Index
    coefficients: Array

    summands: ClassVar[int] = 1
    sampling_errors: ClassVar[Array | None] = None

    @cached_property
    def mean(self) -> Array:
        """Expectation, shape (O, T)."""
        return self.merged(self._each("mean"))

    @cached_property
    def spread(self) -> Array:
        """Standard deviation and variance, shape (2, O, T)."""
        std = np.sqrt(self.merged(self._each("spread")[:, 0] ** 2 + (self._each("mean") - self.mean) ** 2))
        return np.stack([std, std**2])

    @property
    def shape_samples(self) -> int:
        """Largest number of surrogate samples for skewness and kurtosis of an element; 0 if these are exact."""
        return max(int(part.shape_samples) for part in self.parts)

    @cached_property
    def sobol(self) -> Array:
        """First-order and total indices, shape (2, germ, O, T)."""
        germs = range(self.multi_index.shape[1])
        first = [self._closed([k]) for k in germs]
        others = [1.0 - self._closed([j for j in germs if j != k]) for k in germs]
        return np.stack([first, np.where(self._constant, 0.0, np.clip(np.stack(others), 0.0, 1.0))])

    @cached_property
    def sobol_second(self) -> Array:
        """Indices of pairs, shape (germ, germ, O, T)."""
        count, first = self.multi_index.shape[1], self.sobol[0]
        found = np.zeros((count, count, *self.mean.shape))
        for i, j in zip(*np.triu_indices(count, 1), strict=True):
            both = np.maximum(self._closed([int(i), int(j)]) - first[i] - first[j], 0.0)
            found[i, j] = found[j, i] = both
        return found

    @property
    def tops(self) -> Array:
        """Mean energy of the top orders over the elements (1 + d, O, T)."""
        return self.merged(self._each("tops"))

    def merged(self, values: Array) -> Array:
        """Average values over the elements (E, ...), weighted by the element probabilities."""
        weights = np.array([box.probability for box in self.boxes])
        found: Array = np.einsum("e,e...->...", weights, values) / weights.sum()
        return found

    @cached_property
    def _constant(self) -> Mask:
        return constant_columns(self.mean, self.spread[0])

    def _each(self, name: str) -> Array:
        """Return a statistic of each element (E, ...)."""
        return np.stack([getattr(part, name) for part in self.parts])

    @cached_property
    def shape(self) -> Array:
        """Skewness and kurtosis, shape (2, O, T)."""
        std = np.where(self._constant, 1.0, self.spread[0])
        away, s = (self._each("mean") - self.mean) / std, self._each("spread")[:, 0] / std
        skewness, kurtosis = np.moveaxis(self._each("shape"), 1, 0)
        third = self.merged(s**3 * skewness + 3 * s**2 * away + away**3)
        fourth = self.merged(s**4 * kurtosis + 4 * s**3 * skewness * away + 6 * s**2 * away**2 + away**4)
        return np.stack([np.where(self._constant, 0.0, third), np.where(self._constant, 3.0, fourth)])

    def _closed(self, germs: list[int]) -> Array:
        """Return the share of the variance in the conditional expectation given some germs."""
        if not germs:
            return np.zeros(self.mean.shape)
        shape = self.coefficients.shape
        flat = self.coefficients.reshape(*shape[:2], -1)
        with one_thread():
            found = closed_variance(flat, self.multi_index, self.boxes, self.mean.ravel(), germs)
        share = found.reshape(self.mean.shape) / np.where(self._constant, 1.0, self.spread[1])
        return np.where(self._constant, 0.0, np.clip(share, 0.0, 1.0))


@dataclass(frozen=True, eq=False)
class SampledMoments:
    """Moments and Sobol' indices from samples of a function of germ points (K, d), which may omit terms (P,)."""

    space: GermSpace
    multi_index: Index
    size: tuple[int, ...]  # (O, T)
    evaluate: Callable[[Array], Array]
    without: Callable[[Mask, Array], Array]
    rms: Array | None = None  # root mean square error of the surrogate (O, T); None: unknown

    summands: ClassVar[int] = 1

    @property
    def shape_samples(self) -> int:
        """Number of surrogate samples for all moments."""
        return self._sums.count

    @property
    def sampling_errors(self) -> Array:
        """Standard errors (2, O, T) of mean and standard deviation due to the number of samples."""
        return self._sums.errors

    @property
    def mean(self) -> Array:
        """Expectation, shape (O, T)."""
        return self._moments[0]

    @property
    def spread(self) -> Array:
        """Standard deviation and variance, shape (2, O, T)."""
        return np.stack([np.sqrt(self._moments[1]), self._moments[1]])

    @property
    def shape(self) -> Array:
        """Skewness and kurtosis, shape (2, O, T)."""
        return np.stack(self._moments[2:])

    @property
    def sobol_second(self) -> Array:
        """Raise StudyError, because indices of pairs are not computed from samples."""
        raise StudyError(
            "This surrogate has no Sobol' indices of pairs, because its statistics are computed from samples. "
            "Expected a surrogate of polynomials at equal times. Use sobol_first and sobol_total."
        )

    @cached_property
    def tops(self) -> Array:
        """Mean square (1 + d, O, T) of the contribution of top-order terms, in total and by germ."""
        germs = spread_germs(self.space, TOPS, 0)
        whole, (_, edge) = self.evaluate(germs), top_order(self.multi_index)
        groups = (edge, *(edge & (degrees > 0) for degrees in self.multi_index.T))
        return np.array([np.mean((whole - self.without(group, germs)) ** 2, axis=0) for group in groups])

    @property
    def _moments(self) -> tuple[Array, Array, Array, Array]:
        """Mean, variance, skewness and kurtosis (O, T)."""
        return self._sums.moments

    @cached_property
    def _sums(self) -> PowerSums:
        """Sums of powers of the samples; their number is doubled until the sampling error is small, within limits."""
        germs = moment_germs(self.space, MOMENTS)
        found = PowerSums.of(self.evaluate, germs, self.evaluate(germs[0, :1])[0])
        small = 0.0 if self.rms is None else SMALL_SHARE * np.nan_to_num(self.rms)
        while 2 * found.count <= MOST_MOMENTS and 2 * found.count * found.shift.size <= MOST_VALUES:
            spread = np.sqrt(np.nan_to_num(found.moments[1])).max(axis=-1, keepdims=True)
            if (np.nan_to_num(found.errors) <= np.maximum(small, MOMENT_ERROR * spread)).all():
                break
            further = moment_germs(self.space, 2 * found.count)[:, found.count // REPLICATES :]
            more = found.joined(PowerSums.of(self.evaluate, further, found.shift, found.size))
            if not np.array_equal(np.isnan(more.moments[0]), np.isnan(found.moments[0])):
                break  # some of the further samples do not reach the last times
            found = more
        return found

    @cached_property
    def sobol(self) -> Array:
        """First-order and total indices, shape (2, germ, O, T), by Jansen's estimators."""
        d = self.space.dimension
        a, b = frozen_germs(self.space)
        other = self.evaluate(b)
        base = self.evaluate(a)
        variance = 0.5 * (base.var(axis=0) + other.var(axis=0))
        constant = constant_columns(self.mean, np.sqrt(variance)) | (variance == 0)
        scale = np.where(constant, 1.0, variance)
        first, total = np.zeros((2, d, *self.size))
        for k in range(d):
            mixed = a.copy()
            mixed[:, k] = b[:, k]
            found = self.evaluate(mixed)
            first[k] = 1.0 - np.mean((other - found) ** 2, axis=0) / (2 * scale)
            total[k] = np.mean((base - found) ** 2, axis=0) / (2 * scale)
        zero = np.broadcast_to(constant, first.shape)
        return np.where(zero, 0.0, np.clip(np.stack([first, total]), 0, 1))


def moment_germs(space: GermSpace, count: int) -> Array:
    """Return germ points (R, K, d) for moments: replicates with independent scrambling, `count` points in all."""
    return np.stack([spread_germs(space, count // REPLICATES, k) for k in range(REPLICATES)])


def frozen_germs(space: GermSpace) -> tuple[Array, Array]:
    """Return two independent sets of germ points (K, d) for Sobol' indices."""
    from scipy.stats import qmc

    d = space.dimension
    uniform = np.clip(qmc.Sobol(2 * d, seed=0).random(FROZEN), 1e-12, 1 - 1e-12)
    return space.from_uniform(uniform[:, :d]), space.from_uniform(uniform[:, d:])
