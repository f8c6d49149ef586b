"""Intervals of probabilities from counts."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.arguments import Share, typechecked
from uqmbd.errors import StudyError
from uqmbd.typing import Array

__all__ = ["LEVEL", "clopper_pearson", "of_replicates"]

LEVEL = 0.95
"""Confidence of intervals."""

FEWEST = 5
"""Smallest number of replicates with and without the event from which a spread is estimated."""


@typechecked
def clopper_pearson(happened: ArrayLike, of: ArrayLike, level: Share = LEVEL) -> tuple[Array, Array]:
    """Return the interval of a probability from how often something happened among independent trials.

    Its confidence is at least `level` whatever the probability is [1]_.  Where it never happened, or always, the
    interval has one end only, with all of the confidence: ``1 - (1 - level)^(1 / of)`` at most.

    Parameters
    ----------
    happened, of : array_like of int
        How often, and of how many trials.
    level : float
        Confidence.

    Returns
    -------
    lower, upper : array

    Raises
    ------
    StudyError
        If the numbers are negative, or more than there are trials.

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
            f"clopper_pearson: happened has the shape {np.shape(happened)}, of {np.shape(of)}; expected equal shapes, "
            "or one number of trials."
        ) from None
    if not ((k >= 0) & (k <= n) & (n < np.inf)).all():
        raise StudyError("clopper_pearson: happened and of hold other numbers than 0 <= happened <= of < inf.")
    # one end: all of the confidence is its own
    tail = np.where((k == 0) | (k == n), 1 - level, (1 - level) / 2)
    with np.errstate(invalid="ignore"):
        lower = np.where(k > 0, betaincinv(np.maximum(k, 1), n - np.minimum(k, n) + 1, tail), 0.0)
        upper = np.where(k < n, betaincinv(k + 1, np.maximum(n - k, 1), 1 - tail), 1.0)
    return lower, upper


def of_replicates(
    shares: Array, of: int, lower: Array, upper: Array, level: float = LEVEL
) -> tuple[Array, Array, Array]:
    """Return standard errors and intervals of probabilities from the shares of independent replicates.

    `shares` (replicate, ...): of trials in which something happened; `of`: all trials; `lower`, `upper` (...):
    intervals that hold as if all trials were independent; they stay where it happened in too few replicates for their
    spread to tell anything; `level`: confidence. Return (...).
    """
    from scipy.special import stdtrit

    count, mean = len(shares), shares.mean(axis=0)
    error = shares.std(axis=0, ddof=1) / np.sqrt(count)
    spread = np.minimum((shares > 0).sum(axis=0), (shares < 1).sum(axis=0)) >= FEWEST
    # replicates that agree by chance know no more than one trial tells
    reach = np.maximum(stdtrit(count - 1, (1 + level) / 2) * error, 1 / of)
    return (
        error,
        np.where(spread, np.clip(mean - reach, 0.0, 1.0), lower),
        np.where(spread, np.clip(mean + reach, 0.0, 1.0), upper),
    )
