"""Restarts of an integration: velocities after a jump of a prescribed speed."""

from __future__ import annotations

import numpy as np

from uqmbd.dynamics.assembly import named
from uqmbd.dynamics.equations import Model, state_arguments
from uqmbd.dynamics.integration.prescribed import instant, jumped
from uqmbd.dynamics.linear import impulses
from uqmbd.typing import Array

__all__ = ["speed_jumps"]


FELT = 0.1
"""Jump of a speed, relative to the tolerance, that counts as an impulse."""
CONTRADICTION = 1e-6
"""Residual speed after an impulse, relative to the largest speed, that indicates contradictory equations."""


def speed_jumps(
    model: Model, states: Array, time: float, parameters: Array, rtol: float
) -> tuple[Array, dict[int, str]]:
    """Compute the impulsive change of velocities at jumps of prescribed speeds: ``M dv = D^T L``, ``D dv = -psi``.

    States (K, width) are those right before the jump.  Return the change (K, coordinate), zero without a jump, and the
    reason for each realisation that cannot continue.
    """
    layout, delta = model.layout, instant(time)
    change = np.zeros((len(states), layout.coordinates))
    if not layout.rank or not model.rheonomic:
        return change, {}

    def speeds(states: Array, at: float, block: Array) -> Array:
        return model.evaluate("drift", state_arguments(at, states), block)["psi"]

    sides = [speeds(states, time + k * delta, parameters) for k in (-2, -1, 1, 2)]
    speed = np.maximum(np.abs(states[:, layout.velocities :]).max(axis=1, initial=0.0), 1e-3)
    jump = jumped(*sides).max(axis=1)
    some = np.flatnonzero(jump > FELT * rtol * speed)
    if not len(some):
        return change, {}
    change[some] = impulses(model, states[some], time + delta, parameters[some])
    moved = states[some].copy()
    moved[:, layout.velocities :] += change[some]
    left = np.abs(speeds(moved, time + delta, parameters[some]))
    size = np.maximum(speed[some], np.abs(sides[2][some]).max(axis=1))
    wrong = ~(left <= max(CONTRADICTION, rtol) * size[:, None])
    reasons = {
        int(some[row]): (
            f"a prescribed speed jumps by {jump[some[row]]:.6g} at t = {time:.6g} s, but after this jump the equations "
            f"{named(model, np.flatnonzero(wrong[row]))} contradict other equations"
        )
        for row in np.flatnonzero(wrong.any(axis=1))
    }
    return change, reasons
