"""Equations of implicit steps: derivatives of the index-1 form, and an order of elimination for their systems."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from uqmbd.compiled import ContactEntries, Dynamics, ImplicitEquations, ProgramWriter, compile_kernel
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.linear.elimination import plan
from uqmbd.dynamics.linear.index1 import solve_directly
from uqmbd.dynamics.linear.system import System
from uqmbd.typing import Array, Index

__all__ = ["IMPLICIT_LIMIT", "RADAU_STAGES", "implicit_dynamics"]

RADAU_STAGES = 5
"""Number of stages of implicit steps: the method has the order 9."""

IMPLICIT_LIMIT = 400
"""Largest number of unknowns of a system of implicit steps; the elimination order of larger systems takes seconds."""

RATES = (1e1, 1e3, 1e5)
"""Eigenvalues of the method divided by step sizes, 1/s, for which the order of elimination is chosen."""

UNEVEN = 2.0**10
"""Ratio, or inverse ratio, of the masses to the derivatives of a constraint, above which the constraint is scaled."""

Entry = tuple[int, int]


def implicit_dynamics(model: Model, stages: int = RADAU_STAGES) -> Dynamics | None:
    """Return the cached equations of implicit steps; None if they are too large or not compiled."""
    system: System | None = model.system
    if system is None or system.programs is None or system.poses is None:
        return None
    if system.size + model.layout.states > IMPLICIT_LIMIT:
        return None
    others, key = system.programs.others, ("implicit", stages)
    if key not in others:
        others[key] = _written(model, system, stages)
    found: Dynamics = others[key]
    return found


def _written(model: Model, system: System, stages: int) -> Dynamics:
    assert system.programs is not None
    layout, dynamics = model.layout, system.programs.dynamics
    n, width, zero = layout.coordinates, layout.width, layout.width + 1
    inputs = width + 2 + dynamics.parameters
    writer, rows = ProgramWriter(inputs), np.arange(inputs)
    arguments, parameters = rows[: width + 2], rows[width + 2 :]
    values = model.evaluators["acceleration"].write(writer, arguments, parameters)
    solution = system.programs.write_solution(writer, values)
    end = len(writer.steps)
    rates = np.full(layout.states, zero)
    index = model.evaluators["acceleration"].index
    if "s" in index:
        results, (which,) = index["s"]
        rates[which] = values[results]
    multipliers = np.full(layout.constraints, zero)
    multipliers[layout.kept] = solution[n:]
    given = np.concatenate([arguments[:width], multipliers, solution[:n], [width, zero]])
    derivatives = model.evaluators["tangent"].write(writer, given, parameters)
    inertia, plain, stiffness = _placed(model, values, derivatives)
    scales = _constraint_scales(model, system)
    summed = [_scaled(writer, _summed(writer, part), scales) for part in (inertia, plain, stiffness)]
    contacts = _ContactUnknowns.of(model, system.size + layout.states)
    one = {(n + k, n + k): -1 for k in range(layout.states)}
    moving = summed[0].keys() | one | contacts.equations
    entries = sorted(moving) + sorted(set().union(*summed[1:], contacts.entries) - moving)
    order = _EliminationTables(entries, _typical(model, system, contacts, scales))
    table = [np.array([part.get(e, zero) for e in entries], dtype=np.int64) for part in (summed[0] | one, *summed[1:])]
    implicit = ImplicitEquations(
        stages=stages,
        multipliers=system.size - n,
        motion=writer.part(0, end),
        solution=np.ascontiguousarray(solution, dtype=np.int64),
        gradients=writer.part(end),
        rate=np.concatenate([rows[layout.velocities : width], rates, solution[:n]]).astype(np.int64),
        states=layout.states,
        size=system.size + layout.states + contacts.directions,
        entries=len(order.numbers),
        moving=len(moving),
        rows=np.array([i for i, _ in entries], dtype=np.int64),
        columns=np.array([j for _, j in entries], dtype=np.int64),
        inertia=table[0],
        plain=table[1],
        stiffness=table[2],
        contacts=contacts.placed(entries),
        **order.tables,
    )
    return replace(
        dynamics,
        rows=max(dynamics.rows, writer.size),
        moving=dynamics.moving + len(dynamics.turns),
        turns=np.zeros((0, 0), dtype=np.int64),
        implicit=implicit,
    )


@dataclass(frozen=True)
class _ContactUnknowns:
    """Structure of the entries of persistent contacts; their unknowns follow all others."""

    directions: int
    coordinates: int
    first: int  # number of the first unknown
    used: Array  # (direction, coordinate): typical derivatives of the speeds, with friction; zero where there are none

    @classmethod
    def of(cls, model: Model, first: int) -> _ContactUnknowns:
        """Return the structure for a model, from the derivatives of the speeds of its contacts."""
        ends = np.cumsum([0, *(count for *_, count in model.events)])
        used = np.zeros((int(ends[-1]), model.layout.coordinates))
        if len(used):
            _, places = model.evaluators["contact"].index["slope"]
            used[places] = 1.0
        random = np.random.default_rng(0)
        # because of friction, all directions of a contact act on the same coordinates
        for begin, end in itertools.pairwise(ends.tolist()):
            used[begin:end] = used[begin:end].any(axis=0) * random.uniform(0.5, 1.0, used[begin:end].shape)
        return cls(len(used), model.layout.coordinates, first, used)

    @property
    def equations(self) -> set[Entry]:
        """Entries of the equations."""
        return {(self.first + d, i) for d, i in np.argwhere(self.used != 0).tolist()}

    @property
    def entries(self) -> set[Entry]:
        """Entries of the equations, of the forces, and on the diagonal."""
        along = self.equations
        return along | {(i, d) for d, i in along} | {(self.first + d,) * 2 for d in range(self.directions)}

    def placed(self, entries: list[Entry]) -> ContactEntries | None:
        """Return the numbers of the entries among all given entries; None without contacts."""
        if not self.directions:
            return None
        numbers = {entry: k for k, entry in enumerate(entries)}
        shape = (self.directions, self.coordinates)
        pairs = [(self.first + d, i) for d in range(self.directions) for i in range(self.coordinates)]
        return ContactEntries(
            np.array([numbers.get(pair, -1) for pair in pairs], dtype=np.int64).reshape(shape),
            np.array([numbers.get((i, d), -1) for d, i in pairs], dtype=np.int64).reshape(shape),
            np.array([numbers[self.first + d, self.first + d] for d in range(self.directions)], dtype=np.int64),
        )

    def bordered(self, matrix: Array, eta: float) -> Array:
        """Return systems with open contacts, and the same systems with persistent contacts."""
        count, size = len(matrix), self.first + self.directions
        both = np.zeros((2 * count, size, size))
        both[:count, : self.first, : self.first] = both[count:, : self.first, : self.first] = matrix
        own = np.arange(self.first, size)
        both[:count, own, own] = 1.0
        both[count:, self.first :, : self.coordinates] = eta * self.used
        both[count:, : self.coordinates, self.first :] = -self.used.T
        both[count:, own, own] = -1e-12
        return both


def _placed(model: Model, values: Index, derivatives: Index) -> tuple[dict[Entry, list[int]], ...]:
    """Return terms of the entries of the systems that are multiplied by eta, added, and divided by eta.

    `values` and `derivatives` are numbers of the results of the ``acceleration`` and ``tangent`` evaluators. The
    unknowns are velocities, auxiliary states and multipliers.
    """
    layout = model.layout
    n, states = layout.coordinates, layout.states
    equations = np.where(layout.number < 0, -1, n + states + layout.number)
    inertia, plain, stiffness = dict[Entry, list[int]](), dict[Entry, list[int]](), dict[Entry, list[int]]()

    def add(part: dict[Entry, list[int]], rows: Index, columns: Index, numbers: Index) -> None:
        for i, j, k in zip(rows.tolist(), columns.tolist(), numbers.tolist(), strict=True):
            if i >= 0 and j >= 0:
                part.setdefault((i, j), []).append(k)

    index = model.evaluators["acceleration"].index
    if "mass" in index:
        results, (i, k) = index["mass"]
        add(inertia, i, k, values[results])
    if "d" in index:
        results, (i, k) = index["d"]
        add(inertia, equations[i], k, values[results])
        add(plain, k, equations[i], values[results])
    for name, (results, (i, k)) in model.evaluators["tangent"].index.items():
        row = {"v": i, "d": equations[i] if name[0] == "d" else i, "s": n + i}[name[0]]
        column = k if name[2] in "qv" else n + k
        add(stiffness if name[2] == "q" else plain, row, column, derivatives[results])
    for number in range(n, n + states):
        plain.setdefault((number, number), [])
    return inertia, plain, stiffness


def _summed(writer: ProgramWriter, part: dict[Entry, list[int]]) -> dict[Entry, int]:
    """Return a row for each entry; entries of several terms are added up."""
    several = [entry for entry, terms in part.items() if len(terms) != 1]
    found = {entry: terms[0] for entry, terms in part.items() if len(terms) == 1}
    return found | dict(zip(several, writer.sums([part[e] for e in several]).tolist(), strict=True))


def _constraint_scales(model: Model, system: System) -> Array:
    """Return factors (unknown,) on the rows and columns of the systems: powers of two for constraints, otherwise 1.

    A pivot that vanishes is replaced by a small part of its row (radau.c). Next to an inertia of 1e9, this part would
    be as large as the derivatives of the constraints. The factors make them as large as the masses of their
    coordinates, by a geometric mean.
    """
    assert system.poses is not None
    n, states = model.layout.coordinates, model.layout.states
    matrices = np.abs(system.matrix(model.evaluators["acceleration"](*system.poses)))
    matrix = np.nan_to_num(matrices, posinf=0.0).max(axis=0)
    masses, scales = matrix[:n, :n].max(axis=1, initial=0.0), np.ones(system.size + states)
    for k in range(n, system.size):
        row = matrix[k, :n]
        used = (row > 0.1 * row.max(initial=0.0)) & (masses > 0)
        ratio = np.exp(np.log(masses[used] / row[used]).mean()) if used.any() else 1.0
        if not 1 / UNEVEN <= ratio <= UNEVEN:
            scales[states + k] = 2.0 ** np.round(np.log2(ratio))
    return scales


def _scaled(writer: ProgramWriter, part: dict[Entry, int], scales: Array) -> dict[Entry, int]:
    """Return the rows of entries, after multiplication by the factors of their row and column."""
    import symengine as se

    groups: dict[float, list[Entry]] = {}
    for i, j in part:
        if (factor := float(scales[i] * scales[j])) != 1.0:
            groups.setdefault(factor, []).append((i, j))
    found, x = dict(part), se.Symbol("x")
    for factor, entries in groups.items():
        reads = np.array([[part[entry]] for entry in entries], dtype=np.int64)
        rows = writer.call(compile_kernel([x], [factor * x]), reads)
        found |= dict(zip(entries, rows[:, 0].tolist(), strict=True))
    return found


def _typical(model: Model, system: System, contacts: _ContactUnknowns, scales: Array) -> Array:
    """Return dense systems at typical poses for short and long steps."""
    assert system.poses is not None
    layout, (arguments, parameters) = model.layout, system.poses
    n, states = layout.coordinates, layout.states
    values = model.evaluators["acceleration"](arguments, parameters)
    solution = solve_directly(system, values, system.right(values))
    multipliers = np.zeros((len(values), layout.constraints))
    multipliers[:, layout.kept] = solution[:, n:]
    tangent = model.evaluators["tangent"]
    given = np.concatenate([arguments[:, :-2], multipliers, solution[:, :n], arguments[:, -2:]], axis=1)
    derivatives = tangent(given, parameters)
    both = np.concatenate([values, derivatives], axis=1)
    numbers = np.arange(both.shape[1])
    parts = _placed(model, numbers[: values.shape[1]], numbers[values.shape[1] :])
    size, found = system.size + states, []
    for eta in RATES:
        matrix = np.zeros((len(values), size, size))
        for part, factor in zip(parts, (eta, 1.0, 1 / eta), strict=True):
            for (i, j), terms in part.items():
                matrix[:, i, j] += factor * both[:, terms].sum(axis=1)
        matrix[:, np.arange(n, n + states), np.arange(n, n + states)] += eta
        matrix *= scales[:, None] * scales
        found.append(contacts.bordered(matrix, eta) if contacts.directions else matrix)
    every = np.concatenate(found)
    return every[np.isfinite(every).all(axis=(1, 2))]


class _EliminationTables:
    """Order of elimination of systems with given entries, as tables of the driver."""

    def __init__(self, entries: list[Entry], typical: Array) -> None:
        self.numbers = {entry: k for k, entry in enumerate(entries)}
        rows, columns = np.array(entries, dtype=np.int64).reshape(-1, 2).T
        steps = plan(rows, columns, typical).steps
        number = self._number
        below = [[number(i, column) for i in rows_below] for _, column, rows_below, _ in steps]
        beside = [[number(row, j) for j in columns_beside] for row, _, _, columns_beside in steps]
        targets = [
            number(i, j) for _, _, rows_below, columns_beside in steps for i in rows_below for j in columns_beside
        ]
        self.tables: dict[str, Index] = {
            "pivots": _flat([[number(row, column) for row, column, *_ in steps]]),
            "pivot_rows": _flat([[row for row, *_ in steps]]),
            "pivot_columns": _flat([[column for _, column, *_ in steps]]),
            "below_starts": _starts(below),
            "below": _flat(below),
            "below_rows": _flat([rows_below for _, _, rows_below, _ in steps]),
            "beside_starts": _starts(beside),
            "beside": _flat(beside),
            "beside_columns": _flat([columns_beside for *_, columns_beside in steps]),
            "targets": _flat([targets]),
        }

    def _number(self, row: int, column: int) -> int:
        return self.numbers.setdefault((row, column), len(self.numbers))


def _flat(parts: Iterable[Iterable[int]]) -> Index:
    return np.array([x for part in parts for x in part], dtype=np.int64)


def _starts(parts: Iterable[list[int]]) -> Index:
    return np.array([0, *itertools.accumulate(map(len, parts))], dtype=np.int64)
