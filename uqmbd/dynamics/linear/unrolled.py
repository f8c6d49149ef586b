"""Unrolled elimination: Gaussian elimination as compiled code without loops, for many small systems of one pattern.

The operations of an `Elimination` are written down once, without loops or tests, and compiled.  Where there are many,
they are compiled in sections, each of a length that the compiler still likes; values that a later section needs travel
through an array.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqmbd.compiled import cached
from uqmbd.dynamics.equations import Kernel, unrolled_kernel
from uqmbd.dynamics.linear.elimination import Elimination
from uqmbd.typing import Array, Index

__all__ = [
    "LIMIT",
    "Operation",
    "UnrolledElimination",
    "defect_kernel",
    "eliminated",
    "residual_kernel",
    "section_kernel",
    "unroll",
    "worth_while",
]


SECTION = 2000
"""Operations that are compiled together."""

DEEP = 10**12
"""Size, as a tree without shared parts, of an expression that ends a section: deeper ones take the compiler minutes."""

LIMIT = 4000
"""Operations up to which compilation pays."""


BLOCK = 64
"""Systems whose values between sections are held at once: they should stay in the processor's cache."""

TINY = 1e-150
"""Added to a sum of magnitudes that may vanish; its square must not underflow."""


@dataclass(frozen=True)
class _Section:
    """Some operations: which values they read, and where their results go."""

    kernel: Kernel
    reads: Index
    writes: Index


@dataclass(frozen=True)
class UnrolledElimination:
    """A compiled elimination.

    Attributes
    ----------
    given : int
        Values that are given with each system.
    width : int
        Values that are kept between sections; the first are the given ones.
    sections : tuple
        The code.
    solution : array of int
        Where the solution is among the values.
    """

    given: int
    width: int
    sections: tuple[_Section, ...]
    solution: Index

    def __call__(self, given: Array, out: Array | None = None) -> Array:
        """Solve.

        Parameters
        ----------
        given : array, shape (K, given)
            What is known of each system, C-contiguous.
        out : array, shape (K, solution), optional
            Where to write.

        Returns
        -------
        array, shape (K, solution)
            The wanted unknowns, of one right-hand side after the other; infinite or NaN where a pivot vanishes.
        """
        if len(self.sections) == 1:
            return self.sections[0].kernel.fast(given, out)
        if out is None:
            out = np.empty((len(given), len(self.solution)))
        for first in range(0, len(given), BLOCK):
            part = given[first : first + BLOCK]
            values = np.empty((len(part), self.width))
            values[:, : self.given] = part
            for section in self.sections:
                values[:, section.writes] = section.kernel.fast(np.ascontiguousarray(values[:, section.reads]))
            out[first : first + BLOCK] = values[:, self.solution]
        return out


def unroll(
    elimination: Elimination, rows: Index, columns: Index, entries: Index, rights: Index, given: int, wanted: int
) -> UnrolledElimination | None:
    """Compile an elimination, or return None if it has too many operations.

    Parameters
    ----------
    elimination : Elimination
        Order of elimination.
    rows, columns : array of int, shape (entry,)
        Places of the entries.
    entries : array of int, shape (entry,)
        Which of the given values each of them is.
    rights : array of int, shape (R, size)
        Which of the given values each entry of a right-hand side is; -1: zero.
    given : int
        Number of values that are given with a system.
    wanted : int
        The first so many unknowns are wanted.
    """
    operations, solution = eliminated(elimination, rows, columns, entries, rights, given, wanted)
    if not worth_while(operations):
        return None
    key = (
        "straight line",
        SECTION,
        DEEP,
        given,
        wanted,
        rows.tolist(),
        columns.tolist(),
        entries.tolist(),
        rights.tolist(),
        elimination.steps,
    )
    sections: tuple[_Section, ...] = cached(key, lambda: _compiled(operations, given, solution))
    return UnrolledElimination(given, given + len(operations), sections, np.array(solution, dtype=np.int64))


def worth_while(operations: list[Operation]) -> bool:
    """Whether operations are not too many to be compiled."""
    return len(operations) <= LIMIT


def residual_kernel(rows: Index, columns: Index, entries: Index, right: Index, given: int) -> Kernel:
    """Compile how well a solution satisfies its system: ``sum_i ((A x - b)_i / (|A| |x| + |b|)_i)^2``.

    Its arguments are the given values and the solution; the others are those of `unroll`.
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
        return unrolled_kernel([*values, *unknowns], [total])

    key = ("residual of a system", rows.tolist(), columns.tolist(), entries.tolist(), right.tolist(), given)
    kernel: Kernel = cached(key, make)
    return kernel


def defect_kernel(rows: Index, columns: Index, entries: Index, right: Index, given: int) -> Kernel:
    """Compile the defect ``b - A x``; its arguments are the given values and ``x``, as for `residual_kernel`."""

    def make() -> Kernel:
        import symengine as se

        values = [se.Symbol(f"_x{k}") for k in range(given)]
        unknowns = [se.Symbol(f"_u{k}") for k in range(len(right))]
        parts: list[list[Any]] = [[values[b]] if b >= 0 else [] for b in right]
        for i, j, k in zip(rows, columns, entries, strict=True):
            parts[i].append(-values[k] * unknowns[j])
        return unrolled_kernel([*values, *unknowns], [se.Add(*terms) for terms in parts])

    key = ("defect of a system", rows.tolist(), columns.tolist(), entries.tolist(), right.tolist(), given)
    kernel: Kernel = cached(key, make)
    return kernel


Operation = tuple[str, int, int, int]
"""Inverse ``1 / a``, product ``a b``, difference ``a - b c`` (without a: ``- b c``), of values by number."""


def eliminated(
    elimination: Elimination, rows: Index, columns: Index, entries: Index, rights: Index, given: int, wanted: int
) -> tuple[list[Operation], list[int]]:
    """Write an elimination down; the arguments are those of `unroll`.

    Returns
    -------
    operations : list of Operation
        Each makes one new value, numbered after the given ones.
    solution : list of int
        Numbers of the wanted unknowns, of one right-hand side after the other.
    """
    slots = elimination.slots
    value: dict[int, int] = {}
    operations: list[Operation] = []

    def made(kind: str, a: int, b: int = -1, c: int = -1) -> int:
        operations.append((kind, a, b, c))
        return given + len(operations) - 1

    for i, j, k in zip(rows, columns, entries, strict=True):
        slot = int(slots[i, j])
        value[slot] = made("sum", value[slot], int(k)) if slot in value else int(k)
    right = [{i: int(k) for i, k in enumerate(side) if k >= 0} for side in rights]
    inverses: dict[int, int] = {}
    for row, column, below, beside in elimination.steps:
        inverses[row] = inverse = made("inverse", value[int(slots[row, column])])
        pivots = [(j, value[slot]) for j in beside if (slot := int(slots[row, j])) in value]
        for i in below:
            entry = value.get(int(slots[i, column]))
            if entry is None:
                continue
            factor = made("product", entry, inverse)
            for j, pivot in pivots:
                slot = int(slots[i, j])
                value[slot] = made("difference", value.get(slot, -1), factor, pivot)
            for side in right:
                if row in side:
                    side[i] = made("difference", side.get(i, -1), factor, side[row])
    solution: list[int] = []
    for side in right:
        found: dict[int, int] = {}
        for row, column, _, beside in reversed(elimination.steps):
            total = side.get(row, -1)
            for j in beside:
                slot = int(slots[row, j])
                if slot in value and j in found:
                    total = made("difference", total, value[slot], found[j])
            if total >= 0:
                found[column] = made("product", total, inverses[row])
        missing = [j for j in range(wanted) if j not in found]
        for j in missing:
            found[j] = made("zero", -1)
        solution += [found[j] for j in range(wanted)]
    return operations, solution


def _compiled(operations: list[Operation], first: int, solution: list[int]) -> tuple[_Section, ...]:
    last_use = dict.fromkeys(solution, len(operations))
    for k, operation in enumerate(operations):
        for operand in operation[1:]:
            if operand >= 0:
                last_use[operand] = max(k, last_use.get(operand, -1))
    edges = _edges(operations, first)
    if len(edges) == 2:  # reads everything in order and writes the solution: nothing needs to be kept
        return (_section(operations, first, 0, list(range(first)), solution),)
    sections = []
    for begin, end in itertools.pairwise(edges):
        part = operations[begin:end]
        made = range(first + begin, first + end)
        reads = sorted({x for o in part for x in o[1:] if x >= 0 and x not in made})
        writes = [x for x in made if last_use.get(x, -1) >= end]
        sections.append(_section(part, first, begin, reads, writes))
    return tuple(sections)


def _edges(operations: list[Operation], first: int) -> list[int]:
    """First operation of each section, and the end: sections are neither too long nor too deep."""
    edges, size = [0], dict[int, int]()
    for k, (_, *operands) in enumerate(operations):
        total = 1 + sum(size.get(x, 1) for x in operands if x >= 0)
        if total > DEEP or k - edges[-1] >= SECTION:
            edges.append(k)
            size.clear()
            total = 1 + len(operands)
        size[first + k] = total
    return [*edges, len(operations)]


def section_kernel(operations: list[Operation], given: int, writes: list[int]) -> Kernel:
    """Compile operations that read all given values and make those of numbers `writes`."""
    return _section(operations, given, 0, list(range(given)), writes).kernel


def _section(part: list[Operation], first: int, begin: int, reads: list[int], writes: list[int]) -> _Section:
    import symengine as se

    symbols: dict[int, Any] = {x: se.Symbol(f"_x{x}") for x in reads}
    values = dict(symbols)
    for k, (kind, a, b, c) in enumerate(part):
        if kind == "inverse":
            made = 1 / values[a]
        elif kind == "product":
            made = values[a] * values[b]
        elif kind == "sum":
            made = values[a] + values[b]
        elif kind == "zero":
            made = se.Integer(0)
        else:
            made = -values[b] * values[c] if a < 0 else values[a] - values[b] * values[c]
        values[first + begin + k] = made
    kernel = unrolled_kernel([symbols[x] for x in reads], [values[x] for x in writes])
    return _Section(kernel, np.array(reads, dtype=np.int64), np.array(writes, dtype=np.int64))
