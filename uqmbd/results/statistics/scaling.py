"""Scales to divide by, and values as rows over time."""

from __future__ import annotations

from typing import Any

import numpy as np

from uqmbd.typing import Array

__all__ = ["divisor", "over_time", "relative"]


def divisor(scale: Array) -> Array:
    """Return a scale, or 1 where it is not positive, to divide by; an unknown one stays unknown.

    >>> divisor(np.array([2.0, 0.0, np.nan])).tolist()
    [2.0, 1.0, nan]
    """
    return np.where(scale <= 0, 1.0, scale)


def over_time(values: Any) -> Array:
    """Return values (O, T) of a statistic (output, time), or (O, 1) of one without time."""
    array = np.asarray(values, dtype=float)
    return array if array.ndim == 2 else array.reshape(len(array), 1)


def relative(values: Array, scale: Array, unknown: float) -> Array:
    """Return values over a scale: NaN of an unknown scale, of zero an unknown share, and 0 of what is zero itself."""
    return np.where(~(scale <= 0), values / divisor(scale), np.where(values > 0, unknown, values))
