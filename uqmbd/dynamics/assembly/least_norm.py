"""Least-squares solutions of smallest norm, for each realisation."""

from __future__ import annotations

import contextlib

import numpy as np

from uqmbd.dynamics.linear import RANK_TOLERANCE
from uqmbd.typing import Array, Mask

__all__ = ["completed", "least_norm"]


CERTAIN = (1e-13, 1e-7)
"""Squared lengths, of combinations of rows of length one, between which it is doubtful whether they vanish."""


def least_norm(a: Array, r: Array, *, truncate: bool) -> Array:
    """Least-squares solution of smallest norm of ``a x = r``, for each realisation.

    With `truncate` singular values that are small count as zero; without, rows are known to be independent, and
    realisations of which they are not are treated like that, too.
    """
    a, r = np.ascontiguousarray(a), np.ascontiguousarray(r)  # the order of sums is that of the memory
    x = np.full((len(a), a.shape[2]), np.nan)
    if not truncate:
        x = _lifted(a, _solved(a @ a.transpose(0, 2, 1), r[:, :, None]))[:, :, 0]
    left = np.flatnonzero(~np.isfinite(x).all(axis=1))
    usable = left[np.isfinite(a[left]).all(axis=(1, 2))]
    if len(usable):
        inverse = np.linalg.pinv(a[usable], rcond=RANK_TOLERANCE)
        x[usable] = (inverse @ r[usable][:, :, None])[:, :, 0]
    return x


def completed(held: Array, b: Array, stated: Array, c: Array) -> Array:
    """Solve ``held x = b`` and ``stated x = c`` with the smallest norm, for each realisation.

    Rows of `held` (K, m, n) are independent; those of `stated` (K, s, n), of length one, may follow from others.  NaN
    where it is doubtful whether they do.
    """
    held, b, stated, c = map(np.ascontiguousarray, (held, b, stated, c))  # the order of sums is that of the memory
    across = stated.transpose(0, 2, 1)
    gram = held @ held.transpose(0, 2, 1)
    particular = np.concatenate([b[:, :, None], held @ across], axis=2)
    found = _lifted(held, _solved(gram, particular))
    x, free = found[:, :, :1], across - found[:, :, 1:]
    good: Mask = np.asarray(np.isfinite(found).all(axis=(1, 2)))
    lengths, vectors = np.linalg.eigh(np.where(good[:, None, None], stated @ free, 0.0))
    good &= ~((lengths > CERTAIN[0]) & (lengths < CERTAIN[1])).any(axis=1)
    weights = np.divide(1.0, lengths, out=np.zeros_like(lengths), where=lengths >= CERTAIN[1])
    missing = vectors.transpose(0, 2, 1) @ (c[:, :, None] - stated @ x)
    x = x + free @ (vectors @ (weights[:, :, None] * missing))
    x += _lifted(held, _solved(gram, b[:, :, None] - held @ x))  # what rounding left
    result: Array = np.where(good[:, None], x[:, :, 0], np.nan)
    return result


def _lifted(a: Array, y: Array) -> Array:
    return np.asarray(a.transpose(0, 2, 1) @ y)


def _solved(matrix: Array, right: Array) -> Array:
    """Solve each system; NaN where one is singular, without harm to the others."""
    try:
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        found = np.full(right.shape, np.nan)
        for k in range(len(matrix)):
            with contextlib.suppress(np.linalg.LinAlgError):
                found[k] = np.linalg.solve(matrix[k], right[k])
        return found
