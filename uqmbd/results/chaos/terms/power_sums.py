"""Moments of samples of a surrogate from sums of powers, with sampling errors from replicates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqmbd.results.chaos.terms.moments import constant_columns
from uqmbd.results.statistics import studentised
from uqmbd.typing import Array, Index, Mask

__all__ = ["REPLICATES", "PowerSums"]

REPLICATES = 8
"""Number of Sobol' sequences with independent scrambling; the scatter of their moments gives the sampling error.

Consecutive blocks of one sequence would be more accurate for smooth functions. But for periodic functions in phase with
the points, all blocks have equal errors; the sampling error from their scatter was up to fifty times too small.
"""
PIECE = 2_048
"""Maximum number of samples that are evaluated at once."""


@dataclass(frozen=True, eq=False)
class PowerSums:
    """Sums of the first four powers of samples in independent replicates."""

    shift: Array  # (O, T), subtracted from the samples
    size: Index  # (O, T), exponents of the powers of two by which samples are divided
    sums: Array  # (replicates, 4, O, T)
    count: int  # number of samples

    @classmethod
    def of(cls, evaluate: Callable[[Array], Array], germs: Array, shift: Array, size: Index | None = None) -> PowerSums:
        """Sum powers of a function at germ points (R, K, d)."""
        sums = np.zeros((len(germs), 4, *shift.shape))
        for r, points in enumerate(germs):
            for first in range(0, len(points), PIECE):
                x = evaluate(points[first : first + PIECE]) - shift
                if size is None:
                    # scale by powers of two, without rounding, so that fourth powers of small numbers do not underflow
                    largest = np.abs(x).max(axis=0)
                    size = np.frexp(np.where(np.isfinite(largest), largest, 0.0))[1].astype(np.int64)
                x = np.ldexp(x, -size)
                power = x.copy()
                for k in range(4):
                    sums[r, k] += power.sum(axis=0)
                    power *= x
        scale = np.zeros(shift.shape, dtype=np.int64) if size is None else size
        return cls(shift, scale, sums, germs.shape[0] * germs.shape[1])

    def joined(self, other: PowerSums) -> PowerSums:
        """Return the sums over the samples of both objects, for each replicate."""
        return PowerSums(self.shift, self.size, self.sums + other.sums, self.count + other.count)

    @cached_property
    def moments(self) -> tuple[Array, Array, Array, Array]:
        """Mean, variance, skewness and kurtosis (O, T)."""
        one, two, three, four = self.sums.sum(axis=0) / self.count
        variance = np.maximum(two - one**2, 0.0)
        mean = self.shift + np.ldexp(one, self.size)
        constant = self._constant
        scale = np.where(constant, 1.0, np.sqrt(variance))
        third = (three - 3 * one * two + 2 * one**3) / scale**3
        fourth = (four - 4 * one * three + 6 * one**2 * two - 3 * one**4) / scale**4
        return (
            mean,
            np.where(constant, 0.0, np.ldexp(variance, 2 * self.size)),
            np.where(constant, 0.0, third),
            np.where(constant, 3.0, fourth),
        )

    @cached_property
    def errors(self) -> Array:
        """Standard errors (2, O, T) of mean and standard deviation, widened for the number of replicates."""
        one, two = self.sums[:, :2].sum(axis=0) / self.count
        blocks = self.sums[:, :2] * (len(self.sums) / self.count)
        variance = np.maximum(two - one**2, 0.0)
        spread = np.where(self._constant, 1.0, np.sqrt(variance))
        squares = blocks[:, 1] - 2 * one * blocks[:, 0] + one**2  # mean square deviations, by replicate
        found = np.stack([blocks[:, 0].std(axis=0, ddof=1), squares.std(axis=0, ddof=1) / (2 * spread)])
        found *= studentised(len(self.sums)) / np.sqrt(len(self.sums))
        return np.where(self._constant, 0.0, np.ldexp(found, self.size))

    @cached_property
    def _constant(self) -> Mask:
        one, two = self.sums[:, :2].sum(axis=0) / self.count
        variance = np.maximum(two - one**2, 0.0)
        mean = self.shift + np.ldexp(one, self.size)
        found: Mask = constant_columns(mean, np.ldexp(np.sqrt(variance), self.size)) | (variance == 0)
        return found
