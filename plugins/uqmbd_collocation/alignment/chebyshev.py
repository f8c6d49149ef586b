"""Motions between events, interpolated from values at Chebyshev points."""

from __future__ import annotations

import numpy as np

import uqmbd
from uqmbd.typing import Array

__all__ = ["coefficients", "read", "read_at_times", "resolved"]


RESOLVED = 1e-8
"""Largest ratio of the last Chebyshev coefficients to the range of an output, for a resolved motion."""


def resolved(history: uqmbd.extend.History) -> bool:
    """Return whether the last Chebyshev coefficients are small enough to resolve a motion between events."""
    found = np.abs(coefficients(history.response))
    tail = found[..., -max(2, found.shape[-1] // 8) :].max(axis=(0, 2), initial=0.0)
    size = np.ptp(history.response, axis=(0, 2))
    floor = np.abs(history.response).max(axis=(0, 2), initial=0.0) * 1e-3
    return bool((tail <= RESOLVED * np.maximum(size, floor)).all())


def read(values: Array, at: Array) -> Array:
    """Return values (O, ...) at normalised times (...), from values (O, P) at the points of a segment."""
    return np.asarray(np.polynomial.chebyshev.chebval(2 * at - 1, coefficients(values).T), dtype=float)


def coefficients(values: Array) -> Array:
    """Return Chebyshev coefficients (..., P) of values at the points."""
    from scipy.fft import dct

    count = values.shape[-1]
    # the points increase from 0 to 1, but the points of the transform decrease from 1 to -1
    found = dct(values[..., ::-1], type=1, axis=-1) / (count - 1)
    found[..., [0, -1]] /= 2
    return np.asarray(found)


def read_at_times(history: uqmbd.extend.History, times: Array) -> Array:
    """Return outputs (O, T) at times (T,), s: NaN after the end; at an event, the values immediately after it."""
    found = np.full((history.response.shape[1], len(times)), np.nan)
    segment = np.searchsorted(history.edges, times, side="right") - 1
    segment[times == history.edges[-1]] = len(history.labels) - 1
    for k, (begin, end) in enumerate(zip(history.edges[:-1], history.edges[1:], strict=True)):
        if (own := segment == k).any():
            found[:, own] = read(history.response[k], (times[own] - begin) / max(end - begin, 1e-300))
    return found
