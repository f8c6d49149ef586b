"""Tables for ``assembly.c`` of the driver, which solves sparse equations for poses and velocities of least change.

This module computes the order of elimination, because the orderings of SciPy cannot place possibly dependent rows last.
The import of SuperLU alone takes longer than the ordering of a chain of one hundred links.
"""

from __future__ import annotations

import ctypes
import heapq
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from uqmbd.compiled import driver as c
from uqmbd.compiled.driver import address, aligned, load_driver
from uqmbd.compiled.programs import Addressed, Columns, Program
from uqmbd.typing import Array, Index, Mask

__all__ = ["EquationPrograms", "Gradients", "RotationCoordinates"]


class Gradients(NamedTuple):
    """Nonzero entries of the gradients of equations; `values` are row indices of the work array."""

    rows: Index  # equation
    columns: Index  # unknown of the derivative; -1: a fixed unknown
    values: Index
    factors: Array  # multipliers of the values

    def select(self, which: Mask) -> Gradients:
        """Return selected entries."""
        return Gradients(self.rows[which], self.columns[which], self.values[which], self.factors[which])

    def joined(self, other: Gradients) -> Gradients:
        """Return the entries of this object, then those of another."""
        return Gradients(
            np.concatenate([self.rows, other.rows]),
            np.concatenate([self.columns, other.columns]),
            np.concatenate([self.values, other.values]),
            np.concatenate([self.factors, other.factors]),
        )


@dataclass(frozen=True)
class RotationCoordinates(Addressed):
    """Coordinates of rotations; the first `dimension` coordinates determine the size of the mechanism."""

    coordinates: Index  # (body, 2 or 4); (body, 0) without rotations
    free: Index  # (body,): 1 if the coordinates may be normalised to length one, otherwise 0
    dimension: int

    @cached_property
    def structure(self) -> c.TurnsStruct:
        """Return the C structure for the driver."""
        tables = [np.ascontiguousarray(x, dtype=np.int64) for x in (self.coordinates, self.free)]
        bodies, size = self.coordinates.shape
        found = c.TurnsStruct(*map(address, tables), bodies if size else 0, size, self.dimension)
        found.kept = tables
        return found


@dataclass(frozen=True)
class EquationPrograms(Addressed):
    """Equations with a program for values and gradients."""

    program: Program  # program; its first arguments are the unknowns
    values: Index  # (equation,): row of each value; -1: zero
    gradients: Gradients
    solved: Index  # indices of equations to solve; the other equations are only evaluated
    certain: int  # number of certainly independent equations, which come first
    unknowns: int  # number of unknowns
    shortest: float  # minimum length of a gradient that is scaled to one

    def close(
        self, turns: RotationCoordinates, cosines: Index, *sources: Array | Columns, count: int
    ) -> tuple[Array, Mask]:
        """Solve by damped Gauss-Newton; return unknowns (K, unknown) and a mask (K,) of the undecided poses.

        The sources contain the arguments of the program (K, argument), the unknowns first; `turns` bounds a step. The
        rows `cosines` are negative if a pose is a mirror image of the intended pose. A pose is undecided if the
        equations are singular, the iteration stalls, or the pose is a mirror image.
        """
        first, *others = sources
        assert isinstance(first, np.ndarray)
        table, kept, _ = self.program.sources((np.ascontiguousarray(first), *others), count)
        found, undecided = np.empty((count, self.unknowns)), np.ones(count, dtype=np.int64)
        structure, bounds, memory = self.structure, turns.structure, self._memory()
        load_driver().close_poses(
            *(ctypes.addressof(structure), ctypes.addressof(bounds), address(memory), address(table)),
            *(len(table), count, address(found), len(cosines), address(cosines), address(undecided)),
        )
        return found, undecided != 0

    def least(self, *sources: Array | Columns, count: int) -> tuple[Array, Mask]:
        """Solve ``A x = -value`` with the smallest norm; `close` documents arguments and results."""
        table, kept, _ = self.program.sources(sources, count)
        found, undecided = np.empty((count, self.unknowns)), np.ones(count, dtype=np.int64)
        structure, memory = self.structure, self._memory()
        load_driver().least_speeds(
            *(ctypes.addressof(structure), address(memory), address(table)),
            *(len(table), count, address(found), address(undecided)),
        )
        return found, undecided != 0

    def _memory(self) -> Array:
        return aligned(load_driver().assembly_memory(ctypes.addressof(self.structure)))

    @cached_property
    def structure(self) -> c.EquationsStruct:
        """Return the C structure for the driver."""
        program = self.program.part.structure
        tables = self._tables
        found = c.EquationsStruct(
            program,
            *(self.program.rows, len(self.values), len(self.solved), self.certain, self.unknowns),
            *(len(self.gradients.rows), len(tables["below"])),
            *(address(tables[name]) for name, *_ in c.EquationsStruct._fields_ if name in tables),
            self.shortest,
        )
        found.kept = program, tables
        return found

    @cached_property
    def _tables(self) -> dict[str, Array | Index]:
        """Return entries sorted by the order of elimination, and the triangle of ``A A^T``."""
        g, number = self.gradients, np.full(len(self.values), -1, dtype=np.int64)
        number[self.solved] = np.arange(len(self.solved))
        counted = (number[g.rows] >= 0) & (g.columns >= 0)
        order, below = _eliminated(_neighbours(number[g.rows[counted]], g.columns[counted], number), self.certain)
        sequence = np.concatenate([self.solved[order], np.flatnonzero(number < 0)])
        place = np.argsort(sequence)
        entries = np.lexsort((g.columns, place[g.rows]))
        rows, columns = place[g.rows[entries]], g.columns[entries]
        starts = np.searchsorted(rows, np.arange(len(self.values) + 1))
        by_column = np.flatnonzero((rows < len(order)) & (columns >= 0))
        by_column = by_column[np.lexsort((rows[by_column], columns[by_column]))]
        following, ends = np.zeros((2, len(rows)), dtype=np.int64)
        following[by_column] = np.arange(len(by_column))
        ends[by_column] = np.searchsorted(columns[by_column], columns[by_column], side="right")
        triangle = [[k, *sorted(place[self.solved[sorted(x)]].tolist())] for k, x in enumerate(below)]
        first = np.cumsum([0, *map(len, triangle)])
        flat = np.array([i for column in triangle for i in column], dtype=np.int64)
        owner = np.repeat(np.arange(len(triangle)), np.diff(first))
        off = np.flatnonzero(flat != owner)
        left = off[np.lexsort((owner[off], flat[off]))]
        found = {
            "values": self.values[sequence],
            "starts": starts,
            "columns": columns,
            "from_": g.values[entries],
            "factors": g.factors[entries],
            "next": following,
            "ends": ends,
            "others": by_column,
            "rows_of": rows[by_column],
            "first": first,
            "below": flat,
            "changes": np.searchsorted(flat[left], np.arange(len(triangle) + 1)),
            "places": left,
            "owners": owner[left],
        }
        return {
            name: np.ascontiguousarray(x, dtype=float if name == "factors" else np.int64) for name, x in found.items()
        }


def _neighbours(rows: Index, columns: Index, number: Index) -> list[set[int]]:
    """Return, for each equation, the other equations that share an unknown with it."""
    found: list[set[int]] = [set() for k in number if k >= 0]
    sharing: dict[int, list[int]] = {}
    for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
        sharing.setdefault(column, []).append(row)
    for together in sharing.values():
        for row in together:
            found[row].update(together)
    for row, others in enumerate(found):
        others.discard(row)
    return found


def _eliminated(neighbours: list[set[int]], certain: int) -> tuple[Sequence[int], list[set[int]]]:
    """Return the minimum-degree order of unknowns of a symmetric system, the first `certain` before the others.

    Return the order, and for each eliminated unknown the set of unknowns with an entry in its column at that point.
    """
    order, below = list[int](), list[set[int]]()
    for part in (range(certain), range(certain, len(neighbours))):
        left, heap = set(part), [(len(neighbours[k]), k) for k in part]
        heapq.heapify(heap)
        while heap:
            degree, pivot = heapq.heappop(heap)
            if pivot not in left or degree != len(neighbours[pivot]):
                continue  # the degree has changed since the entry was made
            left.discard(pivot)
            others = neighbours[pivot]
            order.append(pivot)
            below.append(others)
            for k in others:
                neighbours[k] |= others
                neighbours[k] -= {pivot, k}
                if k in left:
                    heapq.heappush(heap, (len(neighbours[k]), k))
    return order, below
