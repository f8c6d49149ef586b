"""Compute 95 % intervals of quantiles, from ranks of independent samples or from independent replicates of a design."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uqmbd.typing import Array, Index

__all__ = ["interval_of_ranks", "interval_of_replicates", "interval_ranks", "with_open_ends", "within_samples"]

TAIL = 0.025
"""Largest probability that a quantile is beyond one end of its interval."""

FEWEST = 5
"""Least number of replicates with samples on either side of a value, from which the spread of shares is estimated."""


def interval_ranks(count: int, levels: Array) -> Index:
    """Return the ranks (2, P), from 0 to `count` + 1, of the samples that are the ends of 95 % intervals of quantiles.

    For any continuous distribution, the number of independent samples up to a quantile is binomial. If the distribution
    function has jumps, the confidence is larger. Rank 0 is below all samples, and rank `count` + 1 is above them.

    >>> interval_ranks(100, np.array([0.01, 0.5])).tolist()
    [[0, 40], [4, 61]]
    """
    from scipy.special import bdtr, bdtrik

    share = np.array([[TAIL], [1 - TAIL]])
    # the smallest number whose cumulative probability is at least the share; for levels 0 and 1 the number is certain
    inner = np.clip(levels, 1e-300, 1 - 1e-16)
    number = np.ceil(bdtrik(share, count, inner))
    number = np.where(bdtr(np.maximum(number - 1, 0), count, inner) >= share, np.maximum(number - 1, 0), number)
    found = np.select([levels == 0, levels == 1], [0, count], number).astype(np.int64)
    return found + np.array([[0], [1]], dtype=np.int64)


def within_samples(ranks: Index, count: int) -> Index:
    """Return indices of samples in ascending order for ranks from 0 to `count` + 1.

    Ranks 0 and `count` + 1 have the indices of the smallest and the largest sample.

    >>> within_samples(np.array([0, 1, 4, 5]), 4).tolist()
    [0, 0, 3, 3]
    """
    return np.clip(ranks, 1, count) - 1


def with_open_ends(ends: Array, ranks: Index, count: int) -> Array:
    """Replace ends (2, P, C) of intervals by infinity where ranks, (2, P) or (2, P, C), are beyond all samples."""
    beyond = (ranks == 0) | (ranks == count + 1)
    outer = np.array([-np.inf, np.inf])[:, None, None]
    return np.where(beyond if beyond.ndim == 3 else beyond[..., None], outer, ends)


def interval_of_ranks(ordered: Array, levels: Array) -> Array:
    """Return 95 % intervals (2, P, C) of quantiles from independent samples (C, S) in ascending order.

    >>> interval_of_ranks(np.arange(1.0, 101.0)[None], np.array([0.01, 0.5]))[:, :, 0].tolist()
    [[-inf, 40.0], [4.0, 61.0]]
    """
    count = ordered.shape[1]
    ranks = interval_ranks(count, levels)
    return with_open_ends(ordered[:, within_samples(ranks, count)].transpose(1, 2, 0), ranks, count)


def interval_of_replicates(samples: Array, sizes: Sequence[int], levels: Array) -> Array:
    """Return 95 % intervals (2, P, C) of quantiles from samples (C, S) of consecutive replicates of a design.

    The share of samples below a value estimates the cumulative probability of the value. The spread of this share over
    the replicates gives an interval of Student's t distribution for the probability. The interval of a quantile
    contains the values for which this interval contains the probability of the quantile.

    `sizes` (R,): numbers of samples of the replicates, with the sum S. With fewer than two replicates the ends are NaN.

    >>> rng = np.random.default_rng(1)
    >>> points = (np.arange(64) + rng.uniform(size=(16, 64))).ravel() / 64
    >>> interval_of_replicates(points[None], [64] * 16, np.array([0.1]))[:, 0, 0].round(3).tolist()
    [0.096, 0.101]
    >>> interval_of_ranks(np.sort(points)[None], np.array([0.1]))[:, 0, 0].round(3).tolist()
    [0.08, 0.118]
    """
    from scipy.special import betaincinv, stdtrit

    used = np.array([size for size in sizes if size])
    count, total = len(used), samples.shape[1]
    if count < 2:
        return np.full((2, len(levels), len(samples)), np.nan)
    order = np.argsort(samples, axis=1, kind="stable")
    replicate = np.repeat(np.arange(count), used)[order]
    # number of smaller samples in the same replicate: a stable sort by replicates preserves the order within each
    by_replicate = np.argsort(replicate.astype(np.uint16), axis=1, kind="stable")
    before = np.empty_like(order)
    inside = np.concatenate([np.arange(size) for size in used])
    np.put_along_axis(before, by_replicate, np.broadcast_to(inside, order.shape), axis=1)
    # mean and variance over the replicates of the share of the 0, 1, ... S smallest samples
    weight = (1.0 / used)[replicate]
    mean = np.minimum(_summed(weight) / count, 1.0)  # rounding may raise the total above one
    variance = (_summed((2.0 * before + 1.0) * weight**2) / count - mean**2) * count / (count - 1)
    # The number of points of a design below a value is an integer, and replicates may agree by chance. The variance is
    # therefore at least the variance of this rounding: 1/4, or in a tail the smaller variance of independent points.
    size = total / count
    variance = np.maximum(variance, np.minimum(0.25, size * mean * (1.0 - mean)) / size**2)
    reach = stdtrit(count - 1, 1.0 - TAIL) * np.sqrt(variance / count)
    lower, upper = mean - reach, mean + reach
    # in a tail, where few replicates have samples, use the interval of independent samples
    few = np.minimum(_summed(before == 0), count - _summed(before == (used - 1)[replicate])) < FEWEST
    some = np.flatnonzero(few.any(axis=0))
    tails = np.where(some > 0, betaincinv(np.maximum(some, 1), total - some + 1, TAIL), 0.0)
    lower[:, some] = np.where(few[:, some], tails, lower[:, some])
    tails = np.where(some < total, betaincinv(some + 1, np.maximum(total - some, 1), 1.0 - TAIL), 1.0)
    upper[:, some] = np.where(few[:, some], tails, upper[:, some])
    ranks = np.empty((2, len(levels), len(samples)), dtype=np.int64)
    for k, level in enumerate(levels):
        middle = int(level * total)
        ranks[0, k] = np.minimum((upper >= level).argmax(axis=1), middle)
        ranks[1, k] = np.maximum(total - (lower[:, ::-1] <= level).argmax(axis=1), middle) + 1
    # the samples of these ranks
    places = within_samples(ranks, total)
    rows = np.arange(len(samples))
    return with_open_ends(samples[rows, order[rows, places]], ranks, total)


def _summed(values: Array) -> Array:
    """Return the sums (C, S + 1) of the first 0, 1, ... S values of rows (C, S)."""
    found = np.zeros((len(values), values.shape[1] + 1))
    np.cumsum(values, axis=1, out=found[:, 1:])
    return found
