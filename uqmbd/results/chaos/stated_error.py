"""Stated error of a chaos: its error at realisations that did not enter it, in numbers and in words."""

from __future__ import annotations

import numpy as np

from uqmbd.results.chaos.terms import constant_columns
from uqmbd.results.schema import SPREAD_FLOOR, reference_spread
from uqmbd.results.statistics import divisor
from uqmbd.typing import Array
from uqmbd.wording import format_at_most, format_percent

__all__ = [
    "SPREAD_FLOOR",
    "error_words",
    "factor_words",
    "first_above",
    "reference_spread",
    "root_mean_square",
    "compute_stated_error",
    "stated_words",
    "uncertainty_factor",
    "weighted_std",
]


MOST = 50.0
"""Largest exponent of a factor by which an error may be off."""

KNOWN = 2.0
"""Factor up to which a stated error counts as known."""


def compute_stated_error(
    surrogate: Array,
    response: Array,
    mean: Array,
    std: Array,
    weights: Array,
    *,
    terms: int = 1,
    unseen: Array | float = 0.0,
) -> Array:
    """Return the weighted root mean square (O, T) of surrogate minus response (V, O, T), over `reference_spread`.

    At least `unseen` (O, T), an error that the realisations miss.
    """
    # An output that does not vary in the chaos at any time is compared with the root mean square of the responses about
    # its mean: 1, the surrogate misses all.  A difference that is rounding of the mean counts as 0; the standard
    # deviation comes from so many terms, for its rounding.
    error = np.maximum(root_mean_square(surrogate - response, weights), unseen)
    constant = constant_columns(mean, std, terms)
    missed = root_mean_square(response - mean, weights)
    # a time at which nothing is known does not make the output vary
    still = (constant | np.isnan(std)).all(axis=-1, keepdims=True)
    spread = reference_spread(np.where(still & ~np.isnan(std), missed, np.where(constant, 0.0, std)))
    rounding = constant_columns(mean, error, terms) & constant
    return np.where(rounding, 0.0, error / divisor(spread))


def first_above(values: Array, limit: float) -> int | None:
    """Return the first index at which values (T,) exceed a limit, or None."""
    above = values > limit
    return int(above.argmax()) if above.any() else None


def root_mean_square(values: Array, weights: Array) -> Array:
    """Return the root mean square over the first axis of values (V, ...), by weights (V,) that sum to 1."""
    scale = np.abs(values).max(axis=0)
    scaled = values / divisor(scale)
    result: Array = scale * np.sqrt(np.tensordot(weights, scaled * scaled, axes=1))
    return result


def uncertainty_factor(wrong: Array, weights: Array) -> Array:
    """Return by which factor the root mean square (...) of weighted errors (V, ...) may be off, by their scatter."""
    # Two standard errors of the logarithm of the mean square, which are those of independent points, make one factor of
    # the root: exp(r) with the relative standard error r of the mean square.  1 where there is no error; infinite where
    # there is one point, which has no scatter.
    scale = np.abs(wrong).max(axis=0)
    square = (wrong / divisor(scale)) ** 2
    mean = np.tensordot(weights, square, axes=1)
    # as of n points of the same weight, n - 1 of which are free
    free = 1.0 - float(weights @ weights)
    if len(weights) == 1 or free <= 0:
        return np.where(scale > 0, np.inf, np.where(scale == 0, 1.0, np.nan))
    scatter = np.sqrt(np.tensordot(weights**2, (square - mean) ** 2, axes=1) / free)
    # what is not known at all would overflow
    return np.asarray(np.exp(np.minimum(np.where(scale == 0, 0.0, scatter / divisor(mean)), MOST)))


def weighted_std(values: Array, weights: Array) -> Array:
    """Return the standard deviation over the first axis of values (V, ...), by weights (V,); 0 of none.

    >>> weighted_std(np.array([[0.0], [4.0]]), np.array([3.0, 1.0])).round(3).tolist()
    [1.732]
    """
    if not len(values):
        return np.zeros(values.shape[1:])
    weights = weights / weights.sum()
    shift = np.tensordot(weights, values, axes=1)
    return root_mean_square(values - shift, weights)


def stated_words(whose: str, error: Array, times: Array | None, limit: float, remedy: str = "raise the order") -> str:
    """Say how large a stated error (T,), or (1,) without times, is, and what to do where it passes a limit.

    Every place that tells a stated error tells it in these words.

    >>> import numpy as np
    >>> stated_words("surrogate", np.array([0.002, 0.07]), np.array([0.0, 1.0]), 0.01)
    'stated error of the surrogate below 1 % of the standard deviation until 1 s, 7.0 % at 1 s; raise the order'
    """
    advice = f"; {remedy}" if remedy and np.any(error > limit) else ""
    return f"stated error of the {whose} {error_words(error, times, limit)}{advice}"


def factor_words(factor: float, count: int) -> str:
    """Return a text on the accuracy of the largest stated error, from a number of realisations.

    >>> factor_words(1.5, 16), factor_words(3.14, 8)
    ('', ', known to a factor of 3.1 only from 8 verification realisations: raise verify')
    """
    if not factor > KNOWN:
        return ""
    if count == 1:
        return ", of which one verification realisation knows little: raise verify"
    return f", known to a factor of {factor:.2g} only from {count} verification realisations: raise verify"


def error_words(error: Array, times: Array | None, limit: float) -> str:
    """Return a text on an error (T,), or (1,) without times, and on the time from which it exceeds a limit.

    Of times at which it is NaN, the first is named.

    >>> error_words(np.array([0.002, np.nan, 0.03]), np.array([0.0, 1.0, 2.0]), 0.1)
    'at most 3.0 % of the standard deviation (at 2 s), unknown at 1 of 3 times from 1 s on'
    """
    if times is None:
        return f"{format_percent(float(error[0]))} of the standard deviation"
    unknown = np.isnan(error)
    if unknown.all():
        return "unknown at all times"
    if unknown.any():
        known, since = error_words(error[~unknown], times[~unknown], limit), times[unknown.argmax()]
        return f"{known}, unknown at {unknown.sum()} of {len(error)} times from {since:g} s on"
    first, worst = first_above(error, limit), int(error.argmax())
    if first is None:
        return f"{format_at_most(float(error[worst]))} of the standard deviation (at {times[worst]:g} s)"
    since = f"below {100 * limit:g} % of the standard deviation until {times[first]:g} s"
    if first == 0:
        since = f"above {100 * limit:g} % of the standard deviation from {times[0]:g} s on"
        if not np.all(error > limit):
            since = f"above {100 * limit:g} % of the standard deviation already at {times[0]:g} s"
    return f"{since}, {format_percent(float(error[worst]))} at {times[worst]:g} s"
