"""Unrolled Gaussian elimination: compiled code for many small systems with the same pattern.

The code consists of the operations of an `Elimination`, without loops or tests.
"""

from __future__ import annotations

from uqmbd.compiled import Kernel, Operation, cached, compile_kernel, compile_operations
from uqmbd.dynamics.linear.elimination import Elimination
from uqmbd.typing import Index

__all__ = [
    "LIMIT",
    "eliminated",
    "residual_kernel",
    "unroll",
    "is_compilable",
]


LIMIT = 4000
"""Largest number of operations for which compilation saves time."""


TINY = 1e-150
"""Number added to a sum of magnitudes that may vanish; its square must not underflow."""


def unroll(
    elimination: Elimination, rows: Index, columns: Index, entries: Index, rights: Index, given: int, returned: int
) -> Kernel | None:
    """Compile an elimination, or return None if it has too many operations.

    From `given` values the kernel computes the first `returned` unknowns, for one right-hand side after the other.  The
    unknowns are infinite or NaN if a pivot vanishes.  The arrays `entries` (entry,) and `rights` (R, size) are the
    indices of matrix entries and right-hand sides among the given values; -1 means zero.
    """
    operations, solution = eliminated(elimination, rows, columns, entries, rights, given, returned)
    if not is_compilable(operations):
        return None
    key = ("elimination", given, returned, *(x.tolist() for x in (rows, columns, entries, rights)), elimination.steps)
    kernel: Kernel = cached(key, lambda: compile_operations(operations, range(given), solution, given))
    return kernel


def is_compilable(operations: list[Operation]) -> bool:
    """Return whether the number of operations is small enough for compilation."""
    return len(operations) <= LIMIT


def residual_kernel(rows: Index, columns: Index, entries: Index, right: Index, given: int) -> Kernel:
    """Compile the squared relative residual ``sum_i ((A x - b)_i / (|A| |x| + |b|)_i)^2`` of a solution.

    The arguments of the kernel are the given values and the solution.  The parameters are the same as in `unroll`.
    """

    def make() -> Kernel:
        import symengine as se

        values = [se.Symbol(f"_x{k}") for k in range(given)]
        unknowns = [se.Symbol(f"_u{k}") for k in range(len(right))]
        total = se.Integer(0)
        for i, b in enumerate(right):
            parts = [values[k] * unknowns[j] for r, j, k in zip(rows, columns, entries, strict=True) if r == i]
            parts += [-values[b]] if b >= 0 else []
            size = se.Add(*[abs(x) for x in parts]) + TINY
            total += (se.Add(*parts) / size) ** 2
        return compile_kernel([*values, *unknowns], [total])

    key = ("residual of a system", rows.tolist(), columns.tolist(), entries.tolist(), right.tolist(), given)
    kernel: Kernel = cached(key, make)
    return kernel


def eliminated(
    elimination: Elimination, rows: Index, columns: Index, entries: Index, rights: Index, given: int, returned: int
) -> tuple[list[Operation], list[int]]:
    """Return the operations of an elimination, and the indices of the returned unknowns.

    The parameters are the same as in `unroll`.  Each operation computes one value, with an index after the given
    values.  The indices of the unknowns are ordered by right-hand side.
    """
    value: dict[tuple[int, int], int] = {}
    operations: list[Operation] = []

    def made(kind: str, a: int, b: int = -1, c: int = -1) -> int:
        operations.append((kind, a, b, c))
        return given + len(operations) - 1

    for i, j, k in zip(rows.tolist(), columns.tolist(), entries.tolist(), strict=True):
        value[i, j] = made("sum", value[i, j], k) if (i, j) in value else k
    right = [{i: int(k) for i, k in enumerate(side) if k >= 0} for side in rights]
    inverses: dict[int, int] = {}
    for row, column, below, beside in elimination.steps:
        inverses[row] = inverse = made("inverse", value[row, column])
        pivots = [(j, value[row, j]) for j in beside if (row, j) in value]
        for i in below:
            entry = value.get((i, column))
            if entry is None:
                continue
            factor = made("product", entry, inverse)
            for j, pivot in pivots:
                value[i, j] = made("difference", value.get((i, j), -1), factor, pivot)
            for side in right:
                if row in side:
                    side[i] = made("difference", side.get(i, -1), factor, side[row])
    solution: list[int] = []
    for side in right:
        found: dict[int, int] = {}
        for row, column, _, beside in reversed(elimination.steps):
            total = side.get(row, -1)
            for j in beside:
                if (row, j) in value and j in found:
                    total = made("difference", total, value[row, j], found[j])
            if total >= 0:
                found[column] = made("product", total, inverses[row])
        missing = [j for j in range(returned) if j not in found]
        for j in missing:
            found[j] = made("zero", -1)
        solution += [found[j] for j in range(returned)]
    return operations, solution
