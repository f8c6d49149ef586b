"""Observation of outputs and energies in states, consistent with the equations of motion."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uqmbd.compiled import Columns, Kernel, Program, ProgramWriter, cached, compile_kernel
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.contact import ContactEvaluator, states_in_contact, undetermined_forces
from uqmbd.dynamics.equations import Model, OutputMap, state_arguments
from uqmbd.dynamics.linear import RESIDUAL, Programs, accelerations
from uqmbd.typing import Array, Index, Mask

__all__ = [
    "energies",
    "observe",
    "observe_along",
    "observe_singly",
    "output_program",
    "prepare",
    "undetermined_contacts",
    "write_outputs",
]


CANCELS = 1e-9
"""Change of an output, relative to the sum of the changes by single forces, that counts as zero."""


def observe_along(batch: Batch, outputs: OutputMap, times: Array, states: Array) -> Array:
    """Evaluate outputs along trajectories (K, T, width), with angles unwrapped over times: shape (K, output, T).

    Times, s, are common to all realisations, (T,), or separate for each, (K, T).
    """
    members, count = states.shape[:2]
    times = np.asarray(times, dtype=float).ravel()
    flat = states.reshape(members * count, -1)
    if (program := output_program(batch.model, outputs)) is not None:
        owners = Columns(batch.block, count), Columns(batch.values, count)
        found = _by_program(program, batch.model, outputs, flat, Columns(times), *owners)
    else:
        found = observe(batch, outputs, flat, np.resize(times, members * count), np.repeat(np.arange(members), count))
    # times must be contiguous: otherwise reading all times takes several times as long
    response = np.ascontiguousarray(found.reshape(members, count, -1).transpose(0, 2, 1))
    return outputs.unwrap(response) if outputs.turns.any() else response


def observe(batch: Batch, outputs: OutputMap, states: Array, time: Array, owner: Index) -> Array:
    """Evaluate outputs at states (S, width) of the realisations `owner` (S,) at times (S,): shape (S, output)."""
    model = batch.model
    if (program := output_program(model, outputs)) is not None:
        return _by_program(
            program, model, outputs, states, *map(Columns, (time, batch.block[owner], batch.values[owner]))
        )
    return observe_singly(batch, outputs, states, time, owner)


def observe_singly(batch: Batch, outputs: OutputMap, states: Array, time: Array, owner: Index) -> Array:
    """Evaluate outputs with separate pivots for each state."""
    return _one_by_one(batch.model, outputs, states, time, batch.block[owner], batch.values[owner])


def _one_by_one(
    model: Model, outputs: OutputMap, states: Array, time: Array, parameters: Array, values: Array
) -> Array:
    """Evaluate outputs of states that may need separate pivots, or are in contact."""
    layout = model.layout
    q, s, v = layout.split(states)
    quaternions = model.quaternions()
    if quaternions.size:
        q = q.copy()
        e = q[:, quaternions]
        q[:, quaternions] = e / np.linalg.norm(e, axis=2, keepdims=True)
    a, multipliers = np.zeros_like(q), np.zeros((len(q), layout.constraints))
    forces, free = None, list[_FreeForces]()
    if outputs.accelerates:
        a, multipliers[:, layout.kept], _ = accelerations(model, q, s, v, time, parameters)
        if model.events:
            forces, free = _add_contacts(model, states, time, parameters, a, multipliers)
    state = np.concatenate([q, s, v, a, multipliers, time[:, None]], axis=1)
    found = outputs(state, values, parameters, forces)
    for one in free:
        k = one.place
        assert forces is not None
        found[k, _changes(outputs, state[k], values[k], parameters[k], forces[k], one)] = np.nan
    return found


def output_program(model: Model, outputs: OutputMap, *, open_contacts: bool = False) -> Program | None:
    """Return outputs as one program of (state, t, 0, parameters, inputs); None: observe states one by one.

    If outputs need accelerations, the last result is the residual of their system: poor above `RESIDUAL` ** 2.
    `open_contacts` states that no contact lasts, so that contacts change no accelerations.
    """
    if not _compiled(model) and not (open_contacts and model.system is not None and model.system.programs is not None):
        return None
    programs: Programs = model.system.programs
    key = (outputs.kernel.name, outputs.needed.tobytes(), outputs.accelerates)
    if key not in programs.others:
        programs.others[key] = _program(model, outputs)
    found: Program = programs.others[key]
    return found


def prepare(model: Model) -> None:
    """Compile all further kernels of an observation before the computation of samples."""
    if _compiled(model) and model.quaternions().size:
        _unit(model.quaternions().shape[1])


def _compiled(model: Model) -> bool:
    """Return whether outputs are one program: elimination is compiled, and persistent contacts change no forces."""
    return not model.events and model.system is not None and model.system.programs is not None


def _by_program(
    program: Program,
    model: Model,
    outputs: OutputMap,
    states: Array,
    time: Columns,
    block: Columns,
    values: Columns,
) -> Array:
    found = program(states, time, Columns(np.zeros((1, 1))), block, values)
    if not outputs.accelerates:
        return found
    count = len(outputs.names)
    if found.shape[1] > count and (poor := np.flatnonzero(~(found[:, count] <= RESIDUAL**2))).size:
        found[poor, :count] = _one_by_one(
            model, outputs, states[poor], *(_rows(x, poor) for x in (time, block, values))
        )
    return found[:, :count]


def _rows(columns: Columns, which: Index) -> Array:
    return columns.data[which // columns.divisor % len(columns.data)]


def _program(model: Model, outputs: OutputMap) -> Program:
    """Write outputs and the residual of accelerations as a program of (state, t, 0, parameters, inputs)."""
    writer = ProgramWriter(model.layout.width + 2 + model.block_parameters + len(model.inputs))
    results, residual = write_outputs(model, writer, outputs)
    return writer.program(np.concatenate([results, residual]))


def write_outputs(model: Model, writer: ProgramWriter, outputs: OutputMap) -> tuple[Index, Index]:
    """Write outputs of (state, t, 0, parameters, inputs); return the rows of the results and of the residual."""
    layout, programs = model.layout, model.system.programs
    n, width = layout.coordinates, layout.width
    ends = np.cumsum([width + 2, model.block_parameters, len(model.inputs)])
    arguments, parameters, inputs = np.split(np.arange(ends[-1]), ends[:-1])
    quaternions, zero, residual = model.quaternions(), width + 1, np.zeros(0, dtype=np.int64)
    if quaternions.size:
        arguments[quaternions] = writer.call(_unit(quaternions.shape[1]), quaternions)
    accelerations, multipliers = np.full(n, zero), np.full(layout.constraints, zero)
    if outputs.accelerates:
        solution, residual = programs.write_motion(model, writer, arguments, parameters)
        accelerations, multipliers[layout.kept] = solution[:n], solution[n:]
    reads = (arguments[:width], accelerations, multipliers, [width], inputs, parameters[outputs.needed])
    return writer.call(outputs.kernel, np.concatenate(reads)[None]).ravel(), residual


def _unit(size: int) -> Kernel:
    """Compile the normalisation of a vector of `size` numbers to unit length."""

    def make() -> Kernel:
        import symengine as se

        x = se.symbols(f"x0:{size}")
        return compile_kernel(x, [a / se.sqrt(se.Add(*[b**2 for b in x])) for a in x])

    kernel: Kernel = cached(("unit vector", size), make)
    return kernel


class _FreeForces(NamedTuple):
    """Contact forces (direction, N) that may be added to those of a state, and their columns of arguments (N, width).

    The columns are those of multipliers in the arguments of outputs.
    """

    place: int
    forces: Array
    multipliers: Array
    columns: Index


def _add_contacts(
    model: Model, states: Array, time: Array, parameters: Array, a: Array, multipliers: Array
) -> tuple[Array, list[_FreeForces]]:
    """Correct accelerations and multipliers for persistent contacts.

    Return contact forces (S, direction) in N, and the forces that the laws of contact do not determine.
    """
    evaluator = ContactEvaluator(model)
    forces, free = np.zeros((len(states), evaluator.directions)), list[_FreeForces]()
    n, kept = model.layout.coordinates, model.layout.kept
    columns = model.layout.width + n + np.asarray(kept)
    for k, contacts, lasting, resting in states_in_contact(evaluator, time, states, parameters):
        a[k], multipliers[k, kept], forces[k] = resting.motion[0, :n], resting.motion[0, n:], resting.force[0]
        if (ways := undetermined_forces(contacts, lasting, resting)).shape[1]:
            answer = contacts.answer[0, n:]
            change = answer @ ways
            change[np.abs(change) <= CANCELS * (np.abs(answer) @ np.abs(ways))] = 0.0
            free.append(_FreeForces(k, ways, change.T, columns))
    return forces, free


def _changes(
    outputs: OutputMap, state: Array, values: Array, parameters: Array, forces: Array, free: _FreeForces
) -> Mask:
    """Return a mask (output,) of the outputs of one state that change with undetermined contact forces."""
    # combinations without a pattern, so that the changes of a nonlinear output do not cancel
    weights = np.random.default_rng(0).uniform(0.5, 1.5, (2, free.forces.shape[1])) * [[1.0], [-0.7]]
    changed = np.zeros(len(outputs.names), dtype=bool)
    for force, multiplier in zip(weights @ free.forces.T, weights @ free.multipliers, strict=True):
        # first all forces at once, then each force alone, because cancelling forces leave rounding errors
        pushes = np.concatenate([[0 * force, force], np.diag(force), np.zeros((len(multiplier), len(force)))])
        steps = np.zeros((len(pushes), len(state)))
        steps[1, free.columns] = multiplier
        steps[range(2 + len(force), len(pushes)), free.columns] = multiplier
        count = len(pushes)
        rows = np.tile(values, (count, 1)), np.tile(parameters, (count, 1))
        seen = outputs(state + steps, *rows, forces + pushes)
        alone = np.abs(seen[2:] - seen[0]).sum(axis=0)
        changed |= ~(np.abs(seen[1] - seen[0]) <= CANCELS * alone)
    return changed


def undetermined_contacts(batch: Batch, time: float, state: Array, member: int) -> list[str]:
    """Return the names of contacts whose forces are undetermined at a state (width,) of a realisation, at a time, s."""
    model = batch.model
    if not model.events:
        return []
    evaluator = ContactEvaluator(model)
    found = states_in_contact(evaluator, np.array([time]), state[None], batch.block[member : member + 1])
    names = dict[str, None]()
    for _, contacts, lasting, motion in found:
        ways = undetermined_forces(contacts, lasting, motion)
        for k in lasting.modes if ways.shape[1] else ():
            own = ways[evaluator.first[k] : evaluator.first[k + 1]]
            if own.any():
                names[model.events[k][0]] = None
    return list(names)


def energies(batch: Batch, times: Array, states: Array) -> Array:
    """Return kinetic and potential energies (K, 2, T) in J along trajectories (K, T, width); see `observe_along`."""
    flat = states.reshape(-1, states.shape[2])
    arguments = state_arguments(np.resize(times, len(flat)), flat)
    parameters = np.repeat(batch.block, states.shape[1], axis=0)
    found = batch.model.evaluate("energy", arguments, parameters)["energy"]
    return found.reshape(len(states), states.shape[1], 2).transpose(0, 2, 1)
