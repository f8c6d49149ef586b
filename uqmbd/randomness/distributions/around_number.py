"""Distributions with a given mean and standard deviation within the range of a number."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from uqmbd.errors import StudyError

if TYPE_CHECKING:
    import chaospy

__all__ = ["KINDS", "distribution_about", "is_distribution", "leaves_range"]

KINDS = ("normal", "lognormal", "uniform")

RARE = 1e-9
"""Accepted probability outside of a range; such values are never sampled."""


def distribution_about(
    mean: float, std: float, kind: str = "", minimum: float = -math.inf, maximum: float = math.inf
) -> chaospy.Distribution:
    """Return a distribution of given mean and (positive) standard deviation within a range.

    `kind` is one of `KINDS`. By default, the distribution is normal without a range, lognormal in a range with one end,
    and beta in a range with two ends. The lognormal distribution starts at the end of the range. Raise StudyError,
    whose message is part of a sentence, if no such distribution stays within the range.

    >>> import chaospy
    >>> found = distribution_about(2.0, 0.1, minimum=0)
    >>> round(float(chaospy.E(found)), 6), round(float(chaospy.Std(found)), 6), leaves_range(found, 0, 3)
    (2.0, 0.1, False)
    """
    import chaospy

    low, high = mean - minimum, maximum - mean
    if kind == "uniform":
        half = math.sqrt(3) * std
        if half > min(low, high):
            raise StudyError(f"a uniform distribution would extend from {mean - half:g} to {mean + half:g}")
        return chaospy.Uniform(mean - half, mean + half)
    bounded = math.isfinite(low), math.isfinite(high)
    if kind == "normal" or (not kind and not any(bounded)):
        found = chaospy.Normal(mean, std)
        if leaves_range(found, minimum, maximum):
            raise StudyError(f"a normal distribution with the standard deviation {std:g} would exceed this range")
        return found
    if kind == "lognormal" and not any(bounded):  # without a range, zero is its end
        low, high, bounded = mean, -mean, (mean > 0, mean < 0)
    if min(low, high) <= 0 and not (kind == "lognormal" and max(low, high) > 0 and not all(bounded)):
        raise StudyError("the number is at the end of this range, so it cannot vary to both sides")
    if not kind and all(bounded):
        share, spread = low / (low + high), std / (low + high)
        shape = share * (1 - share) / spread**2 - 1
        alpha, beta = share * shape, (1 - share) * shape
        if min(alpha, beta) < 1:
            raise StudyError(f"no unimodal beta distribution with the standard deviation {std:g} fits into this range")
        return chaospy.Beta(alpha, beta, minimum, maximum)
    size = low if bounded[0] else high
    variance = math.log1p((std / size) ** 2)
    spread = chaospy.LogNormal(math.log(size) - variance / 2, math.sqrt(variance))
    found = (mean - size) + spread if bounded[0] else (mean + size) - spread
    found = spread if bounded[0] and mean == size else found
    if leaves_range(found, minimum, maximum):
        raise StudyError("a lognormal distribution would exceed this range")
    return found


def leaves_range(distribution: chaospy.Distribution, minimum: float, maximum: float) -> bool:
    """Return whether a distribution has more than a billionth of its probability beyond either end of a range.

    >>> import chaospy
    >>> leaves_range(chaospy.Normal(1, 0.1), 0, 2), leaves_range(chaospy.Normal(1, 0.5), 0, 2)
    (False, True)
    """
    import numpy as np

    ends = np.ravel(distribution.inv(np.array([RARE, 1 - RARE])))
    return bool(ends.min() < minimum or ends.max() > maximum)


def is_distribution(value: object) -> bool:
    """Return whether a value is a one-dimensional distribution of chaospy.

    >>> import chaospy
    >>> is_distribution(chaospy.Normal(1, 0.1)), is_distribution(chaospy.Normal), is_distribution("normal")
    (True, False, False)
    """
    import chaospy

    return isinstance(value, chaospy.Distribution) and len(value) == 1
