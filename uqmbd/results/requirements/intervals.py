"""Confidence intervals of probabilities from counts."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.arguments import Share, typechecked
from uqmbd.errors import StudyError
from uqmbd.typing import Array

__all__ = ["LEVEL", "clopper_pearson", "of_replicates"]

LEVEL = 0.95
"""Confidence level of intervals."""

FEWEST = 5
"""Minimum number of replicates for an interval from their spread.

At least this number must have trials with the event, and at least this number must have trials without the event.
"""


@typechecked
def clopper_pearson(happened: ArrayLike, of: ArrayLike, level: Share = LEVEL) -> tuple[Array, Array]:
    """Return the confidence interval of a probability from the number of occurrences in independent trials.

    The confidence is at least `level` for any probability [1]_. Without occurrences, or with occurrences in all trials,
    the interval is one-sided, and its width is ``1 - (1 - level)^(1 / of)``.

    Parameters
    ----------
    happened, of : array_like of int
        Numbers of occurrences and of trials.
    level : float
        Confidence level.

    Returns
    -------
    lower, upper : array
        Ends of the interval.

    Raises
    ------
    StudyError
        If a number is negative, or occurrences exceed trials.

    References
    ----------
    .. [1] C. J. Clopper and E. S. Pearson, Biometrika 26 (1934) 404-413.

    Examples
    --------
    >>> lower, upper = clopper_pearson([0, 10], 500)
    >>> lower.round(4).tolist(), upper.round(4).tolist()
    ([0.0, 0.0096], [0.006, 0.0365])
    """
    from scipy.special import betaincinv

    try:
        k, n = np.broadcast_arrays(np.asarray(happened, dtype=float), np.asarray(of, dtype=float))
    except ValueError:
        raise StudyError(
            f"clopper_pearson: 'happened' has the shape {np.shape(happened)}, and 'of' has the shape {np.shape(of)}; "
            "expected equal shapes, or one number of trials."
        ) from None
    if not ((k >= 0) & (k <= n) & (n < np.inf)).all():
        raise StudyError("clopper_pearson: expected numbers with 0 <= happened <= of < inf.")
    # the single end of a one-sided interval has the whole confidence
    tail = np.where((k == 0) | (k == n), 1 - level, (1 - level) / 2)
    with np.errstate(invalid="ignore"):
        lower = np.where(k > 0, betaincinv(np.maximum(k, 1), n - np.minimum(k, n) + 1, tail), 0.0)
        upper = np.where(k < n, betaincinv(k + 1, np.maximum(n - k, 1), 1 - tail), 1.0)
    return lower, upper


def of_replicates(
    shares: Array, of: int, lower: Array, upper: Array, level: float = LEVEL
) -> tuple[Array, Array, Array]:
    """Return standard errors and intervals of probabilities from the shares of independent replicates.

    `shares` (replicate, ...): shares of trials with the event; `of`: number of all trials; `lower`, `upper` (...):
    intervals for independent trials; `level`: confidence. The given intervals remain if too few replicates contain
    trials with the event, or without it, for an estimate from the spread. The results have the shape (...).
    """
    from scipy.special import stdtrit

    count, mean = len(shares), shares.mean(axis=0)
    error = shares.std(axis=0, ddof=1) / np.sqrt(count)
    spread = np.minimum((shares > 0).sum(axis=0), (shares < 1).sum(axis=0)) >= FEWEST
    # replicates may agree by chance, so the half-width is at least the share of one trial
    reach = np.maximum(stdtrit(count - 1, (1 + level) / 2) * error, 1 / of)
    return (
        error,
        np.where(spread, np.clip(mean - reach, 0.0, 1.0), lower),
        np.where(spread, np.clip(mean + reach, 0.0, 1.0), upper),
    )
