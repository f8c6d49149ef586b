"""Index-1 systems at the nodes of a projection, compiled or factorised, for any right-hand side."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from uqmbd.compiled import Kernel, NodalSystems, Operation, ProgramPart, ProgramWriter, cached, compile_operations
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.linear.index1 import DENSE_LIMIT, System
from uqmbd.dynamics.linear.unrolled import eliminated, is_compilable
from uqmbd.typing import Array, Index

__all__ = ["Nodal", "Outside", "nodal_systems", "write_solver"]

Outside = Callable[[Array, bool], None]
"""Function of work arrays (block of nodes, row, lane) that factorises new systems (true) or solves them (false)."""


@dataclass(frozen=True)
class Nodal:
    """Systems ``A x = b`` at arbitrary nodes."""

    systems: NodalSystems  # programs of the systems
    rated: Index  # auxiliary states with a rate
    library: Callable[[], Outside] | None  # returns a solver with separate factors; None if programs solve them

    @property
    def compiled(self) -> bool:
        """Whether the systems can be solved at low cost in every stage of an explicit step."""
        return self.library is None


def nodal_systems(model: Model) -> Nodal:
    """Write the systems at the nodes once for a model, with a compiled solution unless its code is too long."""
    known = {} if model.system.programs is None else model.system.programs.others
    if "nodal" not in known:
        known["nodal"] = _written(model, model.system)
    found: Nodal = known["nodal"]
    return found


def _written(model: Model, system: System) -> Nodal:
    layout, size = model.layout, system.size
    n, width = layout.coordinates, layout.width
    inputs = width + 2 + model.block_parameters
    writer, rows = ProgramWriter(inputs), np.arange(inputs)
    arguments, parameters = rows[: width + 2], rows[width + 2 :]
    ends = [0]

    def written(kind: str) -> Index:
        found = np.zeros(0, dtype=np.int64)
        if kind in model.evaluators:
            found = model.evaluators[kind].write(writer, arguments, parameters)
        ends.append(len(writer.steps))
        return found

    values, drift = written("acceleration"), written("drift")
    guess, right = writer.room(size), writer.room(size)
    library: Callable[[], Outside] | None = None
    if (written_solver := write_solver(system, writer, values, right)) is not None:
        solution, factored = written_solver
        ends.append(factored)
    else:
        ends.append(len(writer.steps))
        solution = writer.room(size)
        library = partial(_outside, system, values, right, solution)
    ends.append(len(writer.steps))
    parts = [ProgramPart(tuple(writer.steps[a:b]), writer.rows) for a, b in zip(ends, ends[1:], strict=False)]
    rates, rated = np.zeros((2, 0), dtype=np.int64)
    if "s" in model.evaluators["acceleration"].index:
        rates, (rated,) = model.evaluators["acceleration"].index["s"]
    systems = NodalSystems(
        width=width,
        coordinates=n,
        parameters=model.block_parameters,
        values=parts[0],
        drift=parts[1],
        factor=parts[2],
        solve=parts[3],
        rows=writer.size,
        right=int(right[0]) if size else 0,
        guess=int(guess[0]) if size else 0,
        solution=solution,
        starts=np.searchsorted(system.rows, np.arange(size + 1)),
        columns=system.columns,
        entries=values[system.source],
        motion=_taken(values, system.motion),
        constraints=_taken(drift, system.drift),
        rates=values[rates],
    )
    return Nodal(systems, rated, library)


def write_solver(system: System, writer: ProgramWriter, values: Index, right: Index) -> tuple[Index, int] | None:
    """Write the factorisation of ``acceleration`` results in rows `values`, then the solution for rows `right` (size,).

    Return the rows (size,) of the solution, and the number of steps before its program; None if the code is too long.
    """
    if system.fronts is not None:  # their program factorises and solves
        begin = len(writer.steps)
        return system.fronts.write(writer, values, right), begin
    factor, code = _factorised(system, len(values))
    if factor is None or code is None:
        return None
    factors = writer.call(factor, values[None]).ravel()  # directly after the right-hand side, to be read in place
    factored = len(writer.steps)
    return writer.call(code, np.concatenate([right, factors])[None]).ravel(), factored


def _taken(rows: Index, which: Index) -> Index:
    """Return the rows of the results with indices `which`; -1 for the index -1."""
    return np.where(which < 0, -1, rows[which] if len(rows) else -1)


def _factorised(system: System, given: int) -> tuple[Kernel | None, Kernel | None]:
    """Compile the factorisation of a system of `given` values, and the solution from a right-hand side and factors."""
    if system.elimination is None or not isinstance(system.solve, Kernel):
        return None, None
    size, entries = system.size, (system.rows, system.columns, system.source)
    rights = given + np.arange(size)[None, :]
    operations, solution = eliminated(system.elimination, *entries, rights, given + size, size)
    if not is_compilable(operations):
        return None, None

    first = given + size

    def make() -> tuple[Kernel, Kernel]:
        depends = [False] * given + [True] * size
        for kind, *operands in operations:
            depends.append(kind == "zero" or any(depends[x] for x in operands if x >= 0))
        early, late = ([k for k in range(len(operations)) if depends[first + k] is x] for x in (False, True))
        kept = sorted({x for k in late for x in operations[k][1:] if x >= 0 and not depends[x]})
        own, part = _renumbered(operations, early, first, list(range(given)))
        factor = compile_operations(part, range(given), [own[x] for x in kept], given)
        reads = [*range(given, first), *kept]
        own, part = _renumbered(operations, late, first, reads)
        return factor, compile_operations(part, range(len(reads)), [own[x] for x in solution], len(reads))

    key = ("factors of a system", given, *(x.tolist() for x in entries), system.elimination.steps)
    found: tuple[Kernel, Kernel] = cached(key, make)
    return found


def _renumbered(
    operations: list[Operation], which: list[int], first: int, reads: list[int]
) -> tuple[dict[int, int], list[Operation]]:
    """Extract the operations `which`; return the new index of each value, with `reads` first, and the operations.

    Operation k computes the value with index ``first + k``.
    """
    number = {x: k for k, x in enumerate(reads)} | {first + k: len(reads) + i for i, k in enumerate(which)}
    found: list[Operation] = []
    for k in which:
        kind, *operands = operations[k]
        a, b, c = (number[x] if x >= 0 else -1 for x in operands)
        found.append((kind, a, b, c))
    return number, found


def _outside(system: System, values: Index, right: Index, solution: Index) -> Outside:
    """Return a solver by a library; the arguments are rows of values, right-hand sides and solutions."""
    factorise = _by_superlu if system.size > DENSE_LIMIT else _by_lapack
    solve: list[Callable[[Array], Array]] = []

    def outside(work: Array, new: bool) -> None:  # noqa: FBT001 - as the driver calls it
        given = work[:, values if new else right].transpose(0, 2, 1)
        flat = given.reshape(-1, given.shape[2])
        if new:
            solve[:] = [factorise(system, flat)]
        else:
            work[:, solution] = solve[0](flat).reshape(given.shape).transpose(0, 2, 1)

    return outside


def _by_superlu(system: System, values: Array) -> Callable[[Array], Array]:
    """Factorise sparse matrices by SuperLU, for large mechanisms whose elimination cannot be compiled."""
    return system.pattern.factorise(values).solve


def _by_lapack(system: System, values: Array) -> Callable[[Array], Array]:
    """Invert dense matrices by LAPACK at the start of an integration, if the elimination is too long to compile."""
    matrix = system.matrix(values)
    # scale rows of light bodies, so that pivots of the factorisation compare similar numbers
    scale = np.abs(matrix).max(axis=2)
    scale = np.where(scale > 0, scale, 1.0)
    try:
        inverse = np.linalg.inv(matrix / scale[:, :, None]) / scale[:, None, :]
    except np.linalg.LinAlgError:
        inverse = np.full_like(matrix, np.nan)

    def solve(right: Array) -> Array:
        found = np.matmul(inverse, right[:, :, None])
        # one refinement, as an inverse is less accurate than a factorisation
        found += np.matmul(inverse, right[:, :, None] - np.matmul(matrix, found))
        return np.asarray(found[:, :, 0])

    return solve
