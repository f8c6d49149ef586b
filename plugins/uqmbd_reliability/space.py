"""Standard normal space of the inputs, in which germs of any family are functions of standard normal variables."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import uqmbd
from uqmbd.typing import Array

__all__ = ["StandardSpace"]


@dataclass(frozen=True, eq=False)
class StandardSpace:
    """Standard normal variables, one for each germ, and the inputs as functions of them.

    A Hermite germ is a standard normal variable; other germs are quantile functions of one.
    """

    space: uqmbd.extend.GermSpace
    variables: tuple[uqmbd.RandomVariable, ...] = ()

    @property
    def dimension(self) -> int:
        """Number of variables."""
        return self.space.dimension

    @property
    def paths(self) -> list[int]:
        """Numbers of the inputs that are keys of sampled paths."""
        return [k for k, variable in enumerate(self.variables) if variable.is_key]

    def to_germs(self, points: Array) -> Array:
        """Map standard normal variables (K, d) to germs."""
        return self.space.from_normal(points)

    def to_inputs(self, points: Array) -> Array:
        """Map standard normal variables (K, d) to inputs, in their units."""
        return self.space.to_inputs(self.to_germs(points))

    def own(self) -> tuple[Array, Array]:
        """Return the factor (d, d) from independent to correlated normal variables, and its transposed inverse.

        Inputs with a Gaussian copula are increasing functions of correlated normal variables ``z = factor u``. The
        score of their density by the mean of z_i is ``(factor^-T u)_i``. Rows of inputs with another dependence are
        NaN.
        """
        factor = np.eye(self.dimension)
        for group in self.space.groups:
            columns = np.array(group.columns)
            if not group.independent:
                factor[np.ix_(columns, columns)] = getattr(group, "factor", np.nan)
        known = np.isfinite(factor).all(axis=1)
        inverse = np.full_like(factor, np.nan)
        inverse[np.ix_(known, known)] = np.linalg.inv(factor[np.ix_(known, known)]).T
        inverse[np.ix_(known, ~known)] = 0.0
        return factor, inverse

    def scores(self, points: Array) -> Array:
        """Return the scores of the normal variables of the inputs, shape (K, 2, d).

        A score is the derivative of the log-density with respect to the mean, or to the logarithm of the standard
        deviation.
        """
        factor, inverse = self.own()
        shifted = points @ np.nan_to_num(inverse).T
        own = points @ np.nan_to_num(factor).T
        found = np.stack([shifted, own * shifted - 1.0], axis=1)
        found[:, :, np.isnan(inverse).any(axis=1)] = np.nan
        return np.asarray(found)

    def moment_slopes(self) -> Array:
        """Return the derivatives of the moments of each input by the moments of its normal variable, shape (2, 2, d).

        The axes are the moment of the input (mean, deviation), the parameter of its normal variable, and the input.
        The derivatives follow from Stein's identity, so they exist for discrete inputs, too.
        """
        factor, _ = self.own()
        z = np.linspace(-8.2, 8.2, 8001)
        weights = np.exp(-0.5 * z**2)
        weights /= weights.sum()
        slopes = np.full((2, 2, self.dimension), np.nan)
        for k in range(self.dimension):
            if np.isnan(factor[k]).any():
                continue
            # point with the required z_k, along the row of the factor, which has the norm one
            x = self.to_inputs(z[:, None] * factor[k])[:, k]
            mean = weights @ x
            away = x - mean
            deviation = np.sqrt(weights @ away**2)
            for row, score in enumerate((z, z**2 - 1.0)):
                slopes[0, row, k] = weights @ (away * score)
                slopes[1, row, k] = weights @ (away**2 * score) / (2.0 * deviation) if deviation > 0 else 0.0
        return slopes
