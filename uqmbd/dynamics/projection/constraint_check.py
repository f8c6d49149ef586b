"""Check of coefficients against the projected constraints."""

from __future__ import annotations

import numpy as np

from uqmbd.dynamics.integration import (
    allowed_residual,
    described,
    off_states,
    over_allowed,
    residuals,
)
from uqmbd.dynamics.projection.ensemble import ProjectedEquations
from uqmbd.typing import Array, Index

__all__ = ["projected_off"]


BLOCK = 2048
"""States at nodes whose residuals are evaluated at once."""


def projected_off(projected: ProjectedEquations, times: Array, coefficients: Array, rtol: float) -> tuple[int, str]:
    """Find where coefficients (P, T, width) are off the projected constraints by more than the tolerance.

    The number of the first such time, and what to say; 0 and nothing if there is none.
    """
    ensemble, layout = projected.ensemble, projected.model.layout
    if not layout.rank:
        return 0, ""
    nodes, velocities = np.arange(len(ensemble)), layout.velocities
    # of the means: the first polynomial is one
    size = np.clip(np.abs(ensemble.start.q).max(keepdims=True).ravel(), 1e-3, 1.0)
    speed = np.nanmax(np.abs(coefficients[..., velocities:]), initial=0.0)
    allowed = allowed_residual(rtol)
    scale = allowed * ensemble.gradient_lengths.mean(axis=0, keepdims=True)
    breaks = ensemble.breaks.reshape(1, -1)
    per = max(1, BLOCK // len(ensemble))
    for first in range(0, len(times), per):
        part = slice(first, first + per)

        def ratios(at: Array, which: Index | slice, part: slice = part) -> Array:
            nodal = projected.nodal(coefficients[:, part][:, which])
            # an equation of the coefficients: its largest one
            phi, psi = (np.abs(projected.project(x)).max(axis=0)[None] for x in residuals(ensemble, nodes, at, nodal))
            return over_allowed(projected.model, phi, psi, scale, size, np.maximum(speed, 1e-3 * size))

        for _, wrong, found in off_states(ratios, times[part], breaks):
            return first + wrong, described(projected.model, found, float(times[first + wrong]), allowed, rtol)
    return 0, ""
