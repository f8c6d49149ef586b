"""Observation: outputs and energies of states, consistent with the equations of motion."""

from __future__ import annotations

import numpy as np

from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.contact import ContactEvaluator, states_in_contact
from uqmbd.dynamics.equations import Model, OutputMap, state_arguments
from uqmbd.dynamics.linear import accelerations
from uqmbd.typing import Array, Index

__all__ = ["energies", "observe", "observe_along"]


BLOCK = 2048
"""States that are observed at once: many more of them fall out of the processor's cache."""


def observe_along(batch: Batch, outputs: OutputMap, times: Array, states: Array) -> Array:
    """Evaluate outputs along trajectories (K, T, width), angles unwrapped over the times: shape (K, output, T)."""
    members, count = states.shape[:2]
    flat, time = states.reshape(members * count, -1), np.tile(times, members)
    owner = np.repeat(np.arange(members), count)
    result = np.empty((members * count, len(outputs.names)))
    for first in range(0, len(flat), BLOCK):
        part = slice(first, first + BLOCK)
        result[part] = observe(batch, outputs, flat[part], time[part], owner[part])
    return outputs.unwrap(result.reshape(members, count, -1).transpose(0, 2, 1))


def observe(batch: Batch, outputs: OutputMap, states: Array, time: Array, owner: Index) -> Array:
    """Evaluate outputs at states (S, width) of the realisations `owner` (S,) at times (S,): shape (S, output)."""
    model, layout = batch.model, batch.model.layout
    q, s, v = layout.split(states)
    quaternions = model.quaternions()
    if quaternions.size:
        q = q.copy()
        e = q[:, quaternions]
        q[:, quaternions] = e / np.linalg.norm(e, axis=2, keepdims=True)
    parameters = batch.block[owner]
    a, multipliers = np.zeros_like(q), np.zeros((len(q), layout.constraints))
    forces = None
    if outputs.accelerates:
        a, multipliers[:, layout.kept], _ = accelerations(model, q, s, v, time, parameters)
        if model.events:
            forces = _add_contacts(model, states, time, parameters, a, multipliers)
    state = np.concatenate([q, s, v, a, multipliers, time[:, None]], axis=1)
    return outputs(state, batch.values[owner], parameters, forces)


def _add_contacts(model: Model, states: Array, time: Array, parameters: Array, a: Array, multipliers: Array) -> Array:
    """Put right what contacts that last change of accelerations and multipliers; their forces (S, direction)."""
    evaluator = ContactEvaluator(model)
    forces = np.zeros((len(states), evaluator.directions))
    n, kept = model.layout.coordinates, model.layout.kept
    for k, resting in states_in_contact(evaluator, time, states, parameters):
        a[k], multipliers[k, kept], forces[k] = resting.motion[0, :n], resting.motion[0, n:], resting.force[0]
    return forces


def energies(batch: Batch, times: Array, states: Array) -> Array:
    """Kinetic and potential energy along trajectories (K, T, width), J: shape (K, 2, T)."""
    arguments = state_arguments(np.tile(times, len(states)), states.reshape(-1, states.shape[2]))
    parameters = np.repeat(batch.block, states.shape[1], axis=0)
    found = batch.model.evaluate("energy", arguments, parameters)["energy"]
    return found.reshape(len(states), states.shape[1], 2).transpose(0, 2, 1)
