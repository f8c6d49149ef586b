"""Residuals of solutions of large systems by rows, so that compiled code does not grow with the system."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.compiled import Kernel, ProgramWriter, cached, compile_kernel
from uqmbd.dynamics.linear.unrolled import TINY
from uqmbd.typing import Index

__all__ = ["RowResiduals"]


TERMS = 4
"""Rows are padded with zeros to a multiple of this number of terms, so that few kernels are compiled."""


@dataclass(frozen=True)
class RowResiduals:
    """Sum ``sum_i ((A x - b)_i / (|A| |x| + |b|)_i)^2``, which `residual_kernel` computes for small systems."""

    rows: Index  # (nnz,): row of each entry
    columns: Index  # (nnz,): column of each entry
    entries: Index  # (nnz,): index of each entry among the given values
    right: Index  # (size,): index of each entry of the right-hand side among the given values; -1: zero

    def write(self, writer: ProgramWriter, given: Index, solution: Index) -> Index:
        """Write the sum for rows of the given values and of the solution; return the row of the sum."""
        zero = writer.sums([[]])[0]
        kinds: dict[int, list[Index]] = {}
        order = np.argsort(self.rows, kind="stable")
        starts = np.searchsorted(self.rows[order], np.arange(len(self.right) + 1))
        for i, b in enumerate(self.right):
            which = order[starts[i] : starts[i + 1]]
            length = -(-max(1, len(which)) // TERMS) * TERMS
            reads = np.full(2 * length + 1, zero)
            reads[: len(which)], reads[length : length + len(which)] = (
                given[self.entries[which]],
                solution[self.columns[which]],
            )
            reads[-1] = zero if b < 0 else given[b]
            kinds.setdefault(length, []).append(reads)
        parts = [writer.call(_row(length), np.stack(reads)).ravel() for length, reads in sorted(kinds.items())]
        return writer.sums([np.concatenate([np.zeros(0, dtype=np.int64), *parts]).tolist()])


def _row(length: int) -> Kernel:
    """Compile the squared relative residual of a row with `length` terms."""

    def make() -> Kernel:
        import symengine as se

        a, x, b = se.symbols(f"a:{length}"), se.symbols(f"x:{length}"), se.Symbol("b")
        parts = [*(u * v for u, v in zip(a, x, strict=True)), -b]
        size = se.Add(*[abs(part) for part in parts]) + TINY
        return compile_kernel([*a, *x, b], [(se.Add(*parts) / size) ** 2])

    kernel: Kernel = cached(("residual of a row", length), make)
    return kernel
