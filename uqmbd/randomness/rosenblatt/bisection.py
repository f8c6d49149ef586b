"""Vectorised roots of increasing functions; the bits of a root do not depend on the other roots."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from uqmbd.typing import Array

__all__ = ["bisected"]


STEPS = 1100
"""Largest number of bisection steps, enough for a bracket as long as the largest float; most searches end after 60."""


def bisected(
    rising: Callable[[Array], Array], low: Array, high: Array, slope: Callable[[Array], Array] | None = None
) -> Array:
    """Return the zeros (N,) of an increasing function within brackets, to the last digit.

    With the derivative `slope`, the function takes Newton steps if they stay within the bracket. Each iteration ends
    separately, so that a value does not depend on the others in the array.

    >>> bisected(lambda x: x**2 - 2, np.array([0.0]), np.array([2.0])).round(12).tolist()
    [1.414213562373]
    >>> bisected(lambda x: x**2 - 2, np.array([0.0]), np.array([2.0]), lambda x: 2 * x).round(12).tolist()
    [1.414213562373]
    """
    low, high = low.astype(float), high.astype(float)
    at = low + (high - low) / 2
    open_ = (at > low) & (at < high)
    for _ in range(STEPS):
        if not open_.any():
            break
        value = rising(at)
        high, low = np.where(open_ & (value > 0), at, high), np.where(open_ & ~(value > 0), at, low)
        following = low + (high - low) / 2
        if slope is not None:
            with np.errstate(all="ignore"):
                newton = at - value / slope(at)
            near = (newton > low) & (newton < high)
            following = np.where(near, newton, following)
            # a step in the last digits: Newton's method has converged
            open_ = open_ & ~(near & (np.abs(newton - at) <= 4 * np.finfo(float).eps * np.abs(at)))
        open_ = open_ & (following > low) & (following < high)
        at = np.where(open_, following, at)
    return at
