"""The layout of the index-1 system, and the code that solves it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph

from uqmbd.dynamics.equations import Kernel, Layout, Model
from uqmbd.dynamics.linear.elimination import Elimination, plan
from uqmbd.dynamics.linear.fronts import FrontalSolver, Fronts, frontal
from uqmbd.dynamics.linear.ordering import rounds_of, units_of
from uqmbd.dynamics.linear.sparse import SparsePattern
from uqmbd.dynamics.linear.straight_line import StraightLine, residual_kernel, straight_line
from uqmbd.typing import Array, Index

__all__ = ["System", "index1_system"]


ELIMINATION_LIMIT = 100
"""Unknowns up to which the elimination is one piece of compiled code.

Beyond, it is compiled by kinds of blocks (`uqmbd.dynamics.linear.fronts`), which takes some 0.1 s however large the
system is.  One solution takes longer, and a stack of them about as long: measured in
``studies/benchmarks/growth.py``."""


@dataclass(frozen=True)
class System:
    """Where the results of the ``acceleration`` evaluator stand in the symmetric index-1 system.

    Attributes
    ----------
    rows, columns, source : array of int, shape (nnz,)
        Place of each entry, sorted by rows, and the result that it is.
    starts : array of int
        First entry of each row.
    """

    rows: Index
    columns: Index
    source: Index
    starts: Index
    size: int
    elimination: Elimination | None
    motion: Index = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """Which result of the ``acceleration`` evaluator each entry of the right-hand side is; -1: zero."""
    fronts: Fronts | None = None
    """Compiled elimination by blocks, of a large system."""
    solve: StraightLine | FrontalSolver | None = None
    """Compiled: results of the ``acceleration`` evaluator -> accelerations and multipliers."""
    residual: Kernel | None = None
    """Compiled: these results and the solution -> how well it satisfies the system."""
    accelerate: StraightLine | FrontalSolver | None = None
    """Compiled: results of the ``acceleration`` evaluator -> accelerations."""
    project: StraightLine | FrontalSolver | None = None
    """Compiled: these results, then those of the ``drift`` evaluator -> what is too much of coordinates and velocities,
    by the least norm in the metric of the masses."""

    @cached_property
    def pattern(self) -> SparsePattern:
        """The same places, for sparse products and factorisations."""
        return SparsePattern(self.rows, self.columns, self.source, self.size)


def index1_system(model: Model, typical: Array | None) -> System:
    """Lay out the index-1 system of a model.

    Parameters
    ----------
    model : Model
        With its kept equations.
    typical : array, shape (S, result), or None
        Results of the ``acceleration`` evaluator for which the order of elimination is chosen; None: systems are solved
        by LAPACK.
    """
    index = model.evaluators["acceleration"].index
    n, kept = model.layout.coordinates, model.layout.kept
    number = np.full(model.layout.constraints, -1, dtype=np.int64)
    number[kept] = np.arange(len(kept))
    rows, columns, source = [], [], []
    if "mass" in index:
        results, (i, k) = index["mass"]
        rows, columns, source = [i], [k], [results]
    if "d" in index:
        results, (i, k) = index["d"]
        used = number[i] >= 0
        row = n + number[i][used]
        rows += [row, k[used]]
        columns += [k[used], row]
        source += [results[used], results[used]]
    none = np.zeros(0, dtype=np.int64)
    all_rows, all_columns = np.concatenate([none, *rows]), np.concatenate([none, *columns])
    order = np.lexsort((all_columns, all_rows))
    size = n + len(kept)
    system = System(
        all_rows[order],
        all_columns[order],
        np.concatenate([none, *source])[order],
        np.searchsorted(all_rows[order], np.arange(size)),
        size,
        None,
    )
    # a pattern that is singular for all values cannot be eliminated; what it lacks is told by its builder
    pattern = scipy.sparse.csr_array((np.ones(len(order)), (system.rows, system.columns)), shape=(size, size))
    if typical is None or scipy.sparse.csgraph.structural_rank(pattern) < size:
        return system
    if size > ELIMINATION_LIMIT:
        return _by_blocks(model, system, typical)
    matrix = np.zeros((len(typical), size, size))
    matrix[:, system.rows, system.columns] = typical[:, system.source]
    return _compiled(model, replace(system, elimination=plan(system.rows, system.columns, matrix)), typical)


def _compiled(model: Model, system: System, typical: Array) -> System:
    """Compile the solution of the system for the right-hand sides that occur: in one piece, if it is not too long."""
    assert system.elimination is not None
    given, n = len(model.evaluators["acceleration"].targets), model.layout.coordinates
    motion, excess = _rights(model, system.size)

    def code(rights: Index, values: int, wanted: int) -> StraightLine | None:
        order = system.elimination
        assert order is not None
        return straight_line(order, system.rows, system.columns, system.source, rights, values, wanted)

    solve = code(motion, given, system.size)
    if solve is None:
        return _by_blocks(model, system, typical)
    total = given + len(model.evaluators["drift"].targets)
    residual = residual_kernel(system.rows, system.columns, system.source, motion[0], given)
    return replace(
        system,
        motion=motion[0],
        solve=solve,
        residual=residual,
        accelerate=code(motion, given, n),
        project=code(excess, total, n),
    )


def _by_blocks(model: Model, system: System, typical: Array) -> System:
    """Compile the solution of a large system by kinds of blocks, if that can be."""
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
    motion, excess = _rights(model, system.size)
    return replace(
        system,
        motion=motion[0],
        fronts=fronts,
        solve=FrontalSolver(fronts, motion, system.size),
        accelerate=FrontalSolver(fronts, motion, n),
        project=FrontalSolver(fronts, excess, n),
    )


def _rights(model: Model, size: int) -> tuple[Index, Index]:
    """Which results are the right-hand sides of the motion, and of the projections of coordinates and velocities."""
    evaluators, layout = model.evaluators, model.layout
    given, drift = len(evaluators["acceleration"].targets), evaluators["drift"].index
    motion = np.full((1, size), -1, dtype=np.int64)
    for letter, first in (("force", 0), ("gamma", layout.coordinates)):
        _place(motion[0], evaluators["acceleration"].index.get(letter), first, layout, 0)
    excess = np.full((2, size), -1, dtype=np.int64)
    for side, letter in zip(excess, ("phi", "psi"), strict=True):
        _place(side, drift.get(letter), layout.coordinates, layout, given)
    return motion, excess


def _place(side: Index, found: tuple[Index, tuple[Index, ...]] | None, first: int, layout: Layout, offset: int) -> None:
    """Enter the results of an evaluator into a right-hand side; rows of dropped equations are left out."""
    if found is None:
        return
    results, (rows,) = found
    if first:  # a constraint
        number = np.full(layout.constraints, -1, dtype=np.int64)
        number[layout.kept] = np.arange(len(layout.kept))
        rows = number[rows]
    side[first + rows[rows >= 0]] = offset + results[rows >= 0]
