"""Compute velocities of a steady motion from drivers and given velocities; other bodies move with their carriers.

A steady motion keeps its shape. The constraints, drivers and given velocities determine a space of velocities. In this
space, the chosen motion has the least relative motion of connected bodies: a pendulum hinged on a shaft rotates with it
and does not swing. If the shaft and the ground imply different motions of a body, both orders are tried (`ORDERS`), and
the equations of motion reject unsteady motions.
"""

from __future__ import annotations

import numpy as np

from uqmbd.dynamics.assembly import statement_rows
from uqmbd.dynamics.equations import Model, state_arguments
from uqmbd.typing import Array

__all__ = ["ORDERS", "flow", "solve_steady_speeds", "velocity_maps"]


ORDERS = (("bodies", "ground"), ("ground", "bodies"))
"""Orders in which relative motions are minimised."""

RANK = 1e-9
"""Relative size below which a singular value counts as zero."""


def velocity_maps(model: Model, q: Array) -> Array:
    """Return matrices from rates of body coordinates to velocity and angular velocity, (K, body, 6, size).

    Vectors are in world axes; motions in a space of fewer dimensions are embedded in three dimensions.
    """
    count, d, size = len(q), model.dimension, model.size
    found = np.zeros((count, len(model.bodies), 6, size))
    axes = np.arange(d)
    found[:, :, axes, axes] = 1.0
    e = q.reshape(count, -1, size)[:, :, d:]
    if size > d and d == 2:
        found[:, :, 5, 2], found[:, :, 5, 3] = -2 * e[..., 1], 2 * e[..., 0]
    elif size > d:
        a, b, c, f = (2 * e[..., k] for k in range(4))
        # (0, omega) = 2 e' e*
        found[:, :, 3, 3:] = np.stack([-b, a, -f, c], axis=-1)
        found[:, :, 4, 3:] = np.stack([-c, f, a, -b], axis=-1)
        found[:, :, 5, 3:] = np.stack([-f, -c, b, a], axis=-1)
    return found


def _relative(model: Model, q: Array, *, ground: bool) -> Array:
    """Return rows of the relative motions of connected bodies as functions of velocities, shape (K, row, n)."""
    count, n = q.shape
    turned = velocity_maps(model, q)
    places = np.zeros((count, len(model.bodies), 3))
    places[:, :, : model.dimension] = q.reshape(count, -1, model.size)[:, :, : model.dimension]
    blocks = []
    for i, j in model.links:
        if (i < 0) != ground:
            continue
        rows = np.zeros((count, 6, len(model.bodies), model.size))
        rows[:, :, j] += turned[:, j]
        if i >= 0:
            rows[:, :, i] -= turned[:, i]
            arm = places[:, j] - places[:, i]
            rows[:, :3, i] += np.cross(arm[:, None, :], turned[:, i, 3:].transpose(0, 2, 1)).transpose(0, 2, 1)
        rows[:, 3:] *= model.length
        blocks.append(rows.reshape(count, 6, n))
    return np.concatenate(blocks, axis=1) if blocks else np.zeros((count, 0, n))


def solve_steady_speeds(
    model: Model, q: Array, s: Array, time: float, parameters: Array, order: tuple[str, ...]
) -> Array:
    """Return velocities (K, n) at poses (K, n) by the rule of this module; `order` is in `ORDERS`, `time` in s."""
    found = model.evaluate("velocity", state_arguments(time, q, s, np.zeros_like(q)), parameters)
    kept = model.layout.kept
    rows, values = [found["d"][:, kept], *statement_rows(model, q)], [-found["phi_t"][:, kept]]
    values += [parameters[:, statement.parameters] for statement in model.statements]
    if model.conditions is not None:
        which = model.conditions.velocities
        value, _, slope = model.conditions(q, s, time, parameters)
        rows.append(slope[:, which])
        values.append(-value[:, which])
    a, b = np.concatenate(rows, axis=1), np.concatenate(values, axis=1)
    inverse = np.linalg.pinv(a, rcond=RANK)
    v = (inverse @ b[:, :, None])[:, :, 0]
    left = np.eye(q.shape[1]) - inverse @ a
    for kind in order:
        relative = _relative(model, q, ground=kind == "ground")
        if not relative.shape[1]:
            continue
        moved = relative @ left
        scale = max(1.0, float(np.abs(relative).max(initial=0.0)))
        inverse = _inverse(moved, RANK * scale)
        v = v - (left @ inverse @ (relative @ v[:, :, None]))[:, :, 0]
        left = left - left @ inverse @ moved
    return np.asarray(v)


def _inverse(matrices: Array, smallest: float) -> Array:
    """Return pseudo-inverses; singular values below the size `smallest` count as zero."""
    u, values, vt = np.linalg.svd(matrices, full_matrices=False)
    with np.errstate(divide="ignore"):
        inverted = np.where(values > smallest, 1 / values, 0.0)
    return np.asarray(vt.transpose(0, 2, 1) @ (inverted[:, :, None] * u.transpose(0, 2, 1)))


def flow(
    model: Model, q: Array, s: Array, time: float, parameters: Array, order: tuple[str, ...], step: float
) -> tuple[Array, Array]:
    """Integrate the velocities of the rule over a step, s (Runge-Kutta of order 4); return coordinates and states."""

    def slope(x: Array, y: Array, at: float) -> tuple[Array, Array]:
        v = solve_steady_speeds(model, x, y, at, parameters, order)
        values = model.evaluators["acceleration"](state_arguments(at, x, y, v), parameters)
        return v, model.result("acceleration", "s", values)

    slopes = [slope(q, s, time)]
    for part in (step / 2, step / 2, step):
        dq, ds = slopes[-1]
        slopes.append(slope(q + part * dq, s + part * ds, time + part))
    weights = (1, 2, 2, 1)
    x, y = q.copy(), s.copy()
    for weight, (dq, ds) in zip(weights, slopes, strict=True):
        x += weight * step / 6 * dq
        y += weight * step / 6 * ds
    return x, y
