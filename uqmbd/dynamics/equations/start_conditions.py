"""Compiled start conditions: residuals and their derivatives with respect to coordinates and velocities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import sympy

from uqmbd.dynamics.equations.block import Instance
from uqmbd.dynamics.equations.evaluator import Placement
from uqmbd.dynamics.equations.outputs import OutputMap, output_map
from uqmbd.mechanism import Mechanism, Output
from uqmbd.randomness import RandomVariable
from uqmbd.typing import Array, Index

__all__ = ["Conditions", "compiled_conditions", "inputs_of_conditions"]


@dataclass(frozen=True)
class Conditions:
    """Compiled start conditions."""

    names: tuple[str, ...]
    of_velocities: Index  # (condition,): whether it is a condition of velocities
    residuals: OutputMap  # residuals of the conditions, with gradients
    inputs: Index  # indices of random variables of conditions among the parameters of the model
    size: tuple[int, int]  # numbers of coordinates and of constraint equations

    @property
    def positions(self) -> Index:
        """Indices of the conditions of positions."""
        return np.flatnonzero(~self.of_velocities)

    @property
    def velocities(self) -> Index:
        """Indices of the conditions of velocities."""
        return np.flatnonzero(self.of_velocities)

    def __call__(self, q: Array, s: Array, time: float, parameters: Array) -> tuple[Array, Array, Array]:
        """Evaluate at states (K, ...) at rest: residuals (K, c), and derivatives by q and by v, (K, c, n) each."""
        n, m = self.size
        count, number = len(q), len(self.names)
        rest = [np.zeros((count, 2 * n + m)), np.full((count, 1), time)]
        found = self.residuals(np.concatenate([q, s, *rest], axis=1), parameters[:, self.inputs], parameters)
        gradients = found[:, number:].reshape(count, number, 2, n)
        return found[:, :number], gradients[:, :, 0], gradients[:, :, 1]


def inputs_of_conditions(mechanism: Mechanism) -> list[RandomVariable]:
    """Return the random variables in start conditions."""
    found: set[sympy.Basic] = set()
    for condition in mechanism.conditions.values():
        found |= condition.residual.free_symbols
    return sorted((s for s in found if isinstance(s, RandomVariable)), key=str)


def compiled_conditions(
    mechanism: Mechanism,
    instances: list[Instance],
    places: list[Placement],
    order: dict[str, int],
    sizes: tuple[int, int, int],
    inputs: Index,
) -> Conditions | None:
    """Compile the start conditions of a mechanism; None if there are none.

    The arguments are those of `output_map`, except for `inputs`: the indices of `inputs_of_conditions` among the
    parameters.
    """
    stated = mechanism.conditions
    if not stated:
        return None
    residuals: Sequence[Output] = [Output(name, c.residual, "") for name, c in stated.items()]
    used = inputs_of_conditions(mechanism)
    compiled = output_map(residuals, instances, places, order, used, sizes, gradients="motion")
    kinds = np.array([c.of_velocities for c in stated.values()], dtype=bool)
    return Conditions(tuple(stated), kinds, compiled, inputs, (sizes[0], sizes[2]))
