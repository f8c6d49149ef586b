"""Solution of linear complementarity problems by Lemke's method."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uqmbd.typing import Array

__all__ = ["lemke"]


ZERO = 1e-9
"""Limit below which a pivot relative to its column, or an artificial variable relative to the offsets, is zero."""
TIE = 1e-11
"""Limit below which a difference of ratios is zero."""


def lemke(matrix: Array, offset: Array) -> Array | None:
    """Find ``z >= 0`` with ``w = matrix z + offset >= 0`` and ``z . w = 0``; None if the method ends on a ray.

    The matrix is (n, n), the offset (n,).  Ties are broken lexicographically, which excludes cycles (R. W. Cottle,
    J.-S. Pang, R. E. Stone, The Linear Complementarity Problem, SIAM 2009, section 4.4).

    >>> lemke(np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([-5.0, -6.0])).round(12).tolist()
    [1.333333333333, 2.333333333333]
    """
    count = len(offset)
    if (offset >= 0).all():
        return np.zeros(count)
    # columns: w, z, the artificial variable, the right-hand side
    table = np.column_stack([np.eye(count), -matrix, -np.ones(count), offset])
    basis = list(range(count))
    entering, artificial = 2 * count, 2 * count
    row = int(np.argmin(offset))
    for _ in range(50 * count + 50):
        leaving = basis[row]
        table[row] /= table[row, entering]
        others = np.arange(count) != row
        table[others] -= table[others, entering][:, None] * table[row]
        basis[row] = entering
        if leaving == artificial:
            return _solution(table, basis)
        entering = leaving + count if leaving < count else leaving - count
        column = table[:, entering]
        eligible = np.flatnonzero(column > ZERO * max(1.0, float(np.abs(column).max())))
        if not len(eligible):
            small = table[basis.index(artificial), -1] <= ZERO * float(np.abs(offset).max())
            return _solution(table, basis) if small else None
        row = _least(table, basis, eligible, entering, artificial)
    return None


def _solution(table: Array, basis: list[int]) -> Array:
    count = len(table)
    found = np.zeros(2 * count + 1)
    found[basis] = table[:, -1]
    return np.maximum(found[count : 2 * count], 0.0)


def _least(table: Array, basis: list[int], eligible: NDArray[np.int64], entering: int, artificial: int) -> int:
    """Return the row of the lexicographically least ratio; prefer the artificial variable among equal ratios."""
    count = len(table)
    for column in [-1, *range(count)]:
        ratios = table[eligible, column] / table[eligible, entering]
        least = ratios.min()
        eligible = eligible[ratios <= least + TIE * max(1.0, abs(least))]
        if column == -1 and (ready := [int(k) for k in eligible if basis[int(k)] == artificial]):
            return ready[0]
        if len(eligible) == 1:
            break
    return int(eligible[0])
