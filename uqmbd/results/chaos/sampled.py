"""Surrogates whose statistics are those of samples: what they evaluate is no polynomial of the germs."""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property

import numpy as np

from uqmbd.results.chaos.interface import Surrogate
from uqmbd.results.chaos.sampling import spread_germs
from uqmbd.results.chaos.terms import constant_columns
from uqmbd.typing import Array

__all__ = ["MOMENTS", "TOPS", "SampledSurrogate"]


MOMENTS = 16_384
"""Samples of the surrogate for mean and standard deviation."""
FROZEN = 4_096
"""Pairs of samples for Sobol' indices."""
TOPS = 256
"""Samples of the surrogate for the energy of its top order."""
BLOCK = 2_048
"""Samples that are evaluated at once."""


class SampledSurrogate(Surrogate):
    """A surrogate that evaluates; its moments and indices come from samples of it."""

    @property
    @abstractmethod
    def _tops(self) -> Array:
        """Mean square (1 + d, O, T) of what the terms of the top order change: all, and those of each germ."""

    @property
    def mean(self) -> Array:
        """Expectation, shape (O, T), in the units of the outputs."""
        return self._moments[0]

    @property
    def variance(self) -> Array:
        """Variance, shape (O, T)."""
        return self._moments[1]

    @property
    def std(self) -> Array:
        """Standard deviation, shape (O, T), in the units of the outputs."""
        return np.sqrt(self._moments[1])

    @property
    def shape_samples(self) -> int:
        """Samples of the surrogate from which skewness and kurtosis are."""
        return MOMENTS

    @property
    def sobol_first_germ(self) -> Array:
        """First-order indices, shape (germ, O, T), by Jansen's estimators on the surrogate."""
        return self._sobol[0]

    @property
    def sobol_total_germ(self) -> Array:
        """Total indices, shape (germ, O, T)."""
        return self._sobol[1]

    @property
    def top_energy(self) -> Array:
        """Mean square (O, T) of what the terms of the top order change at samples."""
        found: Array = self._tops[0]
        return found

    @property
    def top_energy_germ(self) -> Array:
        """The same of the terms that depend on a germ (d, O, T)."""
        found: Array = self._tops[1:]
        return found

    @property
    def variance_germ(self) -> Array:
        """Variance that vanishes with a germ (d, O, T)."""
        return np.asarray(self.sobol_total_germ * self.variance)

    @cached_property
    def _moments(self) -> tuple[Array, Array, Array, Array]:
        """Mean, variance, skewness and kurtosis (O, T)."""
        germs = spread_germs(self.space, MOMENTS, 0)
        shift = self.evaluate_germs(germs[:1])[0]
        sums, size = np.zeros((4, *self.labels.shape)), np.zeros(self.labels.shape, dtype=np.int64)
        for first in range(0, len(germs), BLOCK):
            x = self.evaluate_germs(germs[first : first + BLOCK]) - shift
            if not first:
                # by powers of two: fourth powers of small numbers are numbers still, and nothing is rounded
                largest = np.abs(x).max(axis=0)
                size = np.frexp(np.where(np.isfinite(largest), largest, 0.0))[1].astype(np.int64)
            x = np.ldexp(x, -size)
            power = x.copy()
            for k in range(4):
                sums[k] += power.sum(axis=0)
                power *= x
        one, two, three, four = sums / len(germs)
        variance = np.maximum(two - one**2, 0.0)
        mean = shift + np.ldexp(one, size)
        constant = constant_columns(mean, np.ldexp(np.sqrt(variance), size)) | (variance == 0)
        scale = np.where(constant, 1.0, np.sqrt(variance))
        third = (three - 3 * one * two + 2 * one**3) / scale**3
        fourth = (four - 4 * one * three + 6 * one**2 * two - 3 * one**4) / scale**4
        return (
            mean,
            np.where(constant, 0.0, np.ldexp(variance, 2 * size)),
            np.where(constant, 0.0, third),
            np.where(constant, 3.0, fourth),
        )

    @property
    def _shape_moments(self) -> tuple[Array, Array]:
        return self._moments[2:]

    @property
    def _frozen(self) -> tuple[Array, Array]:
        """Germ points of Sobol' indices: two of each pair."""
        from scipy.stats import qmc

        d = len(self.germ_names)
        uniform = np.clip(qmc.Sobol(2 * d, seed=0).random(FROZEN), 1e-12, 1 - 1e-12)
        return self.space.from_uniform(uniform[:, :d]), self.space.from_uniform(uniform[:, d:])

    @cached_property
    def _sobol(self) -> tuple[Array, Array]:
        d = len(self.germ_names)
        a, b = self._frozen
        other = self.evaluate_germs(b)
        base = self.evaluate_germs(a)
        variance = 0.5 * (base.var(axis=0) + other.var(axis=0))
        constant = constant_columns(self.mean, np.sqrt(variance)) | (variance == 0)
        scale = np.where(constant, 1.0, variance)
        first, total = np.zeros((2, d, *self.labels.shape))
        for k in range(d):
            mixed = a.copy()
            mixed[:, k] = b[:, k]
            found = self.evaluate_germs(mixed)
            first[k] = 1.0 - np.mean((other - found) ** 2, axis=0) / (2 * scale)
            total[k] = np.mean((base - found) ** 2, axis=0) / (2 * scale)
        zero = np.broadcast_to(constant, first.shape)
        return np.where(zero, 0.0, np.clip(first, 0, 1)), np.where(zero, 0.0, np.clip(total, 0, 1))
