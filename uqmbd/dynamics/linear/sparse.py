"""Many large systems of one sparse pattern: products, residuals, and solutions by SuperLU."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from uqmbd.typing import Array, Index

__all__ = ["Factors", "SparsePattern"]


BLOCK = 256
"""Systems that are multiplied at once."""

PIVOT = 0.1
"""A pivot may be smaller than the largest entry of its column by this factor, for the sake of sparsity."""


@dataclass(frozen=True)
class SparsePattern:
    """Sparsity pattern of systems."""

    rows: Index  # (nnz,): sorted; no row is empty
    columns: Index  # (nnz,)
    source: Index  # (nnz,): index of each entry among the values that are given with a system
    size: int  # number of unknowns

    @cached_property
    def starts(self) -> Index:
        """First entry of each row."""
        return np.searchsorted(self.rows, np.arange(self.size)).astype(np.int64)

    @cached_property
    def compressed(self) -> tuple[Index, Index, Index]:
        """Order of the entries by columns, their rows, and where each column begins."""
        order = np.lexsort((self.rows, self.columns))
        pointers = np.searchsorted(self.columns[order], np.arange(self.size + 1))
        return order, self.rows[order], pointers

    def product(self, values: Array, x: Array) -> Array:
        """Return the products ``A_k x_k`` (K, size) of systems, given by values (K, value), with vectors (K, size)."""
        result = np.empty_like(x)
        for first in range(0, len(x), BLOCK):
            part = slice(first, first + BLOCK)
            terms = values[part].take(self.source, axis=1) * x[part].take(self.columns, axis=1)
            result[part] = np.add.reduceat(terms, self.starts, axis=1)
        return result

    def factorise(self, values: Array) -> Factors:
        """Factorise each system, given by values (K, value), by SuperLU, with its columns ordered for low fill."""
        import scipy.sparse
        import scipy.sparse.linalg

        order, rows, pointers = self.compressed
        entries, factors = values.take(self.source[order], axis=1), []
        scales = np.ones((len(values), self.size))
        for k, data in enumerate(entries):
            # rows of light bodies are scaled up: the pivots of the factorisation see comparable numbers
            largest = np.zeros(self.size)
            np.maximum.at(largest, rows, np.abs(data))
            scales[k] = np.where(largest > 0, largest, 1.0)
            matrix = scipy.sparse.csc_matrix((data / scales[k, rows], rows, pointers), (self.size, self.size))
            try:
                factor = scipy.sparse.linalg.splu(matrix, diag_pivot_thresh=PIVOT) if np.isfinite(data).all() else None
            except RuntimeError:  # it is singular
                factor = None
            factors.append(factor)
        return Factors(tuple(factors), scales)


@dataclass(frozen=True)
class Factors:
    """Factorised systems."""

    factors: tuple[Any, ...]  # SciPy's object of each system; None where it is singular
    scales: Array  # (K, size): divisors of its rows

    def solve(self, right: Array) -> Array:
        """Solve for right-hand sides (K, size); NaN where a system is singular."""
        found = np.full(right.shape, np.nan)
        for k, factor in enumerate(self.factors):
            if factor is not None and np.isfinite(right[k]).all():
                found[k] = factor.solve(right[k] / self.scales[k])
        return found
