"""Compiled programs of a state: rates, accelerations, multipliers, and residuals of the constraints."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from uqmbd.compiled import Constraints, Dynamics, Kernel, Program, ProgramPart, ProgramWriter
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.linear.fronts import FrontalSolver
from uqmbd.dynamics.linear.residual import RowResiduals
from uqmbd.typing import Index, Mask

__all__ = ["MotionRows", "Programs", "Solver", "programs_of"]

SMALL = 300
"""Number of rows of the work array that increases the cost of a step by 1."""

Solver = Kernel | FrontalSolver
Residual = Kernel | RowResiduals


def _solution(solver: Solver, writer: ProgramWriter, given: Index) -> Index:
    """Write a solution for the `given` rows; return rows of the wanted unknowns."""
    if isinstance(solver, Kernel):
        return writer.call(solver, given[None]).ravel()
    return solver.write(writer, given)


@dataclass(frozen=True)
class Programs:
    """Programs whose arguments are a state (q, s, v), the time, the constant 0, and the parameters of the blocks."""

    dynamics: Dynamics  # equations of motion for the explicit integrator
    # returns accelerations, kept multipliers, rates of auxiliary states, and the residual of the index-1 system
    motion: Program
    excess: Program  # returns corrections of coordinates and velocities, of least norm in the metric of the masses
    solve: Solver  # maps results of the ``acceleration`` evaluator to accelerations and multipliers
    residual: Residual  # maps ``acceleration`` results and the solution to the residual of the system

    def __getstate__(self) -> dict[str, Any]:
        """Omit data that can be derived again."""
        return {key: value for key, value in self.__dict__.items() if key != "others"}

    @cached_property
    def others(self) -> dict[Any, Any]:
        """Further objects derived from the model, by key."""
        return {}

    def write_solution(self, writer: ProgramWriter, values: Index) -> Index:
        """Write accelerations and multipliers from rows of results of the ``acceleration`` evaluator."""
        return _solution(self.solve, writer, values)

    def write_motion(self, model: Model, writer: ProgramWriter, arguments: Index, parameters: Index) -> MotionRows:
        """Write the accelerations and multipliers of a state with the given rows, as `Evaluator.write` does."""
        values = model.evaluators["acceleration"].write(writer, arguments, parameters)
        return _motion(model, writer, values, self.solve, self.residual)


class MotionRows(NamedTuple):
    """Rows of the accelerations and multipliers, and of the residual of their system."""

    solution: Index
    residual: Index


def _motion(model: Model, writer: ProgramWriter, values: Index, solve: Solver, residual: Residual) -> MotionRows:
    solution = _solution(solve, writer, values)
    if isinstance(residual, RowResiduals):
        return MotionRows(solution, residual.write(writer, values, solution))
    return MotionRows(solution, writer.call(residual, np.concatenate([values, solution])[None, :]).ravel())


def _turning(model: Model) -> Index:
    """Return the coordinates (body, 2 or 4) of the quaternions of rotating bodies that are not in a loop.

    Constraints of a tree are independent in every pose. Constraints of a loop are dependent in singular poses. An
    integration passes these poses only if its steps violate the constraints little. In a loop, the
    integrator therefore treats quaternions as ordinary coordinates. Outside of loops, it integrates angular velocities.
    """
    found = model.quaternions()
    if not found.size:
        return found[:0]
    norms, joined = set(model.norms.tolist()), dict[str, set[int]]()
    for _, row, column in (x for x in model.evaluators["velocity"].targets if x[0] == "d"):
        if row not in norms and column < model.of_bodies:
            joined.setdefault(model.owners[row], set()).add(column // model.size)
    # only bodies are nodes of this graph, not components: a constraint on one body joins it to the ground
    tree = bodies_in_no_loop(len(model.bodies), [b | ({-1} if len(b) == 1 else set()) for b in joined.values()])
    return found[tree & ~np.isin(found, model.layout.frozen).all(axis=1)]


def bodies_in_no_loop(bodies: int, links: list[set[int]]) -> Mask:
    """Return a mask (bodies,) of bodies that are neither in a loop of links nor between loops and the ground (-1).

    The search removes bodies with at most one link until none remains. It never removes a body at a link of three
    bodies.
    """
    at: list[set[int]] = [set() for _ in range(bodies)]
    for number, link in enumerate(links):
        for body in link - {-1}:
            at[body].add(number)
    tree = np.zeros(bodies, dtype=bool)
    ends = [k for k in range(bodies) if len(at[k]) < 2]
    while ends:
        body = ends.pop()
        if tree[body] or any(len(links[k]) != 2 for k in at[body]):
            continue
        tree[body] = True
        for number in at[body]:  # at most one link
            for other in links[number] - {body, -1}:
                at[other].discard(number)
                if len(at[other]) < 2:
                    ends.append(other)
    return tree


def programs_of(
    model: Model, solve: Solver, accelerate: Solver, back: tuple[Solver, Solver], residual: Residual
) -> Programs:
    """Return the programs of a model.

    `solve` maps results of the ``acceleration`` evaluator to accelerations and multipliers, `accelerate` to
    accelerations only.  `back` maps the results of the ``acceleration`` and then the ``drift`` evaluator to corrections
    of coordinates and of velocities.  `residual` maps ``acceleration`` results and the solution to the residual.
    """
    layout = model.layout
    n, width, velocities = layout.coordinates, layout.width, layout.velocities
    inputs = width + 2 + model.block_parameters
    rows = np.arange(inputs)
    arguments, parameters = rows[: width + 2], rows[width + 2 :]
    acceleration = model.evaluators["acceleration"]

    def begun() -> tuple[ProgramWriter, Index, Index]:
        writer = ProgramWriter(inputs)
        values = acceleration.write(writer, arguments, parameters)
        rates = np.full(layout.states, width + 1)  # row with the value zero
        if "s" in acceleration.index:
            results, (which,) = acceleration.index["s"]
            rates[which] = values[results]
        return writer, values, rates

    def surplus(writer: ProgramWriter, values: Index) -> tuple[Index, Index, list[int]]:
        """Write residuals and corrections; return rows of both, and the boundaries of their steps."""
        ends = [len(writer.steps)]
        drift = model.evaluators["drift"].write(writer, arguments, parameters)
        found = []
        for solver in back:
            ends.append(len(writer.steps))
            found.append(_solution(solver, writer, np.concatenate([values, drift])))
        ends.append(len(writer.steps))
        return drift, np.concatenate(found), ends

    writer, values, rates = begun()
    found = _motion(model, writer, values, solve, residual)
    motion = writer.program(np.concatenate([found.solution, rates, found.residual]))
    writer, values, rates = begun()
    begin = len(writer.steps)
    # write the residuals directly after the values, so that the solvers read both without a copy
    drift, too_much, ends = surplus(writer, values) if layout.rank else (values[:0], values[:0], [begin])
    accelerations = _solution(accelerate, writer, values)
    before, after = writer.part(0, begin), writer.part(ends[-1])
    constraints = None
    if layout.rank:
        index = model.evaluators["drift"].index
        position, velocity = (drift[index[x][0]] if x in index else drift[:0] for x in ("phi", "psi"))
        residuals, place, move = itertools.starmap(writer.part, itertools.pairwise(ends))
        constraints = Constraints(
            values=before,
            drift=residuals,
            place=place,
            move=move,
            residuals=np.concatenate([position, velocity]),
            positions=len(position),
            surplus=too_much,
        )
    turns = _turning(model)
    dynamics = Dynamics(
        coordinates=n,
        velocities=velocities,
        width=width,
        parameters=model.block_parameters,
        motion=ProgramPart(before.steps + after.steps, writer.rows),
        rate=np.concatenate([rows[velocities:width], rates, accelerations]),
        constraints=constraints,
        rows=writer.size,
        moving=width - 2 * len(layout.frozen) - layout.held - len(turns),
        turns=turns,
        cost=1 + writer.size // SMALL,
    )
    writer = ProgramWriter(inputs)
    values = acceleration.write(writer, arguments, parameters)
    found_excess = surplus(writer, values)[1] if layout.rank else writer.sums([[]]).repeat(2 * n)
    return Programs(dynamics, motion, writer.program(found_excess), solve, residual)
