"""Moments of samples of a surrogate from sums of powers, with sampling errors from blocks of samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqmbd.results.chaos.terms.moments import constant_columns
from uqmbd.results.statistics import studentised
from uqmbd.typing import Array, Index, Mask

__all__ = ["PowerSums"]

BLOCKS = 8
"""Number of consecutive blocks of samples; the scatter of their moments gives the sampling error."""
PIECE = 2_048
"""Maximum number of samples that are evaluated at once."""


@dataclass(frozen=True, eq=False)
class PowerSums:
    """Sums of the first four powers of samples in consecutive blocks, of which the scatter gives the sampling error.

    Consecutive blocks of a Sobol' sequence are spread evenly too.  Their errors compensate one another in part, so that
    the standard error from their scatter is an upper estimate for smooth functions.
    """

    shift: Array  # (O, T), subtracted from the samples
    size: Index  # (O, T), exponents of two by which samples are divided
    sums: Array  # (blocks, 4, O, T)
    count: int  # number of samples

    @classmethod
    def of(cls, evaluate: Callable[[Array], Array], germs: Array, shift: Array, size: Index | None = None) -> PowerSums:
        """Sum powers of a function at germ points (K, d)."""
        sums, length = np.zeros((BLOCKS, 4, *shift.shape)), len(germs) // BLOCKS
        for first in range(0, len(germs), min(PIECE, length)):
            x = evaluate(germs[first : first + min(PIECE, length)]) - shift
            if size is None:
                # scale by powers of two, without rounding, so that fourth powers of small numbers do not underflow
                largest = np.abs(x).max(axis=0)
                size = np.frexp(np.where(np.isfinite(largest), largest, 0.0))[1].astype(np.int64)
            x = np.ldexp(x, -size)
            power = x.copy()
            for k in range(4):
                sums[first // length, k] += power.sum(axis=0)
                power *= x
        return cls(shift, np.zeros(shift.shape, dtype=np.int64) if size is None else size, sums, len(germs))

    def joined(self, other: PowerSums) -> PowerSums:
        """Return the sums of both, in blocks of twice the length."""
        pairs = np.concatenate([part.sums.reshape(-1, 2, *part.sums.shape[1:]).sum(axis=1) for part in (self, other)])
        return PowerSums(self.shift, self.size, pairs, self.count + other.count)

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
        """Standard errors (2, O, T) of mean and standard deviation, widened for the number of blocks."""
        one, two = self.sums[:, :2].sum(axis=0) / self.count
        blocks = self.sums[:, :2] * (len(self.sums) / self.count)
        variance = np.maximum(two - one**2, 0.0)
        spread = np.where(self._constant, 1.0, np.sqrt(variance))
        squares = blocks[:, 1] - 2 * one * blocks[:, 0] + one**2  # mean square deviation from the mean of all, by block
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
