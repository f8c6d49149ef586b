"""Index-1 system: accelerations, multipliers and other functions of a state."""

from __future__ import annotations

import contextlib

import numpy as np
import scipy.linalg

from uqmbd.dynamics.equations import Model, state_arguments
from uqmbd.dynamics.linear.system import System, index1_system
from uqmbd.typing import Array

__all__ = [
    "DENSE_LIMIT",
    "RANK_TOLERANCE",
    "RESIDUAL",
    "System",
    "accelerations",
    "excess",
    "impulses",
    "index1_system",
    "massless_direction",
    "residuals",
]


DENSE_LIMIT = 120
"""Largest number of unknowns for which LAPACK is faster than a sparse factorisation."""

RESIDUAL = 1e-10
"""Relative residual above which a solution by fixed pivots is poor."""

RANK_TOLERANCE = 1e-8
"""Relative size below which a singular value of the constraint Jacobian counts as zero."""


def accelerations(
    model: Model, q: Array, s: Array, v: Array, time: Array | float, parameters: Array
) -> tuple[Array, Array, Array]:
    """Solve the index-1 system ``[M D^T; D 0] [a; lambda] = [Q - h; gamma]`` at consistent states (K, ...).

    Return accelerations (K, n), multipliers of the kept equations (K, m), and rates of the auxiliary states (K, k); NaN
    for singular systems.
    """
    system: System | None = model.system
    if system is None or system.programs is None:
        values = model.evaluators["acceleration"](state_arguments(time, q, s, v), parameters)
        return (*_solve(model, values), model.result("acceleration", "s", values))
    time, parameters = np.asarray(time, dtype=float), parameters[:, : model.block_parameters]
    n, size, states = model.layout.coordinates, system.size, model.layout.states
    found = system.programs.motion(q, s, v, time.reshape(-1, 1), np.zeros((1, 1)), parameters)
    poor = np.flatnonzero(~(found[:, -1] <= RESIDUAL**2))
    if len(poor):  # solve with separate pivots for each system
        times = np.broadcast_to(time, len(q))[poor]
        values = model.evaluators["acceleration"](state_arguments(times, q[poor], s[poor], v[poor]), parameters[poor])
        found[poor, :size] = solve_directly(system, values, system.right(values))
    return found[:, :n], found[:, n:size], found[:, size : size + states]


def residuals(model: Model, states: Array, times: Array, parameters: Array) -> Array:
    """Return relative residuals (S,) of solutions by fixed pivots; states (S, width), parameters (S, parameter)."""
    q, s, v = model.layout.split(states)
    block = np.ascontiguousarray(parameters[:, : model.block_parameters])
    found = model.system.programs.motion(q, s, v, times.reshape(-1, 1), np.zeros((1, 1)), block)
    relative: Array = np.sqrt(found[:, -1])
    return relative


def excess(model: Model, states: Array, time: Array | float, parameters: Array) -> tuple[Array, Array]:
    """Return the least corrections of coordinates and velocities for the constraint violation of states (S, width).

    Subtract the corrections, of shape (S, coordinate) each, from the states. The corrections are least in the norm of
    the masses, and their error is quadratic in the violation.
    """
    parameters = parameters[:, : model.block_parameters]
    both = model.system.programs.excess(state_arguments(time, states), parameters)
    n = model.layout.coordinates
    return both[:, :n], both[:, n:]


def impulses(model: Model, states: Array, time: float, parameters: Array) -> Array:
    """Return jumps of velocities that satisfy the constraints: ``M dv = D^T L``, ``D dv = -psi``.

    States (K, width) satisfy the position constraints.  The result is NaN for singular systems.
    """
    layout, system = model.layout, model.system or index1_system(model, None)
    arguments = state_arguments(time, states)
    values = model.evaluators["acceleration"](arguments, parameters)
    right = 0.0 - system.drift_sides(model.evaluators["drift"](arguments, parameters))[1]
    return solve_directly(system, values, right)[:, : layout.coordinates]


def _solve(model: Model, values: Array) -> tuple[Array, Array]:
    """Solve the index-1 systems with entries from results of the ``acceleration`` evaluator."""
    n, system = model.layout.coordinates, model.system or index1_system(model, None)
    found = solve_directly(system, values, system.right(values))
    return found[:, :n], found[:, n:]


def solve_directly(system: System, values: Array, right: Array) -> Array:
    """Solve each system with separate pivots for right-hand sides (K, size); NaN for singular systems."""
    if system.size > DENSE_LIMIT:
        return system.pattern.factorise(values).solve(right)
    return _lapack(system.matrix(values), right)


def _lapack(matrix: Array, right: Array) -> Array:
    """Solve systems (K, size, size) for right-hand sides (K, size); NaN for singular systems."""
    # scale rows of light bodies, so that pivots of the factorisation compare similar numbers
    scale = np.abs(matrix).max(axis=2)
    scale = np.where(scale > 0, scale, 1.0)
    matrix, vector = matrix / scale[:, :, None], (right / scale)[:, :, None]
    solution = np.full(right.shape, np.nan)
    try:
        solution[:] = np.linalg.solve(matrix, vector)[:, :, 0]
    except np.linalg.LinAlgError:  # a singular system must not affect the others
        for k in range(len(matrix)):
            with contextlib.suppress(np.linalg.LinAlgError):
                solution[k] = np.linalg.solve(matrix[k], vector[k])[:, 0]
    return solution


def massless_direction(model: Model, q: Array, s: Array, time: float, parameters: Array) -> str:
    """Return a body or coordinate that can accelerate without force, as text, or an empty text, for one realisation."""
    if model.system is not None and model.system.fronts is not None:
        return ""  # fronts need regular blocks, so each body has mass in all free directions
    found = model.evaluate("acceleration", state_arguments(time, q, s, np.zeros_like(q)), parameters)
    null = scipy.linalg.null_space(found["d"][0], rcond=RANK_TOLERANCE)
    if not null.shape[1]:
        return ""
    # the ratio of a translation to a rotation depends on the size of the coordinates: only zero counts
    reduced = null.T @ found["mass"][0] @ null
    values, vectors = np.linalg.eigh(reduced)
    if values[0] > 1e-13 * max(values[-1], 1e-300):
        return ""
    share = np.abs(null @ vectors[:, 0])
    return model.carrier(int(np.argmax(share)))
