"""Compute the stated error of a surrogate from verification realisations, which no fit uses, and describe the error."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.results.chaos.terms import constant_columns
from uqmbd.results.schema import SPREAD_FLOOR, reference_spread
from uqmbd.results.statistics import divisor
from uqmbd.typing import Array, Mask
from uqmbd.wording import FACTOR, format_at_most, format_part, format_percent

__all__ = [
    "SPREAD_FLOOR",
    "error_words",
    "exceeds_locally",
    "factor_words",
    "first_above",
    "reference_spread",
    "root_mean_square",
    "compute_stated_error",
    "spread_words",
    "stated_words",
    "uncertainty_factor",
    "weighted_std",
]


MOST = 50.0
"""Maximum exponent in the uncertainty factor of an error."""

SPREAD = "the standard deviation"
"""Text on the denominator of a stated error, if the lower limit of the denominator has no effect."""

FLOORED = f"{SPREAD}, taken as at least {100 * SPREAD_FLOOR:g} % of its maximum"
"""Text on the denominator of a stated error, if its lower limit has an effect (see `exceeds_locally`)."""

KNOWN = 2.0
"""Uncertainty factor up to which texts do not mention the uncertainty of a stated error."""

NEIGHBOUR = 0.25
"""Minimum stated error, as a fraction of the error at neighbouring times (`moving_errors`)."""

CLOSE = 0.05
"""Maximum step between neighbouring times, relative to the whole time; more distant times are independent."""

FEW, SHARE = 2.0, 0.2
"""Effective number of realisations, and share of all realisations, up to which few realisations cause an error."""


def compute_stated_error(
    surrogate: Array,
    response: Array,
    mean: Array,
    std: Array,
    weights: Array,
    *,
    terms: int = 1,
    unseen: Array | float = 0.0,
    times: Array | None = None,
) -> Array:
    """Return the weighted root mean square (O, T) of surrogate minus response (V, O, T), over `reference_spread`.

    Errors `unseen` (O, T), which the realisations miss, are a lower bound of the root mean square. With `times` (T,), a
    fraction of `moving_errors` is another lower bound.
    """
    # For an output that is constant in the surrogate at all times, the reference is the root mean square of the
    # responses about its mean; an error of 1 then means that the surrogate misses all variation. Differences within the
    # rounding of the mean count as 0. `terms` is the number of terms in the standard deviation, for its rounding.
    wrong = surrogate - response
    seen = root_mean_square(wrong, weights)
    found, few = np.maximum(seen, unseen), (seen < unseen) | _of_few(wrong, weights)
    constant = constant_columns(mean, std, terms)
    missed = root_mean_square(response - mean, weights)
    # times with unknown statistics (NaN) do not count as variation
    still = (constant | np.isnan(std)).all(axis=-1, keepdims=True)
    spread = reference_spread(np.where(still & ~np.isnan(std), missed, np.where(constant, 0.0, std)))
    rounding = constant_columns(mean, found, terms) & constant
    error = found.copy()
    for part in _close(times):
        error[:, part] = np.maximum(found[:, part], NEIGHBOUR * moving_errors(found[:, part], few[:, part]))
    return np.where(rounding, 0.0, error / divisor(spread))


def _close(times: Array | None) -> list[NDArray[np.intp]]:
    """Return groups of two or more indices of times (T,); steps within a group are small relative to the whole time.

    >>> [one.tolist() for one in _close(np.array([0.0, 1.0, 50.0, 51.0, 52.0, 100.0]))]
    [[0, 1], [2, 3, 4]]
    """
    if times is None or len(times) < 2:
        return []
    apart = np.flatnonzero(np.diff(times) > CLOSE * (times[-1] - times[0]) * (1 + 1e-9)) + 1
    return [part for part in np.split(np.arange(len(times)), apart) if len(part) > 1]


def _of_few(wrong: Array, weights: Array) -> Mask:
    """Return a mask (...) that is True where few realisations cause most of the mean square of errors (V, ...).

    >>> _of_few(np.array([[1.0, 1.0]] + 9 * [[0.0, 1.0]]), np.full(10, 0.1)).tolist()
    [True, False]
    """
    part = (wrong / divisor(np.abs(wrong).max(axis=0))) ** 2 * weights.reshape(-1, *[1] * (wrong.ndim - 1))
    squared = (part * part).sum(axis=0)
    return np.asarray(part.sum(axis=0) ** 2 <= max(FEW, SHARE * len(wrong)) * squared)


def moving_errors(error: Array, few: Mask | None = None) -> Array:
    """Return, for each time, the largest of the errors (O, T) at neighbouring times.

    The error at an event begins and ends at different times in different realisations. Few verification realisations
    miss the first and the last of these times, so the error of a time may be too small. The neighbouring times are
    within one step of the output times, or within the time in which the mean square doubles. The second condition
    applies only where `few` (O, T) realisations cause the error (default: everywhere): where many realisations cause
    the error, they do not miss its begin.

    Times with unknown errors are ignored.

    >>> moving_errors(np.array([[0.0, 0.0, 0.0, 1.0, 1.2, 2.0, 0.0, 0.0]])).tolist()
    [[0.0, 0.0, 1.0, 1.2, 2.0, 2.0, 2.0, 0.0]]
    """
    known, found = np.isfinite(error), error.copy()
    few = np.ones_like(known) if few is None else few
    if known.all():
        found = np.maximum(_earlier(error, few), _earlier(error[:, ::-1], few[:, ::-1])[:, ::-1])
        # no event occurs before the start
        found[:, :1] = error[:, :1]
        return found
    for k, own in enumerate(known):
        found[k, own] = moving_errors(error[k : k + 1, own], few[k : k + 1, own])[0]
    return found


def _earlier(error: Array, few: Mask) -> Array:
    """Return the largest error (O, T) of the present time, the next time, and a rising error at later times."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    def ahead(function: Callable[..., Array], values: Array, steps: int) -> Array:
        """Return the minimum or maximum over the present time and the next `steps` times."""
        return np.asarray(function(values, steps + 1, axis=1, mode="nearest", origin=-((steps + 1) // 2)))

    found, steps, doubled = ahead(maximum_filter1d, error, 1), 2, np.sqrt(2.0) * error
    near = ahead(maximum_filter1d, error, steps)
    while steps < error.shape[1]:
        far = ahead(maximum_filter1d, error, 2 * steps)
        rising = few & (ahead(minimum_filter1d, error, steps) >= error) & (near < doubled) & (far >= doubled)
        if rising.any():
            found = np.maximum(found, ahead(maximum_filter1d, np.where(rising, error, 0.0), steps))
        steps, near = 2 * steps, far
    return found


def first_above(values: Array, limit: float) -> int | None:
    """Return the first index at which values (T,) exceed a limit, or None."""
    above = values > limit
    return int(above.argmax()) if above.any() else None


def root_mean_square(values: Array, weights: Array) -> Array:
    """Return the root mean square over the first axis of values (V, ...), with weights (V,) of sum 1."""
    scale = np.abs(values).max(axis=0)
    scaled = values / divisor(scale)
    result: Array = scale * np.sqrt(np.tensordot(weights, scaled * scaled, axes=1))
    return result


def uncertainty_factor(wrong: Array, weights: Array) -> Array:
    """Return the uncertainty factor (...) of the root mean square of weighted errors (V, ...), from their scatter."""
    # The factor is exp(r), with the relative standard error r of the mean square of independent points. The exponent is
    # two standard errors of the logarithm of the mean square, halved by the root. The factor is 1 without error, and
    # infinite for one point, which has no scatter.
    scale = np.abs(wrong).max(axis=0)
    square = (wrong / divisor(scale)) ** 2
    mean = np.tensordot(weights, square, axes=1)
    # for n points of equal weight, this is 1 - 1 / n, which gives n - 1 degrees of freedom
    free = 1.0 - float(weights @ weights)
    if len(weights) == 1 or free <= 0:
        return np.where(scale > 0, np.inf, np.where(scale == 0, 1.0, np.nan))
    scatter = np.sqrt(np.tensordot(weights**2, (square - mean) ** 2, axes=1) / free)
    # infinite errors would overflow
    return np.asarray(np.exp(np.minimum(np.where(scale == 0, 0.0, scatter / divisor(mean)), MOST)))


def weighted_std(values: Array, weights: Array) -> Array:
    """Return the standard deviation over the first axis of values (V, ...), with weights (V,); 0 if V = 0.

    >>> weighted_std(np.array([[0.0], [4.0]]), np.array([3.0, 1.0])).round(3).tolist()
    [1.732]
    """
    if not len(values):
        return np.zeros(values.shape[1:])
    weights = weights / weights.sum()
    shift = np.tensordot(weights, values, axes=1)
    return root_mean_square(values - shift, weights)


def exceeds_locally(error: Array, std: Array, bound: Array | float) -> Mask:
    """Return whether any error, divided by the standard deviation (..., T) at its time, exceeds a bound (...).

    The given errors (..., T) are relative to `reference_spread`, which is at least 1 % of the maximum standard
    deviation. The result is therefore True only if an error exceeds the bound at a time of smaller standard deviation.
    Unknown errors are ignored.

    >>> exceeds_locally(np.array([0.02, 0.05]), np.array([0.001, 1.0]), 0.05).item()
    True
    >>> exceeds_locally(np.array([0.02, 0.05]), np.array([0.005, 1.0]), 0.05).item()
    False
    >>> exceeds_locally(np.array([0.02, 0.05]), np.array([0.0, 1.0]), np.inf).item()
    False
    """
    known = np.nan_to_num(std)
    floor = reference_spread(known)
    # the factor ignores excesses that are lost when numbers are rounded for texts; no error exceeds an infinite bound
    with np.errstate(invalid="ignore", over="ignore"):
        larger = np.nan_to_num(error) * floor > 1.005 * np.asarray(bound)[..., None] * known
    return np.asarray((larger & (floor > known)).any(axis=-1))


def spread_words(floored: Any) -> str:
    """Return the text on the denominator of a stated error; `floored`: whether its lower limit has an effect."""
    return FLOORED if floored else SPREAD


def stated_words(
    source: str,
    error: Array,
    times: Array | None,
    limit: float,
    remedy: str = "raise the order",
    std: Array | None = None,
) -> str:
    """Describe the size of a stated error (T,), or (1,) without times, and a remedy if the error exceeds a limit.

    Every text with a stated error uses this function. `source` is the object that states the error, such as
    ``surrogate``. With the standard deviation (T,), the text states whether the denominator has a lower limit.

    >>> import numpy as np
    >>> stated_words("surrogate", np.array([0.002, 0.07]), np.array([0.0, 1.0]), 0.01)
    'stated error of the surrogate below 1 % of the standard deviation until 1 s, 7.0 % at 1 s; raise the order'
    """
    advice = f"; {remedy}" if remedy and np.any(error > limit) else ""
    return f"stated error of the {source} {error_words(error, times, limit, std)}{advice}"


def factor_words(factor: float, count: int, advice: str = "raise verify") -> str:
    """Return a text on the uncertainty of the largest stated error from `count` realisations, with advice.

    >>> factor_words(1.5, 16), factor_words(3.14, 8)
    ('', ', uncertain by a factor of 3.1 because it is based on 8 verification realisations: raise verify')
    """
    if not factor > KNOWN:
        return ""
    if count == 1:
        return f", uncertain because it is based on one verification realisation: {advice}"
    return f", uncertain by a factor of {factor:.2g} because it is based on {count} verification realisations: {advice}"


def error_words(error: Array, times: Array | None, limit: float, std: Array | None = None) -> str:
    """Describe an error (T,), or (1,) without times, and the time from which the error exceeds a limit.

    The text states the first time at which the error is NaN. With the standard deviation (T,), it also states whether
    the denominator has a lower limit.

    >>> error_words(np.array([0.002, np.nan, 0.03]), np.array([0.0, 1.0, 2.0]), 0.1)
    'at most 3.0 % of the standard deviation (at 2 s), unknown at 1 of 3 times from 1 s on'
    >>> error_words(np.array([0.002, 31.0]), np.array([0.0, 1.0]), 0.1)
    'below 10 % of the standard deviation until 1 s, 31 times the standard deviation at 1 s'
    >>> error_words(np.array([0.002, 0.001]), np.array([0.0, 1.0]), 0.1, std=np.array([1e-5, 1.0]))
    'at most 0.20 % of the standard deviation, taken as at least 1 % of its maximum (at 0 s)'
    """
    if times is None:
        return format_part(float(error[0]), SPREAD)
    unknown = np.isnan(error)
    if unknown.all():
        return "unknown at all times"
    if unknown.any():
        known_std = None if std is None else std[~unknown]
        known, since = error_words(error[~unknown], times[~unknown], limit, known_std), times[unknown.argmax()]
        return f"{known}, unknown at {unknown.sum()} of {len(error)} times from {since:g} s on"
    first, worst = first_above(error, limit), int(error.argmax())
    bound = min(limit, float(error[worst]))
    whole = spread_words(std is not None and exceeds_locally(error, std, bound))
    if first is None:
        return f"{format_at_most(float(error[worst]), whole)} (at {times[worst]:g} s)"
    since = f"below {100 * limit:g} % of {whole} until {times[first]:g} s"
    if first == 0:
        since = f"above {100 * limit:g} % of {whole} from {times[0]:g} s on"
        if not np.all(error > limit):
            since = f"above {100 * limit:g} % of {whole} already at {times[0]:g} s"
    large = float(error[worst])
    return f"{since}, {format_part(large, SPREAD) if large >= FACTOR else format_percent(large)} at {times[worst]:g} s"
