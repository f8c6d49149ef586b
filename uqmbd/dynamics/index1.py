"""The index-1 system: accelerations, multipliers and everything else that a state determines."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from uqmbd.dynamics.elimination import Elimination, plan
from uqmbd.dynamics.evaluator import Evaluator
from uqmbd.dynamics.kernels import Kernel
from uqmbd.dynamics.model import Layout, Model
from uqmbd.dynamics.straightline import StraightLine, residual_kernel, straight_line

__all__ = [
    "RANK_TOLERANCE",
    "System",
    "accelerations",
    "dense",
    "excess",
    "index1_system",
    "massless_direction",
    "state_arguments",
]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

FEW = 24
"""Systems up to which LAPACK is faster than operations on short vectors."""

ELIMINATION_LIMIT = 160
"""Unknowns of the index-1 system up to which a fixed order of elimination is planned."""

RESIDUAL = 1e-10
"""Relative residual above which a solution by fixed pivots is poor."""

RANK_TOLERANCE = 1e-8
"""Relative size below which a singular value of the constraint Jacobian counts as zero."""


def dense(model: Model, kind: str, arguments: Array, parameters: Array) -> dict[str, Array]:
    """Results of an evaluator as dense arrays by name."""
    e = model.evaluators[kind]
    values = e(arguments, parameters)
    n, m, k = model.layout.coordinates, model.layout.constraints, model.layout.states
    shapes = {
        "phi": (m,),
        "phi_q": (m, n),
        "cos": (len(model.cosines),),
        "phi_t": (m,),
        "d": (m, n),
        "mass": (n, n),
        "force": (n,),
        "gamma": (m,),
        "s": (k,),
        "energy": (2,),
    }
    wanted = {
        "position": ("phi", "phi_q", "cos"),
        "velocity": ("phi_t", "d"),
        "initial": ("s",),
        "acceleration": ("mass", "force", "d", "gamma", "s"),
        "energy": ("energy",),
    }[kind]
    result: dict[str, Array] = {}
    for name in wanted:
        array: Any = np.zeros((len(values), *shapes[name]))
        if name in e.index:
            columns, where = e.index[name]
            array[(slice(None), *where)] = values[:, columns]
        result[name] = array
    return result


def state_arguments(q: Array, s: Array, v: Array, time: Array | float) -> Array:
    """Arguments of the state kinds: ``(q, s, v, t, 0)``, shape (K, ...)."""
    t = np.broadcast_to(np.asarray(time, dtype=float), (len(q),))[:, None]
    return np.concatenate([q, s, v, t, np.zeros_like(t)], axis=1)


def accelerations(
    model: Model, q: Array, s: Array, v: Array, time: Array | float, parameters: Array
) -> tuple[Array, Array, Array]:
    """Solve the index-1 system ``[M D^T; D 0] [a; lambda] = [Q - h; gamma]``.

    Parameters
    ----------
    model : Model
        With its ``acceleration`` evaluator.
    q, s, v : array, shape (K, ...)
        Consistent states.
    time : array, shape (K,), or float
        Times.
    parameters : array, shape (K, parameter)
        Of each state.

    Returns
    -------
    a, multipliers, rates : array, shape (K, ...)
        Accelerations, multipliers of the kept equations, and rates of the auxiliary states; NaN where the system is
        singular.
    """
    evaluator = model.evaluators["acceleration"]
    values = evaluator(state_arguments(q, s, v, time), parameters)
    rates = _columns(evaluator, values, "s", model.layout.states)
    a, multipliers = _solve(model, values)
    return a, multipliers, rates


def excess(model: Model, states: Array, time: Array, parameters: Array) -> tuple[Array, Array]:
    """By what states exceed the constraints: the least changes of coordinates and velocities that put them right.

    Parameters
    ----------
    model : Model
        Its index-1 system must be compiled.
    states : array, shape (S, 2 coordinate + state)
        Near the constraints.
    time : array, shape (S,)
        s.
    parameters : array, shape (S, parameter)
        Of each state.

    Returns
    -------
    q, v : array, shape (S, coordinate)
        To be subtracted; the norm is that of the masses, and the error quadratic in the excess.
    """
    arguments = np.concatenate([states, time[:, None], np.zeros((len(states), 1))], axis=1)
    values = [model.evaluators[kind](arguments, parameters) for kind in ("acceleration", "drift")]
    both = model.system.project(np.concatenate(values, axis=1))
    n = model.layout.coordinates
    return both[:, :n], both[:, n:]


def _columns(evaluator: Evaluator, values: Array, letter: str, count: int) -> Array:
    result = np.zeros((len(values), count))
    if letter in evaluator.index:
        columns, (where,) = evaluator.index[letter]
        result[:, where] = values[:, columns]
    return result


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
    solve: StraightLine | None = None
    """Compiled: results of the ``acceleration`` evaluator -> accelerations and multipliers."""
    residual: Kernel | None = None
    """Compiled: these results and the solution -> how well it satisfies the system."""
    accelerate: StraightLine | None = None
    """Compiled: results of the ``acceleration`` evaluator -> accelerations."""
    project: StraightLine | None = None
    """Compiled: these results, then those of the ``drift`` evaluator -> what is too much of coordinates and velocities,
    by the least norm in the metric of the masses."""


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
    all_rows, all_columns = np.concatenate(rows), np.concatenate(columns)
    order = np.lexsort((all_columns, all_rows))
    size = n + len(kept)
    system = System(
        all_rows[order],
        all_columns[order],
        np.concatenate(source)[order],
        np.searchsorted(all_rows[order], np.arange(size)),
        size,
        None,
    )
    # a row without entries would break the sums over rows; such a system is singular anyhow
    if typical is None or size > ELIMINATION_LIMIT or len(np.unique(system.rows)) < size:
        return system
    matrix = np.zeros((len(typical), size, size))
    matrix[:, system.rows, system.columns] = typical[:, system.source]
    return _compiled(model, replace(system, elimination=plan(system.rows, system.columns, matrix)))


def _compiled(model: Model, system: System) -> System:
    """Compile the solution of the system for the right-hand sides that occur, if it is not too long."""
    assert system.elimination is not None
    evaluators, layout = model.evaluators, model.layout
    given, drift = len(evaluators["acceleration"].targets), evaluators["drift"].index
    motion = np.full((1, system.size), -1, dtype=np.int64)
    for letter, first in (("force", 0), ("gamma", layout.coordinates)):
        _place(motion[0], evaluators["acceleration"].index.get(letter), first, layout, 0)
    excess = np.full((2, system.size), -1, dtype=np.int64)
    for side, letter in zip(excess, ("phi", "psi"), strict=True):
        _place(side, drift.get(letter), layout.coordinates, layout, given)

    def code(rights: Index, values: int, wanted: int) -> StraightLine | None:
        order = system.elimination
        assert order is not None
        return straight_line(order, system.rows, system.columns, system.source, rights, values, wanted)

    solve = code(motion, given, system.size)
    if solve is None:
        return system
    n = layout.coordinates
    total = given + len(evaluators["drift"].targets)
    residual = residual_kernel(system.rows, system.columns, system.source, motion[0], given)
    return replace(
        system,
        motion=motion[0],
        solve=solve,
        residual=residual,
        accelerate=code(motion, given, n),
        project=code(excess, total, n),
    )


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


def _solve(model: Model, values: Array) -> tuple[Array, Array]:
    """Solve the index-1 systems whose entries are results of the ``acceleration`` evaluator."""
    layout = model.layout
    system = model.system or index1_system(model, None)
    n = layout.coordinates
    if system.solve is not None and system.residual is not None:
        values = np.ascontiguousarray(values)
        found = system.solve(values)
        with np.errstate(all="ignore"):
            residual = system.residual.fast(np.concatenate([values, found], axis=1))[:, 0]
        poor = np.flatnonzero(~(residual <= RESIDUAL**2))
        if len(poor):
            found[poor] = _lapack(system, *_system(model, system, values[poor])).T
        return found[:, :n], found[:, n:]
    entries, right = _system(model, system, values)
    if system.elimination is None or len(values) < FEW:
        solution = _lapack(system, entries, right)
    else:
        where = system.elimination.slots[system.rows, system.columns]
        solution = system.elimination.solve(entries, where, right.copy())
        poor = np.flatnonzero(~_accurate(system, entries, right, solution))
        if len(poor):
            solution[:, poor] = _lapack(system, entries[:, poor], right[:, poor])
    return solution[:n].T, solution[n:].T


def _system(model: Model, system: System, values: Array) -> tuple[Array, Array]:
    """Entries and right-hand sides of the systems, shape (nnz, K) and (size, K)."""
    evaluator, layout = model.evaluators["acceleration"], model.layout
    n = layout.coordinates
    right = np.zeros((system.size, len(values)))
    right[:n] = _columns(evaluator, values, "force", n).T
    right[n:] = _columns(evaluator, values, "gamma", layout.constraints)[:, layout.kept].T
    return np.ascontiguousarray(values.T[system.source]), right


def _accurate(system: System, entries: Array, right: Array, solution: Array) -> NDArray[np.bool_]:
    """Whether each solution satisfies its system to rounding."""
    with np.errstate(all="ignore"):
        product = entries * solution[system.columns]
        residual = np.abs(np.add.reduceat(product, system.starts, axis=0) - right)
        size = np.add.reduceat(np.abs(product), system.starts, axis=0) + np.abs(right)
        good: NDArray[np.bool_] = np.asarray((residual <= RESIDUAL * size + 1e-300).all(axis=0))
    return good


def _lapack(system: System, entries: Array, right: Array) -> Array:
    """Solve each system by LAPACK; NaN where it is singular."""
    matrix = np.zeros((entries.shape[1], system.size, system.size))
    matrix[:, system.rows, system.columns] = entries.T
    # rows of light bodies are scaled up: the pivots of the factorisation see comparable numbers
    scale = np.abs(matrix).max(axis=2)
    scale = np.where(scale > 0, scale, 1.0)
    matrix, vector = matrix / scale[:, :, None], (right.T / scale)[:, :, None]
    solution = np.full(right.T.shape, np.nan)
    try:
        solution[:] = np.linalg.solve(matrix, vector)[:, :, 0]
    except np.linalg.LinAlgError:  # one of them is singular: the others must not suffer
        for k in range(len(matrix)):
            with contextlib.suppress(np.linalg.LinAlgError):
                solution[k] = np.linalg.solve(matrix[k], vector[k])[:, 0]
    return solution.T


def massless_direction(model: Model, q: Array, s: Array, time: float, parameters: Array) -> str:
    """Name a body that could be accelerated without any force, or nothing: one realisation."""
    found = dense(model, "acceleration", state_arguments(q, s, np.zeros_like(q), time), parameters)
    null = scipy.linalg.null_space(found["d"][0], rcond=RANK_TOLERANCE)
    if not null.shape[1]:
        return ""
    # compare a translation with a rotation through the size of the coordinates: only zero counts
    reduced = null.T @ found["mass"][0] @ null
    values, vectors = np.linalg.eigh(reduced)
    if values[0] > 1e-13 * max(values[-1], 1e-300):
        return ""
    share = np.abs(null @ vectors[:, 0])
    return model.bodies[int(np.argmax(share)) // model.size]
