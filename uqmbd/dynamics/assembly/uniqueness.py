"""Reactions that redundant constraints leave undetermined.

Multipliers that no coordinate feels, ``D^T n = 0`` over all equations, may be added to a solution at will.  A reaction
is unique if adding them does not change it.
"""

from __future__ import annotations

import numpy as np
import sympy

from uqmbd.dynamics.assembly.rank import null_equations
from uqmbd.dynamics.equations import Model, OutputMap
from uqmbd.mechanism import Mechanism, flatten
from uqmbd.typing import Array

__all__ = ["not_unique", "reaction_symbols"]


CHANGE = 1e-8
"""Relative change of an output, for multipliers of the size of those that are added, that counts as none."""


def reaction_symbols(mechanism: Mechanism, owners: set[str]) -> list[sympy.Symbol]:
    """List the components of forces and moments of the components that have constraint equations."""
    found: list[sympy.Symbol] = []
    for name, component in mechanism.components.items():
        if name in owners:
            moment = component.reaction_moment if mechanism.space.size > mechanism.space.dimension else ()
            found += [*component.reaction_force, *flatten(moment)]
    return found


def not_unique(model: Model, outputs: OutputMap, q: Array, time: float, parameters: Array) -> tuple[str, ...]:
    """Return the names of the outputs that change with multipliers that exert no generalised force.

    The pose (coordinate,) and parameters (parameter,) are those of one assembled realisation.
    """
    layout = model.layout
    still = np.zeros(layout.states)
    free = null_equations(model, q, still, time, parameters)
    if not free.shape[1] or not len(outputs.names):
        return ()
    # multipliers without any pattern: an output that is not linear in them shall not hide a change
    given = np.random.default_rng(0).uniform(0.5, 1.5, layout.constraints)
    multipliers = np.concatenate([given[None], given + free.T, given - 0.7 * free.T])
    count = len(multipliers)
    rest = np.tile(np.concatenate([q, still, np.zeros(2 * layout.coordinates)]), (count, 1))
    state = np.concatenate([rest, multipliers, np.full((count, 1), time)], axis=1)
    inputs = np.ones((count, len(model.inputs)))
    blocks = np.tile(parameters[: model.block_parameters], (count, 1))
    with np.errstate(all="ignore"):
        seen = outputs(state, inputs, blocks)
    change = np.abs(seen[1:] - seen[0]).max(axis=0)
    large = change > CHANGE * np.maximum(1.0, np.abs(seen).max(axis=0))
    return tuple(name for name, changes in zip(outputs.names, large, strict=True) if changes)
