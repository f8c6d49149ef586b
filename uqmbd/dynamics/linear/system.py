"""Pattern of the index-1 system of a model, and its compiled solution.

Compiled solutions eliminate the unknowns in an order that is chosen once, without pivoting at run time. `SparsePattern`
multiplies many systems with the same sparsity pattern, and solves them with pivoting by SuperLU.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph

from uqmbd.compiled import Kernel
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.linear.elimination import Elimination, plan
from uqmbd.dynamics.linear.fronts import FrontalSolver, Fronts, frontal
from uqmbd.dynamics.linear.ordering import rounds_of, units_of
from uqmbd.dynamics.linear.programs import Programs, programs_of
from uqmbd.dynamics.linear.residual import RowResiduals
from uqmbd.dynamics.linear.unrolled import residual_kernel, unroll
from uqmbd.logs import derivation
from uqmbd.typing import Array, Index

__all__ = ["SparsePattern", "System", "index1_system"]

BLOCK = 256
"""Number of systems in one multiplication."""

PIVOT = 0.1
"""Least ratio of a pivot to the largest entry of its column; a value below 1 allows sparser factors."""


@dataclass(frozen=True)
class SparsePattern:
    """Sparsity pattern of systems."""

    rows: Index  # (nnz,): sorted; no row is empty
    columns: Index  # (nnz,)
    source: Index  # (nnz,): index of each entry among the given values of a system
    size: int  # number of unknowns

    @cached_property
    def starts(self) -> Index:
        """Index of the first entry of each row."""
        return np.searchsorted(self.rows, np.arange(self.size)).astype(np.int64)

    @cached_property
    def compressed(self) -> tuple[Index, Index, Index]:
        """Order of the entries by columns, rows of the ordered entries, and index of the first entry of each column."""
        order = np.lexsort((self.rows, self.columns))
        pointers = np.searchsorted(self.columns[order], np.arange(self.size + 1))
        return order, self.rows[order], pointers

    def product(self, values: Array, x: Array) -> Array:
        """Return products ``A_k x_k`` (K, size) of systems with values (K, value) and vectors (K, size)."""
        result = np.empty_like(x)
        for first in range(0, len(x), BLOCK):
            part = slice(first, first + BLOCK)
            terms = values[part].take(self.source, axis=1) * x[part].take(self.columns, axis=1)
            result[part] = np.add.reduceat(terms, self.starts, axis=1)
        return result

    def factorise(self, values: Array) -> Factors:
        """Factorise systems with values (K, value) by SuperLU, with columns ordered for low fill."""
        import scipy.sparse
        import scipy.sparse.linalg

        order, rows, pointers = self.compressed
        entries, factors = values.take(self.source[order], axis=1), []
        scales = np.ones((len(values), self.size))
        for k, data in enumerate(entries):
            # scale rows of light bodies, so that pivots of the factorisation compare similar numbers
            largest = np.zeros(self.size)
            np.maximum.at(largest, rows, np.abs(data))
            scales[k] = np.where(largest > 0, largest, 1.0)
            matrix = scipy.sparse.csc_matrix((data / scales[k, rows], rows, pointers), (self.size, self.size))
            try:
                factor = scipy.sparse.linalg.splu(matrix, diag_pivot_thresh=PIVOT) if np.isfinite(data).all() else None
            except RuntimeError:  # the system is singular
                factor = None
            factors.append(factor)
        return Factors(tuple(factors), scales)


@dataclass(frozen=True)
class Factors:
    """Factorised systems."""

    factors: tuple[Any, ...]  # SciPy's object of each system; None for singular systems
    scales: Array  # (K, size): divisors of the rows

    def solve(self, right: Array) -> Array:
        """Solve for right-hand sides (K, size); NaN for singular systems."""
        found = np.full(right.shape, np.nan)
        for k, factor in enumerate(self.factors):
            if factor is not None and np.isfinite(right[k]).all():
                found[k] = factor.solve(right[k] / self.scales[k])
        return found


ELIMINATION_LIMIT = 100
"""Largest number of unknowns for an elimination in one piece of compiled code.

The elimination of larger systems is compiled by kinds of blocks (`uqmbd.dynamics.linear.fronts`). For chains of 23 to
647 unknowns, the compilation by blocks took 0.1 to 0.2 s. In one piece, it took 0.2 s for 23 unknowns, and 1 s for 87.
For 23 and 39 unknowns, the solution of a single system by blocks took up to 1.7 times as long as in one piece. The
times for 64 systems at once differed by at most a third."""


@dataclass(frozen=True)
class System:
    """Map from results of the ``acceleration`` evaluator to the symmetric index-1 system."""

    rows: Index  # (nnz,): row of each entry, sorted
    columns: Index  # (nnz,): column of each entry
    source: Index  # (nnz,): index of the result for each entry
    size: int
    motion: Index  # (size,): index of the result for each entry of the right-hand side; -1: zero
    # (2, size): index of the ``drift`` result for the projections of coordinates and of velocities; -1: zero
    drift: Index
    elimination: Elimination | None = None
    fronts: Fronts | None = None
    """Compiled elimination of a large system by blocks."""
    solve: Kernel | FrontalSolver | None = None
    """Compiled map from results of the ``acceleration`` evaluator to accelerations and multipliers."""
    programs: Programs | None = None
    """Compiled functions of a state; None if no solution is compiled (`index1_system`)."""
    poses: tuple[Array, Array] | None = None
    """Arguments (S, width + 2) and parameters (S, parameter) of typical states, for other orders of elimination."""

    def matrix(self, values: Array) -> Array:
        """Return dense matrices (K, size, size) from results (K, result) of the ``acceleration`` evaluator."""
        found = np.zeros((len(values), self.size * self.size))
        found[:, self._entries] = values[:, self.source]
        return found.reshape(len(values), self.size, self.size)

    @cached_property
    def _entries(self) -> Index:
        """Indices of the entries in a matrix flattened by rows."""
        return self.rows * self.size + self.columns

    def right(self, values: Array) -> Array:
        """Return right-hand sides (K, size) from results (K, result) of the ``acceleration`` evaluator."""
        found = np.zeros((len(values), self.size))
        found[:, self._moved] = values[:, self.motion[self._moved]]
        return found

    @cached_property
    def _moved(self) -> Index:
        """Indices of the entries of the right-hand side that are not identically zero."""
        return np.flatnonzero(self.motion >= 0)

    def drift_sides(self, values: Array) -> list[Array]:
        """Return right-hand sides (K, size) of both projections from results (K, result) of the ``drift`` evaluator."""
        return [_taken(values, side) for side in self.drift]

    @cached_property
    def pattern(self) -> SparsePattern:
        """Sparsity pattern of the system, for sparse products and factorisations."""
        return SparsePattern(self.rows, self.columns, self.source, self.size)


def _taken(values: Array, which: Index) -> Array:
    """Return the columns `which` of values (K, value); zeros for the index -1."""
    found, used = np.zeros((len(values), len(which))), which >= 0
    found[:, used] = values[:, which[used]]
    return found


def index1_system(model: Model, poses: tuple[Array, Array] | None) -> System:
    """Return the index-1 system of a model with its independent equations.

    The order of elimination is chosen at typical `poses`: arguments (S, width + 2) of the ``acceleration`` evaluator,
    and parameters (S, parameter).  No solution is compiled if `poses` is None, if the pattern is structurally singular,
    or if regular blocks would be too large.  LAPACK, or SuperLU for more than `DENSE_LIMIT` unknowns, then solves the
    systems (`solve_directly`).
    """
    derivation.debug("choosing the order of elimination")
    evaluators, layout = model.evaluators, model.layout
    index, n = evaluators["acceleration"].index, layout.coordinates
    size = n + layout.rank
    rows, columns, source = ([np.zeros(0, dtype=np.int64)] for _ in range(3))
    if "mass" in index:
        results, (i, k) = index["mass"]
        rows, columns, source = [i], [k], [results]
    if "d" in index:
        results, (i, k) = index["d"]
        used = layout.number[i] >= 0
        row = n + layout.number[i][used]
        rows += [row, k[used]]
        columns += [k[used], row]
        source += [results[used], results[used]]
    all_rows, all_columns = np.concatenate(rows), np.concatenate(columns)
    order = np.lexsort((all_columns, all_rows))
    motion, drift = np.full(size, -1, dtype=np.int64), np.full((2, size), -1, dtype=np.int64)
    equations = np.where(layout.number < 0, -1, n + layout.number)
    for side, kind, letter, place in (
        (motion, "acceleration", "force", np.arange(n)),
        (motion, "acceleration", "gamma", equations),
        (drift[0], "drift", "phi", equations),
        (drift[1], "drift", "psi", equations),
    ):
        if kind in evaluators and letter in evaluators[kind].index:
            results, (i,) = evaluators[kind].index[letter]
            used = place[i] >= 0
            side[place[i[used]]] = results[used]
    system = System(
        all_rows[order],
        all_columns[order],
        np.concatenate(source)[order],
        size,
        motion,
        drift,
    )
    # a structurally singular pattern cannot be eliminated; its builder reports the reason
    if poses is None or _structural_rank(system) < size:
        return system
    system, typical = replace(system, poses=poses), evaluators["acceleration"](*poses)
    if size > ELIMINATION_LIMIT:
        return _by_blocks(model, system, typical)
    elimination = plan(system.rows, system.columns, system.matrix(typical))
    return _compiled(model, replace(system, elimination=elimination), typical)


def _structural_rank(system: System) -> int:
    """Return the largest rank of matrices with the system's pattern.

    SciPy's matching takes exponentially long for some orders of rows and columns, such as the orders of long chains.
    The matching of a random order takes negligible time.
    """
    random, size = np.random.default_rng(0), system.size
    rows, columns = (random.permutation(size)[which] for which in (system.rows, system.columns))
    pattern = scipy.sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=(size, size))
    return int(scipy.sparse.csgraph.structural_rank(pattern))


def _compiled(model: Model, system: System, typical: Array) -> System:
    """Compile the solution for all right-hand sides, in one piece or, if the code is too long, by blocks."""
    given, n = len(model.evaluators["acceleration"].targets), model.layout.coordinates
    motion, place, move = _rights(system, given)

    def code(rights: Index, values: int, returned: int) -> Kernel | None:
        order = system.elimination
        assert order is not None
        return unroll(order, system.rows, system.columns, system.source, rights, values, returned)

    solve, accelerate = code(motion, given, system.size), code(motion, given, n)
    both = given + len(model.evaluators["drift"].targets)
    back = code(place, both, n), code(move, both, n)
    if solve is None or accelerate is None or back[0] is None or back[1] is None:
        return _by_blocks(model, system, typical)
    residual = residual_kernel(system.rows, system.columns, system.source, system.motion, given)
    compiled = programs_of(model, solve, accelerate, (back[0], back[1]), residual)
    return replace(system, solve=solve, programs=compiled)


def _by_blocks(model: Model, system: System, typical: Array) -> System:
    """Compile the solution of a large system by kinds of blocks, if possible."""
    layout = model.layout
    owners = [model.owners[k] for k in layout.kept]
    units = units_of(system.rows, system.columns, layout.coordinates, model.size, owners)
    rounds = rounds_of(units, system.rows, system.columns, typical[:, system.source])
    if rounds is None:
        return system
    given, n = len(model.evaluators["acceleration"].targets), layout.coordinates
    fronts = frontal(rounds, system.rows, system.columns, system.source, given, system.size)
    if fronts is None:
        return system
    motion, place, move = _rights(system, given)
    solve, accelerate, *back = (
        FrontalSolver(fronts, rights, returned)
        for rights, returned in ((motion, system.size), (motion, n), (place, n), (move, n))
    )
    residual = RowResiduals(system.rows, system.columns, system.source, system.motion)
    compiled = programs_of(model, solve, accelerate, (back[0], back[1]), residual)
    return replace(system, fronts=fronts, solve=solve, programs=compiled)


def _rights(system: System, given: int) -> tuple[Index, Index, Index]:
    """Return indices of right-hand sides of the motion and of both projections; ``drift`` results begin at `given`."""
    place, move = np.where(system.drift < 0, -1, given + system.drift)
    return system.motion[None], place[None], move[None]
