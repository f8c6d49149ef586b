"""Expand products of basis polynomials in the basis, by the sparse table of E[psi_i psi_j psi_k]."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    from uqmbd.randomness import Germ

__all__ = ["ProductTable", "product_count", "product_table"]


# A linearisation coefficient counts as zero below this fraction of the largest coefficient of the same pair.
_ZERO = 1e-12


@dataclass(frozen=True, eq=False)
class ProductTable:
    """Table to compute the square of a chaos from products of its coefficients: ``matrix @ (f[i] * f[j])``."""

    pairs: Index  # (N, 2) terms i <= j; the matrix contains the factor 2 of pairs with i < j
    matrix: Any  # scipy.sparse.csr_array (Q, N)
    position: Index  # (P,) row of the square's coefficients that belongs to each term of the chaos
    terms: int  # Q


def product_count(index: Index, germs: Sequence[Germ]) -> tuple[int, int]:
    """Return the number of pairs of terms (i <= j), and the total number of nonzero coefficients of their products.

    `index` (P, d): degrees of the terms. The first term, the mean, is not included.
    """
    tables = [_nonzeros(germ, int(top))[0] for germ, top in zip(germs, index.max(axis=0), strict=True)]
    terms = len(index) - 1
    total = 0.0
    for first in range(1, len(index)):
        counts = np.ones(len(index) - first)
        for m, number in enumerate(tables):
            counts *= number[index[first, m], index[first:, m]]
        total += counts.sum()
    return terms * (terms + 1) // 2, int(total)


def product_table(index: Index, germs: Sequence[Germ]) -> ProductTable:
    """Tabulate the products of all pairs of terms (P, d) without the mean, for a centred chaos."""
    import scipy.sparse

    left, right = np.triu_indices(len(index) - 1)
    pairs = np.stack([left, right], axis=1) + 1
    # start with one row for each pair of terms; each germ replaces a row by one row for each non-zero product
    owner = np.arange(len(pairs))
    value = np.where(left == right, 1.0, 2.0)
    key, own, span = np.zeros(len(pairs), dtype=np.int64), np.zeros(len(index), dtype=np.int64), 1
    for m, germ in enumerate(germs):
        top = int(index[:, m].max())
        number, start, degree, coefficient = _nonzeros(germ, top)
        i, j = index[pairs[owner, 0], m], index[pairs[owner, 1], m]
        repeats = number[i, j]
        rows = np.repeat(np.arange(len(owner)), repeats)
        within = np.arange(len(rows)) - np.repeat(np.cumsum(repeats) - repeats, repeats)
        entry = start[i, j][rows] + within
        if span > 2**62 // (2 * top + 1):
            key, own, span = _renumbered(key, own)
        owner, value = owner[rows], value[rows] * coefficient[entry]
        key = key[rows] * (2 * top + 1) + degree[entry]
        own, span = own * (2 * top + 1) + index[:, m], span * (2 * top + 1)
    target, own, span = _renumbered(key, own)
    matrix = scipy.sparse.csr_array((value, (target, owner)), shape=(span, len(pairs)))
    return ProductTable(pairs, matrix, own, span)


def _renumbered(key: Index, own: Index) -> tuple[Index, Index, int]:
    """Replace keys by their ranks among all keys; also return the number of different keys."""
    distinct, ranks = np.unique(np.concatenate([key, own]), return_inverse=True)
    return ranks[: len(key)], ranks[len(key) :], len(distinct)


def _nonzeros(germ: Germ, top: int) -> tuple[Index, Index, Index, Array]:
    """Return non-zeros of E[p_i p_j p_k]: number and start by pair (i, j), and degree k and value of each."""
    table = germ.linearisation(top)
    nonzero = np.abs(table) > _ZERO * np.abs(table).max(axis=2, keepdims=True)
    count = np.arange(top + 1)
    i, j, k = count[:, None, None], count[:, None], np.arange(2 * top + 1)
    nonzero &= (k >= np.abs(i - j)) & (k <= i + j)
    number = nonzero.sum(axis=2)
    start = (np.cumsum(number.ravel()) - number.ravel()).reshape(number.shape)
    return number, start, np.nonzero(nonzero)[2], table[nonzero]
