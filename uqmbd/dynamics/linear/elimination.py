"""Elimination order for sparse systems with the same pattern, chosen once from typical systems.

The modules `uqmbd.dynamics.linear.unrolled` and `fronts` compile the elimination.  If the fixed pivots are poor, the
residual is large, and LAPACK solves the system again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.typing import Array, Index

__all__ = ["Elimination", "plan"]


THRESHOLD = 0.1
"""Least ratio of a pivot to the largest entry of its column; a value below 1 allows sparser eliminations."""


@dataclass(frozen=True)
class Elimination:
    """Fixed order of elimination."""

    # pivot row and column, rows below with an entry in the pivot column, columns with an entry in the pivot row
    steps: tuple[tuple[int, int, tuple[int, ...], tuple[int, ...]], ...]


def plan(rows: Index, columns: Index, typical: Array) -> Elimination:
    """Choose an order of elimination for a pattern (nnz,) by Markowitz counts with threshold pivoting.

    A pivot must be acceptable in all typical systems (S, size, size).
    """
    size = typical.shape[1]
    pattern = np.zeros((size, size), dtype=bool)
    pattern[rows, columns] = True
    values = typical.copy()
    scale = np.abs(values).max(axis=2)
    values /= np.where(scale > 0, scale, 1.0)[:, :, None]
    open_rows, open_columns = list(range(size)), list(range(size))
    steps = []
    for _ in range(size):
        block = np.ix_(open_rows, open_columns)
        every, live = np.abs(values[:, open_rows][:, :, open_columns]), pattern[block]
        # relative to the largest entry of the column, in the worst system
        magnitude = (every / np.maximum(every.max(axis=1, keepdims=True), 1e-300)).min(axis=0)
        magnitude[every.min(axis=0) == 0] = 0.0
        strong = live & (magnitude >= THRESHOLD)
        if not strong.any():
            strong = live & (magnitude > 0)
        if not strong.any():
            strong = live
        cost = np.outer(live.sum(axis=1) - 1, live.sum(axis=0) - 1).astype(float)
        cost[~strong] = np.inf
        # choose the largest pivot among equal costs
        best = np.flatnonzero(cost.ravel() == cost.min())
        pick = int(best[np.argmax(magnitude.ravel()[best])])
        row, column = open_rows[pick // len(open_columns)], open_columns[pick % len(open_columns)]
        open_rows.remove(row)
        open_columns.remove(column)
        below = [i for i in open_rows if pattern[i, column]]
        beside = [j for j in open_columns if pattern[row, j]]
        for i in below:
            pivot = np.where(values[:, row, column] != 0, values[:, row, column], np.inf)
            values[:, i, open_columns] -= (values[:, i, column] / pivot)[:, None] * values[:, row, open_columns]
            pattern[i, beside] = True
        steps.append((row, column, tuple(below), tuple(beside)))
    return Elimination(tuple(steps))
