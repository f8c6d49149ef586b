"""Samples of what is expanded from landmark to landmark, evaluated at given times.

In NumPy the same takes ten times as long: a value needs the coefficients of its own segment, gathered one by one.
"""

from __future__ import annotations

import numpy as np

from uqmbd.compiled.driver import address, aligned, driver
from uqmbd.typing import Array

__all__ = ["segment_table", "segment_values"]


BLOCK = 4
"""Chebyshev polynomials that the driver takes at once."""

SLACK = 1e-12
"""Part of the largest time by which a last edge, a sum of terms, may miss a time that it is meant to be."""


def segment_table(segments: Array) -> Array:
    """Arrange coefficients for `segment_values`.

    Parameters
    ----------
    segments : array, shape (P, S, C, N)
        Coefficients of P terms, in S segments, of C outputs, of N Chebyshev polynomials of a segment's normalised time.

    Returns
    -------
    array, shape (S, C, P, M)
        The Chebyshev polynomials filled up by zeros to a multiple of four.
    """
    terms, count, outputs, powers = segments.shape
    found = np.zeros((count, outputs, terms, -(-powers // BLOCK) * BLOCK))
    found[..., :powers] = segments.transpose(1, 2, 0, 3)
    return found


def segment_values(table: Array, edges: Array, basis: Array, times: Array) -> Array:
    """Evaluate outputs of samples at times.

    Parameters
    ----------
    table : array, shape (S, C, P, M)
        From `segment_table`; rows may be those of some outputs.
    edges : array, shape (K, S + 1)
        Times at which segments begin and end, not decreasing.
    basis : array, shape (K, P)
        The terms at the samples.
    times : array, shape (T,)
        Increasing.

    Returns
    -------
    array, shape (K, C, T)
        NaN at times behind the last edge of a sample, but for rounding; the begin stands for what is before it.
    """
    segments, outputs, terms, powers = table.shape
    table, edges, basis, times = (np.ascontiguousarray(x, dtype=float) for x in (table, edges, basis, times))
    samples, count = len(basis), len(times)
    if edges.shape != (samples, segments + 1) or basis.shape != (samples, terms) or powers % BLOCK or not powers:
        raise ValueError(f"a table {table.shape} was given edges {edges.shape}, basis {basis.shape}")
    found = np.empty((samples, outputs, count))
    work = aligned((2 + outputs) * powers + terms + 4)
    driver().segment_values(
        *(samples, segments, outputs, terms, powers, count),
        *map(address, (edges, basis, table, times, found, work)),
        SLACK * float(np.abs(times).max(initial=0.0)),
    )
    return found
