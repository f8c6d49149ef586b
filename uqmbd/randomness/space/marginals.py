"""Maps from one standard variable to one input."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.randomness.germs import interpolate, invert, slope_at
from uqmbd.typing import Array

__all__ = ["Marginal"]


@dataclass(frozen=True, eq=False)
class Marginal:
    """Increasing map of a standard variable ``z`` to an input ``x``, and its inverse.

    The kind "affine" is ``x = shift + scale * z``. The kind "exponential" is ``x = shift + scale * exp(mu + sigma *
    z)``, for lognormal inputs. The kind "quantile" is a table of quantiles over the probit scale, in which ``z`` is
    standard normal, with linear extrapolation. A negative scale reverses the map.

    >>> lognormal = Marginal("exponential", sigma=0.5, bounds=(0.0, np.inf))
    >>> x = lognormal.to_input(np.array([0.0, 2.0])); x.round(6).tolist()
    [1.0, 2.718282]
    >>> lognormal.to_germ(x).round(12).tolist()
    [0.0, 2.0]
    """

    kind: str
    shift: float = 0.0
    scale: float = 1.0
    mu: float = 0.0
    sigma: float = 1.0
    bounds: tuple[float, float] = (-np.inf, np.inf)  # support of the input, ascending
    table: Array | None = None  # (2, M) knots and quantiles

    def to_input(self, z: Array) -> Array:
        """Map the standard variable, of any shape, to the input."""
        values: Array
        if self.kind == "affine":
            values = self.shift + self.scale * z
        elif self.kind == "exponential":
            values = self.shift + self.scale * np.exp(self.mu + self.sigma * np.ascontiguousarray(z))
        else:
            assert self.table is not None
            values = np.clip(interpolate(self.table, z), *self.bounds)
        return values

    def slope(self, z: Array) -> Array:
        """Return the derivative of the input with respect to the standard variable; 0 if the input is at a bound.

        >>> Marginal("exponential", sigma=0.5, bounds=(0.0, np.inf)).slope(np.array([0.0])).tolist()
        [0.5]
        """
        if self.kind == "affine":
            return np.full(np.shape(z), float(self.scale))
        if self.kind == "exponential":
            return np.asarray(self.sigma * (self.to_input(z) - self.shift))
        assert self.table is not None
        low, high = self.bounds
        free = interpolate(self.table, z)
        return np.where((free >= low) & (free <= high), slope_at(self.table, z), 0.0)

    def to_germ(self, x: Array) -> Array:
        """Map the input, of any shape, to the standard variable; NaN outside of the support."""
        values: Array
        if self.kind == "affine":
            values = (x - self.shift) / self.scale
        elif self.kind == "exponential":
            ratio = np.ascontiguousarray((x - self.shift) / self.scale)
            with np.errstate(divide="ignore", invalid="ignore"):
                values = (np.log(ratio) - self.mu) / self.sigma
        else:
            assert self.table is not None
            values = invert(self.table, np.clip(x, *self.bounds))
        low, high = self.bounds
        finite = [abs(b) for b in self.bounds if np.isfinite(b)]
        slack = 1e-12 * max(finite, default=0.0)
        if np.isfinite(low) and np.isfinite(high):
            slack = max(slack, 1e-9 * (high - low))
        with np.errstate(invalid="ignore"):
            outside = ~((x >= low - slack) & (x <= high + slack))
        return np.where(outside | ~np.isfinite(values), np.nan, values)
