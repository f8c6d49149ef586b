"""Find reactions that are undetermined because of redundant constraints.

Multipliers without a generalised force, ``D^T n = 0`` over all equations, may be added to every solution.  A reaction
is unique if these multipliers do not change it.
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
"""Relative change of an output by added multipliers that counts as zero."""


def reaction_symbols(mechanism: Mechanism, owners: set[str]) -> list[sympy.Symbol]:
    """Return the symbols of forces and moments of components with constraint equations."""
    found: list[sympy.Symbol] = []
    for name, component in mechanism.components.items():
        if name in owners:
            moment = component.reaction_moment if mechanism.space.size > mechanism.space.dimension else ()
            found += [*component.reaction_force, *flatten(moment)]
    return found


def not_unique(model: Model, outputs: OutputMap, q: Array, time: float, parameters: Array) -> tuple[str, ...]:
    """Return the names of outputs that change with multipliers without a generalised force.

    The pose (coordinate,) and parameters (parameter,) belong to one assembled realisation.
    """
    layout = model.layout
    still = np.zeros(layout.states)
    free = null_equations(model, q, still, time, parameters)
    if not free.shape[1] or not len(outputs.names):
        return ()
    # multipliers without a pattern, so that an output nonlinear in multipliers cannot hide a change
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
