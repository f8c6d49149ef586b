"""Least-squares polynomials of margins; the order has the smallest leave-one-out error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import uqmbd
from uqmbd.typing import Array, Index

__all__ = ["MarginSurrogate", "fitted"]

HIGHEST = 8
"""Highest order of a polynomial."""

MOST = 700
"""Largest number of terms of a polynomial."""

ENOUGH = 1e-3
"""Error, relative to the standard deviation, below which no higher order is tried."""

WORTH = 0.9
"""Largest ratio of the errors of a higher and a lower order for which the higher order is accepted."""

SPARE = 2.0
"""Least number of realisations for each term."""

BLOCK = 2**11
"""Largest number of points in one evaluation."""


@dataclass(frozen=True, eq=False)
class MarginSurrogate:
    """Margins of all requirements as polynomials of the germs."""

    space: uqmbd.extend.GermSpace
    index: Index  # (P, d) degrees of the terms
    coefficients: Array  # (P, requirement)
    order: int  # total degree
    error: Array  # (requirement,) root mean square leave-one-out error, over the standard deviation of the margins

    def margins(self, germs: Array) -> Array:
        """Return margins, shape (K, requirement), at germs (K, d)."""
        parts = [germs[k : k + BLOCK] for k in range(0, len(germs), BLOCK)]
        return np.concatenate([self.space.evaluate(part, self.index) @ self.coefficients for part in parts])


def fitted(space: uqmbd.extend.GermSpace, values: Array, margins: Array) -> MarginSurrogate:
    """Return polynomials of the germs fitted to margins (K, requirement) at inputs (K, input)."""
    germs = space.to_germs(values)
    best: MarginSurrogate | None = None
    spread = np.maximum(margins.std(axis=0), np.finfo(float).tiny)
    for order in range(1, HIGHEST + 1):
        index = uqmbd.extend.index_set(space.dimension, order)
        if order > 1 and (len(index) > MOST or SPARE * len(index) > len(values)):
            break
        basis = space.evaluate(germs, index)
        left, sizes, right = np.linalg.svd(basis, full_matrices=False)
        kept = sizes > 1e-10 * sizes[0]
        projected = left[:, kept].T @ margins
        off = margins - left[:, kept] @ projected
        # leave-one-out errors by the leverage of each point
        leverage = np.minimum((left[:, kept] ** 2).sum(axis=1), 1 - 1e-9)
        error = np.sqrt(np.mean((off / (1 - leverage[:, None])) ** 2, axis=0)) / spread
        if best is None or error.max() < WORTH * best.error.max():
            coefficients = right[kept].T @ (projected / sizes[kept, None])
            best = MarginSurrogate(space, index, coefficients, order, error)
        if best.error.max() <= ENOUGH:
            break
    assert best is not None
    return best
