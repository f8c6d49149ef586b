"""The posterior as dependent random variables: smooth marginal distributions, and a Gaussian copula.

In the standard normal space of the prior, the posterior of each input is an increasing cubic of a standard normal
variable, whose correlations are those of the ranks.  The inputs are the prior's own functions of that.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from scipy.special import ndtri
from scipy.stats import rankdata

import uqmbd
from uqmbd.typing import Array
from uqmbd_calibration.finding import Found

__all__ = ["GRID", "joint_distribution", "marginals_of"]


GRID = np.linspace(-8.0, 8.0, 1601)
"""Standard normal variable at which marginals are tabulated."""


def marginals_of(found: Found, vectors: Array) -> xr.Dataset:
    """Return tables of the marginals of the inputs, and the correlation of their normal variables.

    Parameters
    ----------
    found : Found
    vectors : array, shape (K, N)
        Draws of the posterior.
    """
    arranged = found.arrangement
    unknown = arranged.unknowns.inputs
    own = vectors[:, : len(unknown)]
    normal = ndtri((rankdata(own, axis=0) - 0.5) / len(own))
    correlation = np.corrcoef(normal, rowvar=False).reshape(len(unknown), len(unknown))
    moved = np.stack([increasing_cubic(normal[:, k], own[:, k]) for k in range(len(unknown))], axis=1)
    points = np.tile(own.mean(axis=0), (len(GRID), 1))
    tables = np.empty((len(GRID), len(unknown)))
    for k in range(len(unknown)):
        at = np.zeros((len(GRID), arranged.unknowns.dimension))
        at[:, : len(unknown)] = points
        at[:, k] = np.clip(moved[:, k], -8.0, 8.0)
        tables[:, k] = arranged.physical(at)[:, k]
    names = np.array([one.name for one in unknown], dtype=np.str_)
    return xr.Dataset(
        {"quantile": (("normal", "input"), tables), "correlation": (("input", "other"), correlation)},
        coords={"normal": GRID, "input": names, "other": names},
    )


def increasing_cubic(normal: Array, values: Array) -> Array:
    """Fit an increasing cubic of a normal variable to values, and return it at `GRID`."""
    inner = np.abs(normal) < 3.0
    for degree in (3, 2, 1):
        coefficients = np.polynomial.polynomial.polyfit(normal[inner], values[inner], degree)
        found = np.polynomial.polynomial.polyval(GRID, coefficients)
        if np.all(np.diff(found[np.abs(GRID) <= 6.0]) > 0):
            # beyond what draws tell it goes on straight
            return np.asarray(_straight(found))
    return np.asarray(values.mean() + max(values.std(), 1e-12) * GRID)


def _straight(values: Any) -> Array:
    inner = np.abs(GRID) <= 4.0
    first, last = np.flatnonzero(inner)[[0, -1]]
    step = GRID[1] - GRID[0]
    low, high = values[first + 1] - values[first], values[last] - values[last - 1]
    found = values.copy()
    found[:first] = values[first] + low / step * (GRID[:first] - GRID[first])
    found[last:] = values[last] + high / step * (GRID[last:] - GRID[last])
    return np.asarray(found)


def joint_distribution(data: xr.Dataset, names: list[str]) -> Any:
    """Return a chaospy distribution of some inputs."""
    tables = data["quantile"].sel(input=names).values
    if len(names) == 1:
        return uqmbd.tabulated(GRID, tables[:, 0])
    return uqmbd.tabulated(GRID, tables, data["correlation"].sel(input=names, other=names).values)
