"""Elimination of large systems by blocks: code for each kind of block, compiled once and used for all its blocks.

A front is a unit of a mechanism during its elimination, with block ``A``, coupling ``B`` to its neighbours and
right-hand side ``b``. The elimination adds ``-B^T A^-1 B`` and ``-B^T A^-1 b`` to the equations of the neighbours. From
the unknowns ``y`` of the neighbours follow the unknowns ``x = A^-1 b - A^-1 B y`` of the front [1]_. Fronts with the
same pattern share their code. Fronts of one round are computed together, for all realisations. The
compilation time and the number of calls therefore grow more slowly than the size of the system.

References
----------
.. [1] I. S. Duff, J. K. Reid, The multifrontal solution of indefinite sparse symmetric linear equations, ACM
   Transactions on Mathematical Software 9 (1983) 302-325.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from uqmbd.compiled import Kernel, Operation, Program, ProgramWriter, cached, compile_operations
from uqmbd.dynamics.linear.elimination import plan
from uqmbd.dynamics.linear.ordering import Front
from uqmbd.dynamics.linear.unrolled import eliminated, is_compilable
from uqmbd.typing import Array, Index

__all__ = ["FrontalSolver", "Fronts", "frontal"]


@dataclass(frozen=True)
class _FrontBatch:
    """Fronts of one kind and round: the inputs of each front, and the range of the results."""

    kernel: Kernel
    reads: Index  # (front, argument)
    first: int
    last: int


@dataclass(frozen=True)
class Fronts:
    """The compiled elimination of a system."""

    given: int  # number of values given with a system; a right-hand side follows them, then the computed values
    size: int  # number of unknowns
    width: int  # number of all values
    batches: tuple[_FrontBatch, ...]  # code
    solution: Index  # (size,): indices of the solution among the values
    operations: int  # additions, multiplications and divisions of a solution

    def solve(self, given: Array, right: Array) -> Array:
        """Solve systems (K, given) for right-hand sides (K, size), shape (K, size)."""
        return self._program(given[:, : self.given], right)

    @cached_property
    def _program(self) -> Program:
        rows = np.arange(self.given + self.size)
        writer = ProgramWriter(len(rows))
        return writer.program(self.write(writer, rows[: self.given], rows[self.given :]))

    def write(self, writer: ProgramWriter, given: Index, right: Index) -> Index:
        """Write the solution for rows of the given values and of the right-hand side; return rows of all unknowns."""
        rows = np.empty(self.width, dtype=np.int64)
        rows[: self.given], rows[self.given : self.given + self.size] = given[: self.given], right
        for batch in self.batches:
            rows[batch.first : batch.last] = writer.call(batch.kernel, rows[batch.reads]).ravel()
        return rows[self.solution]


@dataclass(frozen=True)
class FrontalSolver:
    """Solver for right-hand sides among the given values; it is called like the kernel of an elimination."""

    fronts: Fronts
    rights: Index  # (R, size): index of each entry of a right-hand side among the given values; -1: zero
    returned: int  # number of returned leading unknowns

    def __call__(self, given: Array, out: Array | None = None) -> Array:
        """Solve systems (K, value); return solutions (K, R returned), one right-hand side after the other."""
        width = given.shape[1]
        if width not in self._programs:
            writer = ProgramWriter(width)
            self._programs[width] = writer.program(self.write(writer, np.arange(width)))
        return self._programs[width](given, out=out)

    @cached_property
    def _programs(self) -> dict[int, Program]:
        """Cached programs, by number of values."""
        return {}

    def write(self, writer: ProgramWriter, given: Index) -> Index:
        """Write the solutions for the `given` rows; return rows of the returned unknowns."""
        zero = writer.sums([[]])[0]
        sides = [np.where(side < 0, zero, given[side]) for side in self.rights]
        return np.concatenate([self.fronts.write(writer, given, side)[: self.returned] for side in sides])


@dataclass(frozen=True)
class _Code:
    """Code of one kind of front, and its results, in local numbering."""

    forward: Kernel
    backward: Kernel
    beside: tuple[tuple[int, int], ...]  # entries of A^-1 B
    left: tuple[tuple[int, int], ...]  # entries of -B^T A^-1 B, on and above the diagonal
    moved: tuple[int, ...]  # entries of -B^T A^-1 b
    operations: int


def frontal(
    rounds: list[list[Front]], rows: Index, columns: Index, source: Index, given: int, size: int
) -> Fronts | None:
    """Compile the elimination of a symmetric matrix by rounds; None if a kind of front has too many operations.

    The entries (nnz,) have rows, columns, and indices `source` among the `given` values.
    """
    # indices of the summands of each entry of the remaining matrix and of the right-hand side
    entries: dict[tuple[int, int], list[int]] = {}
    for i, j, k in zip(rows.tolist(), columns.tolist(), source.tolist(), strict=True):
        if i <= j:
            entries.setdefault((i, j), []).append(k)
    rights = {i: [given + i] for i in range(size)}
    width = given + size
    forward: list[_FrontBatch] = []
    later: list[list[tuple[_Code, list[_Place]]]] = []
    operations = 0
    for fronts in rounds:
        kinds: dict[Any, list[_Place]] = {}
        for front in fronts:
            place = _Place.of(front, entries, rights)
            kinds.setdefault(place.key, []).append(place)
        later.append([])
        for key, places in kinds.items():
            code = _code(key, np.concatenate([p.front.block for p in places]))
            if code is None:
                return None
            outputs = code.forward.outputs
            reads = np.array([p.reads for p in places], dtype=np.int64).reshape(len(places), -1)
            forward.append(_FrontBatch(code.forward, reads, width, width + len(places) * outputs))
            for p in places:
                p.first = width
                width += outputs
                p.leave(code, entries, rights)
            later[-1].append((code, places))
            operations += code.operations * len(places)
    backward: list[_FrontBatch] = []
    solution = np.zeros(size, dtype=np.int64)
    for kind in reversed(later):
        for code, places in kind:
            begin, count = width, code.backward.outputs
            columns_read = []
            for p in places:
                known = [int(solution[x]) for x in p.beside]
                columns_read.append([*range(p.first, p.first + len(code.beside) + count), *known])
                solution[list(p.front.unknowns)] = np.arange(width, width + count)
                width += count
            reads = np.array(columns_read, dtype=np.int64).reshape(len(places), -1)
            backward.append(_FrontBatch(code.backward, reads, begin, width))
    return Fronts(given, size, width, (*forward, *backward), solution, operations)


class _Place:
    """Indices of a front among the values."""

    def __init__(self, front: Front, beside: list[int], reads: list[int], key: Any) -> None:
        self.front, self.beside, self.reads, self.key, self.first = front, beside, reads, key, 0

    @staticmethod
    def of(front: Front, entries: dict[tuple[int, int], list[int]], rights: dict[int, list[int]]) -> _Place:
        """Return the inputs of a front; fronts with the same key share their code."""
        own = front.unknowns
        beside = [j for j in front.neighbours if any(_slot(i, j) in entries for i in own)]
        square = [entries.get(_slot(own[a], own[b]), []) for a in range(len(own)) for b in range(a, len(own))]
        across = [entries.get(_slot(i, j), []) for i in own for j in beside]
        sides = [rights[i] for i in own]
        key = (len(own), len(beside), *(tuple(len(x) for x in part) for part in (square, across, sides)))
        return _Place(front, beside, [k for part in (square, across, sides) for x in part for k in x], key)

    def leave(self, code: _Code, entries: dict[tuple[int, int], list[int]], rights: dict[int, list[int]]) -> None:
        """Add the contribution of the front to its neighbours."""
        value = self.first + len(code.beside) + len(self.front.unknowns)
        for i, j in code.left:
            entries.setdefault(_slot(self.beside[i], self.beside[j]), []).append(value)
            value += 1
        for i in code.moved:
            rights[self.beside[i]].append(value)
            value += 1


def _slot(i: int, j: int) -> tuple[int, int]:
    return (i, j) if i <= j else (j, i)


def _code(key: Any, typical: Array) -> _Code | None:
    """Write and compile the code of a kind of front; None if it is too long."""
    size, count, square, across, sides = key
    first = sum(map(sum, (square, across, sides)))
    operations: list[Operation] = []

    def made(kind: str, a: int, b: int = -1, c: int = -1) -> int:
        operations.append((kind, a, b, c))
        return first + len(operations) - 1

    read = 0

    def entry(number: int) -> int:
        """Return the index of the sum of an entry's arguments; -1 for a zero entry."""
        nonlocal read
        value = read if number else -1
        for k in range(read + 1, read + number):
            value = made("sum", value, k)
        read += number
        return value

    pairs = [(a, b) for a in range(size) for b in range(a, size)]
    own = {p: x for p, number in zip(pairs, square, strict=True) if (x := entry(number)) >= 0}
    coupling = np.array([entry(number) for number in across], dtype=np.int64).reshape(size, count)
    right = np.array([entry(number) for number in sides], dtype=np.int64)
    own |= {(b, a): x for (a, b), x in own.items()}
    places = sorted(own)
    rows, columns = (np.array(x, dtype=np.int64) for x in zip(*places, strict=True))
    values = np.array([own[p] for p in places], dtype=np.int64)
    order = plan(rows, columns, typical)
    known = first + len(operations)
    more, found = eliminated(order, rows, columns, values, np.vstack([coupling.T, right]), known, size)
    operations += more
    solved = np.array(found).reshape(count + 1, size)  # A^-1 B, transposed, and A^-1 b
    zeros = {known + k for k, (kind, *_) in enumerate(more) if kind == "zero"}

    def product(i: int, side: int) -> int:
        total = -1
        for k in range(size):
            if coupling[k, i] >= 0 and int(solved[side, k]) not in zeros:
                total = made("difference", total, int(coupling[k, i]), int(solved[side, k]))
        return total

    beside = tuple((j, k) for j in range(count) for k in range(size) if int(solved[j, k]) not in zeros)
    left = {(i, j): x for i in range(count) for j in range(i, count) if (x := product(i, j)) >= 0}
    moved = {i: x for i in range(count) if (x := product(i, count)) >= 0}
    writes = [int(solved[p]) for p in beside] + solved[count].tolist() + [*left.values(), *moved.values()]
    # arguments of the back substitution: entries of A^-1 B, A^-1 b, then the unknowns of the neighbours
    back: list[Operation] = []
    begin = len(beside) + size + count
    results = [len(beside) + k for k in range(size)]
    for place, (j, k) in enumerate(beside):
        back.append(("difference", results[k], place, len(beside) + size + j))
        results[k] = begin + len(back) - 1
    if not is_compilable(operations):
        return None
    name = ("front", key, order.steps)
    forward, backward = cached(
        name,
        lambda: (
            compile_operations(operations, range(first), writes, first),
            compile_operations(back, range(begin), results, begin),
        ),
    )
    return _Code(forward, backward, beside, tuple(left), tuple(moved), len(operations) + len(back))
