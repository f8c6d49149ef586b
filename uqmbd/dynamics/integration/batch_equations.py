"""Rates and projection of realisations, evaluated together."""

from __future__ import annotations

import numpy as np

from uqmbd.compiled import Program
from uqmbd.dynamics.equations import Model, state_arguments
from uqmbd.dynamics.integration.restarts import speed_jumps
from uqmbd.dynamics.integration.roles import Out
from uqmbd.dynamics.linear import excess
from uqmbd.typing import Array, Index

__all__ = ["BatchEquations"]


class BatchEquations:
    """Rates and projection of M realisations."""

    def __init__(self, model: Model, block: Array) -> None:
        layout, self.model, self.block = model.layout, model, block
        self.n, self.velocities, self.width = layout.coordinates, layout.velocities, layout.width
        dynamics = model.system.programs.dynamics
        self.motion = Program(dynamics.motion, self.width + 2 + dynamics.parameters, dynamics.rows, dynamics.rate)
        self.evaluations, self.coupled = 0, False
        self.moving = dynamics.moving
        self.state, self.time = np.zeros((len(block), self.width)), 0.0

    def rate(self, time: float, out: Out) -> None:
        """Write the rate of ``self.state`` to `out`: its coordinates, its velocities, and all of it."""
        self.evaluations += 1
        self.time = time
        out[2][:] = self.motion(state_arguments(time, self.state), self.block)

    def excess(self) -> tuple[Array, Array]:
        """By what coordinates and velocities of ``self.state``, whose rate is known, exceed the constraints."""
        return excess(self.model, self.state, self.time, self.block)

    def impulse(self, time: float, rtol: float) -> tuple[Array, dict[int, str]]:
        """Find how velocities of ``self.state`` jump where prescribed speeds do, and who cannot go on."""
        return speed_jumps(self.model, self.state, time, self.block, rtol)

    def keep(self, rows: Index) -> None:
        """Go on with some realisations only."""
        self.block, self.state = self.block[rows], self.state[rows]
