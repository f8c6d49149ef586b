"""Posterior as dependent random variables, with smooth marginal distributions and a Gaussian copula.

Each input is an increasing function of a standard normal variable. The correlations of these variables are those of
the normal scores of the draws: standard normal quantiles at their ranks. The function is the first of the following
that agrees with the draws. For an input with an independent prior, the first one is the transform of
the prior, applied to an increasing cubic. Next come an increasing cubic, and a curve through quantiles of the draws.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from scipy import stats
from scipy.interpolate import PchipInterpolator
from scipy.special import ndtr, ndtri

import uqmbd
from uqmbd.typing import Array
from uqmbd_calibration.posterior_search import Found

__all__ = ["CURVED", "GRID", "joint_distribution", "marginals_of"]


GRID = np.linspace(-8.0, 8.0, 1601)
"""Values of the standard normal variable at which marginals are tabulated."""

KNOTS = np.linspace(-3.0, 3.0, 13)
"""Values of the standard normal variable at which a curve interpolates quantiles."""

CURVED = 0.5
"""Curvature of a pair above which a Gaussian copula is not accurate."""

MOMENTS, AWAY = 0.03, 0.1
"""Limits for a table, relative to the standard deviation of the draws: differences of mean and standard deviation, and
root mean square distance of the table from the draws."""


def marginals_of(found: Found, vectors: Array) -> xr.Dataset:
    """Return tables of the marginals of the inputs, and the correlation of their normal variables.

    `vectors` (K, N): draws of the posterior.
    """
    arranged = found.arrangement
    unknown = arranged.unknowns.inputs
    variables = arranged.points[0].study.mechanism.inputs.variables
    values = arranged.physical(vectors)
    normal = ndtri((stats.rankdata(values, axis=0) - 0.5) / len(values))
    correlation = np.corrcoef(normal, rowvar=False).reshape(len(unknown), len(unknown))
    tables = np.empty((len(GRID), len(unknown)))
    for k, one in enumerate(unknown):
        variable, tried = variables[one.input], []
        if len(variable.joint.names) == 1:
            at = np.zeros((len(GRID), arranged.unknowns.dimension))
            at[:, k] = np.clip(increasing_cubic(normal[:, k], vectors[:, k]), -8.0, 8.0)
            tried.append(arranged.physical(at)[:, k])
        tried.append(increasing_cubic(normal[:, k], values[:, k]))
        lower, upper = map(float, variable.joint.bounds[variable.component])
        tables[:, k] = _selected_table(tried, normal[:, k], values[:, k], lower, upper)
    names = np.array([one.name for one in unknown], dtype=np.str_)
    return xr.Dataset(
        {
            "quantile": (("normal", "input"), tables),
            "correlation": (("input", "other"), correlation),
            "curvature": (("input", "other"), curvature(normal)),
        },
        coords={"normal": GRID, "input": names, "other": names},
    )


def curvature(normal: Array) -> Array:
    """Return the deviation of pairs of normal variables (K, d) from a Gaussian copula, (d, d), by their joint moments.

    The result is the larger of two moments. The first is the mean of the square of one variable times the other; for a
    Gaussian copula it is zero. The second is the error of the mean product of squares, for pairs with a correlation
    below 0.5.

    >>> x, y = np.random.default_rng(0).standard_normal((2, 4000))
    >>> round(float(curvature(np.stack([x, y], axis=1))[0, 1]), 1)
    0.0
    """
    squares = normal**2
    skewed = np.abs((squares - squares.mean(axis=0)).T @ normal) / len(normal)
    correlation = np.atleast_2d(np.corrcoef(normal, rowvar=False))
    expected = np.multiply.outer(squares.mean(axis=0), squares.mean(axis=0)) + 2 * correlation**2
    lacking = np.where(np.abs(correlation) < 0.5, np.abs(squares.T @ squares / len(normal) - expected), 0.0)
    found = np.maximum(np.maximum(skewed, skewed.T), lacking)
    np.fill_diagonal(found, 0.0)
    return np.asarray(found)


def _selected_table(tables: list[Array], normal: Array, values: Array, lower: float, upper: float) -> Array:
    """Return the first table within bounds and close to the draws; without such a table, a curve through quantiles."""
    # chaospy states finite bounds even for an infinite support: if a draw is beyond a bound, the support is infinite
    lower = lower if lower <= values.min() else -np.inf
    upper = upper if upper >= values.max() else np.inf
    mean, sd = values.mean(), max(float(values.std()), 1e-300)
    for table in tables:
        own = np.interp(normal, GRID, table)
        close = max(abs(own.mean() - mean), abs(own.std() - sd)) <= MOMENTS * sd
        if close and np.sqrt(((own - values) ** 2).mean()) <= AWAY * sd and lower <= table[0] and table[-1] <= upper:
            return table
    return through_quantiles(values, lower, upper)


def through_quantiles(values: Array, lower: float = -np.inf, upper: float = np.inf) -> Array:
    """Return an increasing curve through quantiles of values, at `GRID`, within the bounds.

    >>> table = through_quantiles(np.linspace(0, 1, 10001), 0.0, 1.0)
    >>> [round(float(np.interp(z, GRID, table)), 2) for z in (-8.0, -1.0, 0.0, 1.0, 8.0)]
    [0.0, 0.16, 0.5, 0.84, 1.0]
    """
    # the quantile of the last knot needs enough draws beyond it
    reach = min(3.0, -float(ndtri(min(10.0 / len(values), 0.4))))
    knots = KNOTS * reach / KNOTS[-1]
    quantiles = np.quantile(values, ndtr(knots))
    inner = PchipInterpolator(knots, quantiles)
    found = inner(np.clip(GRID, -reach, reach))
    for end, bound in ((-reach, lower), (reach, upper)):
        rows = end * GRID > reach**2
        slope = max(float(inner(end, 1)), 0.0)
        left = bound - inner(end)
        beyond = slope * (GRID[rows] - end)
        # extrapolate linearly, or with exponential approach to a finite bound
        found[rows] += left * -np.expm1(-beyond / left) if np.isfinite(left) and left else beyond * bool(left)
    return np.asarray(found)


def increasing_cubic(normal: Array, values: Array) -> Array:
    """Return an increasing cubic of a normal variable, fitted to values, at `GRID`."""
    inner = np.abs(normal) < 3.0
    for degree in (3, 2, 1):
        coefficients = np.polynomial.polynomial.polyfit(normal[inner], values[inner], degree)
        found = np.polynomial.polynomial.polyval(GRID, coefficients)
        if np.all(np.diff(found[np.abs(GRID) <= 6.0]) > 0):
            # extrapolate linearly beyond the draws
            return np.asarray(_extrapolated(found))
    return np.asarray(values.mean() + max(values.std(), 1e-12) * GRID)


def _extrapolated(values: Any) -> Array:
    inner = np.abs(GRID) <= 4.0
    first, last = np.flatnonzero(inner)[[0, -1]]
    step = GRID[1] - GRID[0]
    low, high = values[first + 1] - values[first], values[last] - values[last - 1]
    found = values.copy()
    found[:first] = values[first] + low / step * (GRID[:first] - GRID[first])
    found[last:] = values[last] + high / step * (GRID[last:] - GRID[last])
    return np.asarray(found)


def joint_distribution(data: xr.Dataset, names: list[str]) -> Any:
    """Return a chaospy distribution of the selected inputs."""
    tables = data["quantile"].sel(input=names).values
    if len(names) == 1:
        return uqmbd.tabulated(GRID, tables[:, 0])
    return uqmbd.tabulated(GRID, tables, data["correlation"].sel(input=names, other=names).values)
