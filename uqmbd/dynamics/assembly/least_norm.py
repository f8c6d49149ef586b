"""Least-squares solutions of smallest norm, for each realisation."""

from __future__ import annotations

import contextlib

import numpy as np

from uqmbd.dynamics.linear import RANK_TOLERANCE
from uqmbd.typing import Array

__all__ = ["solve_least_norm"]


def solve_least_norm(a: Array, r: Array, *, truncate: bool) -> Array:
    """Return the least-squares solution of smallest norm of ``a x = r`` for each realisation.

    With `truncate`, small singular values count as zero. Otherwise rows are expected to be independent; realisations
    with dependent rows are also truncated.
    """
    a, r = np.ascontiguousarray(a), np.ascontiguousarray(r)  # the memory layout determines the order of sums
    x = np.full((len(a), a.shape[2]), np.nan)
    if not truncate:
        x = _least_norm_solution(a, _solved(a @ a.transpose(0, 2, 1), r[:, :, None]))[:, :, 0]
    left = np.flatnonzero(~np.isfinite(x).all(axis=1))
    usable = left[np.isfinite(a[left]).all(axis=(1, 2))]
    if len(usable):
        inverse = np.linalg.pinv(a[usable], rcond=RANK_TOLERANCE)
        x[usable] = (inverse @ r[usable][:, :, None])[:, :, 0]
    return x


def _least_norm_solution(a: Array, y: Array) -> Array:
    return np.asarray(a.transpose(0, 2, 1) @ y)


def _solved(matrix: Array, right: Array) -> Array:
    """Solve each system; NaN for a singular system, without effect on the others."""
    try:
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        found = np.full(right.shape, np.nan)
        for k in range(len(matrix)):
            with contextlib.suppress(np.linalg.LinAlgError):
                found[k] = np.linalg.solve(matrix[k], right[k])
        return found
