"""Distribution of chaospy whose quantile function is a table.

`chaospy.UserDistribution` contains functions, which cannot be sent to worker processes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from chaospy.distributions.baseclass import SimpleDistribution
from scipy.interpolate import PchipInterpolator
from scipy.special import ndtr, ndtri

from uqmbd.typing import Array

__all__ = ["TabulatedDistribution"]


class TabulatedDistribution(SimpleDistribution):
    """Distribution from its values (N,) at quantiles (N,) of a standard normal variable, both increasing."""

    def __init__(self, normal: Array, values: Array) -> None:
        kept = np.concatenate([[True], np.diff(values) > 0])
        self._normal, self._values = np.asarray(normal[kept]), np.asarray(values[kept])
        middle, high = np.interp([0.0, 1.0], self._normal, self._values)
        super().__init__(parameters={}, repr_args=[f"median={middle:.6g}", f"sd={high - middle:.3g}"])
        self._quantile = PchipInterpolator(self._normal, self._values)
        self._inverse = PchipInterpolator(self._values, self._normal)

    def _ppf(self, u: Array, **_: Any) -> Array:
        return np.asarray(self._quantile(np.clip(ndtri(u), self._normal[0], self._normal[-1])))

    def _cdf(self, x: Array, **_: Any) -> Array:
        return np.asarray(ndtr(self._inverse(np.clip(x, self._values[0], self._values[-1]))))

    def _pdf(self, x: Array, **_: Any) -> Array:
        inside = np.clip(x, self._values[0], self._values[-1])
        density = np.exp(-0.5 * self._inverse(inside) ** 2) / np.sqrt(2 * np.pi) * self._inverse(inside, 1)
        return np.asarray(np.where(inside == x, density, 0.0))

    def _lower(self, **_: Any) -> float:
        return float(self._values[0])

    def _upper(self, **_: Any) -> float:
        return float(self._values[-1])
