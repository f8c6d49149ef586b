"""Samples of what is expanded from landmark to landmark, evaluated at given times.

In NumPy the same takes ten times as long: a value needs the coefficients of its own segment, gathered one by one.
"""

from __future__ import annotations

import numpy as np

from uqmbd.compiled.driver import address, aligned, driver
from uqmbd.compiled.writer import LANES
from uqmbd.typing import Array

__all__ = ["segment_table", "segment_values"]


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
        The Chebyshev polynomials filled up by zeros to whole vectors.
    """
    terms, count, outputs, powers = segments.shape
    found = aligned(count * outputs * terms * -(-max(powers, 3) // LANES)).reshape(count, outputs, terms, -1)
    found[..., :powers] = segments.transpose(1, 2, 0, 3)
    return found


def segment_values(table: Array, powers: int, edges: Array, basis: Array, times: Array) -> Array:
    """Evaluate outputs of samples at times.

    Parameters
    ----------
    table : array, shape (S, C, P, M)
        From `segment_table`; rows may be those of some outputs.
    powers : int
        Number of Chebyshev polynomials.
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
    segments, outputs, terms, width = table.shape
    table = _whole(table)
    edges, basis = (np.ascontiguousarray(x, dtype=float) for x in (edges, basis))
    samples, count, powers = len(basis), len(times), max(powers, 3)
    times = np.concatenate([np.asarray(times, dtype=float), np.zeros(LANES - 1)])
    if edges.shape != (samples, segments + 1) or basis.shape != (samples, terms) or not 0 < powers <= width:
        raise ValueError(f"a table {table.shape} was given edges {edges.shape}, basis {basis.shape}, {powers} powers")
    found = np.empty((samples, outputs, count))
    work = aligned(powers + outputs * width // LANES)
    driver().segment_values(
        *(samples, segments, outputs, terms, powers, count),
        *map(address, (edges, basis, table, times, found, work)),
        SLACK * float(np.abs(times).max(initial=0.0)),
    )
    return found


def _whole(table: Array) -> Array:
    """Return a table that is in one piece, and aligned."""
    if table.flags.c_contiguous and not address(table) % 64:
        return table
    found = aligned(table.size // LANES).reshape(table.shape)
    found[...] = table
    return found
