"""Position and velocity equations in the form for the driver: sparse, with tables of indices."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from uqmbd.compiled import EquationPrograms, Gradients, ProgramWriter, RotationCoordinates
from uqmbd.dynamics.equations import Model, Statement
from uqmbd.typing import Array, Index, Mask

__all__ = ["BODY_RATE", "closed_poses", "equation_programs", "least_velocities"]

FLAT = 1e-9, 1e-12
"""Lengths of gradients, of positions and of velocities, that count as zero."""

BODY_RATE = {
    2: (((1, -1), (0, 1)),),
    4: (((1, -1), (0, 1), (3, 1), (2, -1)), ((2, -1), (3, -1), (0, 1), (1, 1)), ((3, -1), (2, 1), (1, -1), (0, 1))),
}
"""Matrix ``G(e)``, half the matrix from quaternion rates to the angular velocity in body axes, by the length of the
quaternion. Each entry of the matrix is an entry of the quaternion, given by its index, with a sign."""


class _Closing(NamedTuple):
    equations: EquationPrograms
    turns: RotationCoordinates
    cosines: Index


def closed_poses(model: Model, drawn: Array, time: float, parameters: Array, rows: Index) -> tuple[Array, Mask]:
    """Close all constraints, with independent `rows`, by the least change of given poses (K, coordinate).

    Return poses, and a mask (K,) of undecided realisations, for example with singular equations or a mirror image.
    """
    known, key = model.evaluators["position"].others, ("closing", rows.tobytes(), model.held.tobytes())
    if key not in known:
        known[key] = _closing(model, rows)
    found: _Closing = known[key]
    return found.equations.close(
        found.turns, found.cosines, drawn, *_rest(model, 1, time, parameters), count=len(drawn)
    )


def least_velocities(model: Model, q: Array, s: Array, time: float, parameters: Array) -> tuple[Array, Mask]:
    """Return velocities (K, coordinate) of least norm that satisfy constraints, statements and start conditions.

    The second result is a mask (K,) of realisations with nearly dependent or contradictory equations.
    """
    statements = tuple((x.quantity, tuple(x.coordinates.tolist())) for x in model.statements)
    values, slopes = _conditions(model, q, s, time, parameters)
    conditions = values.shape[1]
    known, key = model.evaluators["velocity"].others, ("speeds", model.layout.kept.tobytes(), statements, conditions)
    if key not in known:
        known[key] = _speeds(model, conditions)
    found: EquationPrograms = known[key]
    numbers = np.concatenate([x.parameters for x in model.statements] or [np.zeros(0, dtype=np.int64)])
    more = (-parameters[:, numbers], values, slopes, np.ones((1, 1)))
    return found.least(q, s, *_rest(model, 2, time, parameters), *more, count=len(q))


def equation_programs(model: Model) -> tuple[Any, EquationPrograms]:
    """Return the equations of poses (`equations`, `turns`, `cosines`), and those of velocities without conditions."""
    return _closing(model, model.layout.independent_holonomic), _speeds(model, 0)


def _conditions(model: Model, q: Array, s: Array, time: float, parameters: Array) -> tuple[Array, Array]:
    """Return residuals of the conditions of velocities (K, c), and their slopes (K, c n)."""
    if model.conditions is None or not len(model.conditions.velocities):
        return np.zeros((len(q), 0)), np.zeros((len(q), 0))
    which = model.conditions.velocities
    value, _, slope = model.conditions(q, s, time, parameters)
    return value[:, which], slope[:, which].reshape(len(q), -1)


def _rest(model: Model, given: int, time: float, parameters: Array) -> tuple[Array, Array, Array]:
    """Return the arguments at rest that follow coordinates (`given` 1), or coordinates and auxiliary states (2)."""
    layout = model.layout
    zeros = layout.width - (layout.coordinates if given == 1 else layout.velocities)
    return np.zeros((1, zeros)), np.array([[time, 0.0]]), parameters[:, : model.block_parameters]


def _closing(model: Model, rows: Index) -> _Closing:
    evaluator, layout = model.evaluators["position"], model.layout
    writer, arguments, parameters = _begun(model, 0)
    results = evaluator.write(writer, arguments, parameters)
    cosines = np.zeros(0, dtype=np.int64)
    if "cos" in evaluator.index:
        cosines = results[evaluator.index["cos"][0]]
    gradients = _gradients(evaluator.index, "phi_q", results)
    held = np.isin(gradients.columns, model.held)
    gradients = gradients._replace(columns=np.where(held, -1, gradients.columns))
    equations = EquationPrograms(
        program=writer.program(np.zeros(0, dtype=np.int64)),
        values=_values(evaluator.index, "phi", results, layout.constraints),
        gradients=gradients,
        solved=rows,
        certain=len(rows),
        unknowns=layout.coordinates,
        shortest=FLAT[0],
    )
    quaternions = model.quaternions()
    free = np.array([not np.isin(x, model.held).any() for x in quaternions], dtype=np.int64)
    return _Closing(equations, RotationCoordinates(quaternions, free, model.dimension), cosines)


def _speeds(model: Model, conditions: int) -> EquationPrograms:
    evaluator, layout = model.evaluators["velocity"], model.layout
    stated, n = sum(len(x.parameters) for x in model.statements), layout.coordinates
    added = stated + conditions
    writer, arguments, parameters = _begun(model, added + conditions * n + 1)
    given = np.arange(len(arguments) + len(parameters), writer.inputs)  # given velocities, residuals, slopes, and 1
    results = evaluator.write(writer, arguments, parameters)
    gradients = _gradients(evaluator.index, "d", results)
    values, kept = _values(evaluator.index, "phi_t", results, layout.constraints), layout.kept
    if not added:  # evaluate redundant equations if a start condition may contradict them
        gradients = gradients._replace(rows=layout.number[gradients.rows]).select(layout.number[gradients.rows] >= 0)
        values, kept = values[kept], np.arange(layout.rank)
    lines = [line for x in model.statements for line in _lines(x, int(given[-1]))]
    slopes = given[added:-1].reshape(conditions, n)
    lines += [[(int(place), 1.0, k) for k, place in enumerate(line)] for line in slopes]
    rows = np.repeat(np.arange(len(lines)), [len(line) for line in lines]) + len(values)
    places, factors, columns = np.array([x for line in lines for x in line], dtype=float).reshape(-1, 3).T
    more = Gradients(rows, columns.astype(np.int64), places.astype(np.int64), factors)
    return EquationPrograms(
        program=writer.program(np.zeros(0, dtype=np.int64)),
        values=np.concatenate([values, given[:added]]),
        gradients=gradients.joined(more),
        solved=np.concatenate([kept, np.arange(len(values), len(values) + added)]),
        certain=layout.rank,
        unknowns=n,
        shortest=FLAT[1],
    )


def _lines(statement: Statement, one: int) -> list[list[tuple[int, float, int]]]:
    """Return the gradients of a statement on a body: rows of values, factors, and velocities.

    Row `one` contains the number one.
    """
    coordinates = statement.coordinates.tolist()
    if statement.quantity == "velocity":
        return [[(one, 1.0, k)] for k in coordinates]
    return [
        [(coordinates[k], 2.0 * sign, coordinates[i]) for i, (k, sign) in enumerate(line)]
        for line in BODY_RATE[len(coordinates)]
    ]


def _begun(model: Model, more: int) -> tuple[ProgramWriter, Index, Index]:
    """Begin a program; return it with rows of state, time, zero and block parameters, before `more` inputs."""
    state, inputs = model.layout.width + 2, model.layout.width + 2 + model.block_parameters
    rows = np.arange(inputs)
    return ProgramWriter(inputs + more), rows[:state], rows[state:]


def _values(index: dict[str, tuple[Index, tuple[Index, ...]]], name: str, results: Index, count: int) -> Index:
    found = np.full(count, -1, dtype=np.int64)
    if name in index:
        columns, (rows,) = index[name]
        found[rows] = results[columns]
    return found


def _gradients(index: dict[str, tuple[Index, tuple[Index, ...]]], name: str, results: Index) -> Gradients:
    none = np.zeros(0, dtype=np.int64)
    entries, (rows, columns) = index.get(name, (none, (none, none)))
    return Gradients(rows, columns, results[entries], np.ones(len(entries)))
