"""Explicit integration of the projected index-1 form: batched, its rows coupled through the basis."""

from __future__ import annotations

import numpy as np

from uqmbd.dynamics.integration import BatchedIntegration, Out, longest_step, pace
from uqmbd.dynamics.projection.ensemble import Projection
from uqmbd.dynamics.projection.trajectories import Watch
from uqmbd.typing import Array, Index

__all__ = ["ProjectedEquations", "integrate_batched"]


SOLVED = 1e-2
"""Accuracy of accelerations, over the tolerance of the integration."""


class ProjectedEquations:
    """Rates and projection of coefficients (P, width)."""

    def __init__(self, projected: Projection, rtol: float) -> None:
        model, layout = projected.model, projected.model.layout
        self.projected, self.tolerance = projected, SOLVED * rtol
        self.n, self.velocities, self.width = layout.coordinates, layout.velocities, layout.width
        self.coupled, self.evaluations = True, 0
        self.moving = layout.width - 2 * len(layout.frozen) - layout.held
        self.motion, self.drift = model.evaluators["acceleration"], model.evaluators["drift"]
        self.solver = projected.coupled
        block = projected.ensemble.block
        self.block = block
        self.arguments = np.concatenate([np.zeros((len(block), self.width + 2)), block], axis=1)
        self.nodal, self.time = self.arguments[:, : self.width], self.arguments[:, self.width]
        self.state = np.zeros((projected.terms, self.width))
        self.values = np.zeros((len(block), len(self.motion.targets)))
        found = self.motion.index.get("s")
        self.auxiliary = None if found is None else (found[1][0] + self.n, found[0])

    def rate(self, time: float, out: Out) -> None:
        """Write the rates of ``self.state`` to `out`."""
        self.evaluations += 1
        self.time.fill(time)
        self.nodal[:] = self.projected.psi @ self.state
        self.values = self.motion(self.arguments[:, : self.width + 2], self.block)
        found = self.solver.solve(self.values, self.tolerance)
        out[0][:] = self.state[:, self.velocities :]
        out[1][:] = found[:, : self.n]
        if self.auxiliary is not None:
            out[2][:, self.auxiliary[0]] = self.projected.adjoint @ self.values[:, self.auxiliary[1]]

    def excess(self) -> tuple[Array, Array]:
        """By what coefficients of ``self.state``, whose rate is known, exceed the projected constraints."""
        found = self.drift(self.arguments[:, : self.width + 2], self.block)
        return self.solver.excess(self.values, found, tolerance=1e-3)

    def impulse(self, time: float, rtol: float) -> tuple[Array, dict[int, str]]:
        """Find how coefficients of velocities of ``self.state`` jump where prescribed speeds do."""
        return self.projected.impulse(self.state, time, rtol), {}

    def keep(self, rows: Index) -> None:
        """Coupled rows stay together."""


def integrate_batched(
    projected: Projection, times: Array, rtol: float, watch: Watch | None = None
) -> tuple[BatchedIntegration, ProjectedEquations]:
    """Integrate; the run holds coefficients (P, T, width), and the reason if it could not go on."""
    equations, start = ProjectedEquations(projected, rtol), projected.start
    longest = longest_step(projected.model.rough, times)
    size = float(np.abs(projected.ensemble.start.q).max(initial=0.0))
    floor = np.full((projected.terms, 1), rtol * min(1.0, max(1e-3, size)))
    run = BatchedIntegration(
        equations, start.state, times, pace(projected.ensemble, times, rtol, knots=True), rtol, floor, watch, longest
    )
    run.run()
    return run, equations
