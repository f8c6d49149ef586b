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
"""Number of nodal states for one evaluation of residuals."""


def projected_off(projected: ProjectedEquations, times: Array, coefficients: Array, rtol: float) -> tuple[int, str]:
    """Find the first time at which coefficients (P, T, width) violate the projected constraints beyond the tolerance.

    Return the index of this time and a message, or 0 and an empty text.
    """
    ensemble, layout = projected.ensemble, projected.model.layout
    if not layout.rank:
        return 0, ""
    nodes, velocities = np.arange(len(ensemble)), layout.velocities
    # sizes of the mean coefficients: the first polynomial is one
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
            # largest residual over the coefficients, for each equation
            phi, psi = (np.abs(projected.project(x)).max(axis=0)[None] for x in residuals(ensemble, nodes, at, nodal))
            return over_allowed(projected.model, phi, psi, scale, size, np.maximum(speed, 1e-3 * size))

        for _, wrong, found in off_states(ratios, times[part], breaks):
            return first + wrong, described(projected.model, found, float(times[first + wrong]), allowed, rtol)
    return 0, ""
