"""How far to trust a chaos: its error at realisations that did not enter it."""

from __future__ import annotations

import numpy as np

from uqmbd.results.chaos.terms import constant_columns
from uqmbd.results.statistics import divisor
from uqmbd.typing import Array

__all__ = ["SPREAD_FLOOR", "first_above", "reference_spread", "stated_error"]


SPREAD_FLOOR = 0.01
"""Where the standard deviation is smaller than this part of its maximum over time, that part stands in for it."""


def reference_spread(std: Array) -> Array:
    """Return the standard deviation (O, T) that errors are compared with.

    At times where an output hardly varies (a common start, a passage through a nodal point) an error relative to the
    standard deviation there says nothing: 1 % of its maximum over time stands in for it.
    """
    return np.asarray(np.maximum(std, SPREAD_FLOOR * std.max(axis=-1, keepdims=True, initial=0.0)))


def stated_error(
    surrogate: Array, response: Array, mean: Array, std: Array, *, terms: int = 1, weights: Array | None = None
) -> Array:
    """Return the error of a surrogate relative to the standard deviation.

    Parameters
    ----------
    surrogate, response : array, shape (V, O, T)
        Of the chaos, and of the mechanism, at the same V germ points.
    mean, std : array, shape (O, T)
        Of the chaos.
    terms : int
        From so many the standard deviation comes, for its rounding.
    weights : array, shape (V,), optional
        Of the points, where they are spread unevenly; they sum to 1.

    Returns
    -------
    array, shape (O, T)
        Root mean square over V of the difference, over :func:`reference_spread`. An output that does not vary in the
        chaos at any time is compared with the root mean square of the responses about its mean: 1, the surrogate
        misses all. A difference that is rounding of the mean counts as 0.
    """
    error = _root_mean_square(surrogate - response, weights)
    constant = constant_columns(mean, std, terms)
    missed = _root_mean_square(response - mean, weights)
    still = constant.all(axis=-1, keepdims=True)
    spread = reference_spread(np.where(still, missed, np.where(constant, 0.0, std)))
    rounding = constant_columns(mean, error, terms) & constant
    return np.where(rounding, 0.0, error / divisor(spread))


def first_above(values: Array, limit: float) -> int | None:
    """Return the first index at which values (T,) exceed a limit, or None."""
    above = values > limit
    return int(above.argmax()) if above.any() else None


def _root_mean_square(values: Array, weights: Array | None = None) -> Array:
    scale = np.abs(values).max(axis=0)
    scaled = values / divisor(scale)
    mean = np.mean(scaled * scaled, axis=0) if weights is None else np.tensordot(weights, scaled * scaled, axes=1)
    result: Array = scale * np.sqrt(mean)
    return result
