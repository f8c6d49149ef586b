"""Check of the states of an integration against the constraints, in position and in velocity."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from uqmbd.compiled import Columns
from uqmbd.dynamics.assembly import named
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.integration.prescribed import instant
from uqmbd.typing import Array, Index

__all__ = ["BLOCK", "allowed_residual", "described", "off_constraints", "off_states", "over_allowed", "residuals"]


OFF = 100.0
"""Allowed residual of the constraints in multiples of the tolerance: positions relative to the size of the mechanism,
velocities relative to the largest one."""
LEAST, MOST = 1e-6, 1e-2
"""Least and greatest value of the allowed residual."""
BLOCK = 2048
"""Number of states in one evaluation of residuals."""


def off_constraints(
    ensemble: Batch, times: Array, states: Array, rtol: float, known: Array | None = None
) -> dict[int, tuple[int, str]]:
    """Find results that violate the constraints, in position or in velocity, by more than the allowed residual.

    States are (K, T, width), NaN if missing; `known` is `Trajectories.off`.  At a break time, a state may satisfy the
    constraints of either side.  Return the index of the first such time and a message for each affected realisation.
    """
    layout = ensemble.model.layout
    good = np.flatnonzero(np.isfinite(states[:, 0]).all(axis=1))
    if not layout.rank or not len(good):
        return {}
    size = np.minimum(1.0, np.maximum(1e-3, np.abs(states[:, 0, : layout.coordinates]).max(axis=1)))
    phi, psi, speed = _largest(ensemble, times, states, known)
    allowed = allowed_residual(rtol)
    scale = allowed * ensemble.gradient_lengths
    most = over_allowed(ensemble.model, phi[:, None], psi[:, None], scale, size, np.maximum(speed, 1e-3 * size))
    good = good[(most[good] > 1.0).any(axis=(1, 2))]
    breaks, texts = ensemble.breaks, dict[int, tuple[int, str]]()
    per = max(1, BLOCK // len(times))
    for first in range(0, len(good), per):
        some = good[first : first + per]

        def ratios(at: Array, which: Index | slice, some: Index = some) -> Array:
            phi, psi = residuals(ensemble, some, at, states[some][:, which])
            return over_allowed(ensemble.model, phi, psi, scale[some], size[some], np.maximum(speed, 1e-3 * size)[some])

        for row, wrong, found in off_states(ratios, times, breaks[some]):
            text = described(ensemble.model, found, float(times[wrong]), allowed, rtol)
            texts.setdefault(int(some[row]), (wrong, text))
    return texts


def _largest(ensemble: Batch, times: Array, states: Array, known: Array | None) -> tuple[Array, Array, Array]:
    """Find the largest residuals in position and velocity (K, equation) over the times, and the largest speeds (K,)."""
    layout, index = ensemble.model.layout, ensemble.model.evaluators["drift"].index
    if known is None:
        found = _evaluated(ensemble, times, states)
    else:
        found = np.maximum(known, _evaluated(ensemble, times[:1], states[:, :1]))
        rest = np.flatnonzero(np.isnan(known).any(axis=1))
        if len(rest):
            found[rest] = _evaluated(ensemble.select(rest), times, states[rest])
    residuals, first = np.zeros((2, len(states), layout.constraints)), 0
    for which, letter in enumerate(("phi", "psi")):
        if letter in index:
            _, (rows,) = index[letter]
            residuals[which][:, rows] = found[:, first : first + len(rows)]
            first += len(rows)
    return residuals[0], residuals[1], found[:, -1]


def _evaluated(ensemble: Batch, times: Array, states: Array) -> Array:
    """Evaluate the largest residuals, in position, then in velocity, and the largest speeds: (K, residual + 1)."""
    layout, drift = ensemble.model.layout, ensemble.model.evaluators["drift"]
    program = drift.program(layout.width + 2, ensemble.block.shape[1], range(layout.velocities, layout.width))
    count = len(times)
    flat, zero = states.reshape(-1, layout.width), Columns(np.zeros((1, 1)))
    largest = program.largest(flat, Columns(times), zero, Columns(ensemble.block, count), states=count)
    columns = [drift.index[letter][0] for letter in ("phi", "psi") if letter in drift.index]
    speed = largest[:, len(drift.targets) :].max(axis=1, initial=0.0)
    return np.concatenate([largest[:, np.concatenate(columns)], speed[:, None]], axis=1)


def allowed_residual(rtol: float) -> float:
    """Return the allowed residual, over the size or the speed of the mechanism."""
    return min(MOST, max(LEAST, OFF * rtol))


def described(model: Model, ratios: Array, time: float, allowed: float, rtol: float) -> str:
    """Return a message on a state that violates constraints, from its ratios (equation,) to the allowed residual."""
    return (
        f"the state at t = {time:.6g} s violates the constraints {named(model, np.flatnonzero(ratios > 1.0))}, by "
        f"{allowed * float(ratios.max()):.2g} of the size or the speed of the mechanism (allowed: {allowed:.2g}). "
        f"Try another integrator, or a smaller rtol (now {rtol:g})"
    )


def off_states(
    ratios: Callable[[Array, Index | slice], Array], times: Array, breaks: Array
) -> Iterator[tuple[int, int, Array]]:
    """Yield row, time index and ratios (equation,) of states off the constraints.

    At a break, only a state off the constraints of both sides counts.
    """
    found = ratios(times, slice(None))
    for row, k in np.argwhere((found > 1.0).any(axis=2)).tolist():
        delta = instant(float(times[k]))
        if np.any(np.abs(breaks[row] - times[k]) <= 2 * delta):
            one = np.array([k])
            if min(float(ratios(times[one] + side, one)[row].max()) for side in (-delta, delta)) <= 1.0:
                continue
        yield row, k, found[row, k]


def residuals(ensemble: Batch, members: Index, times: Array, states: Array) -> tuple[Array, Array]:
    """Return residuals in position and velocity of states (M, T, width), each of shape (M, T, equation)."""
    (count, number, width), drift = states.shape, ensemble.model.evaluators["drift"]
    block, zero = Columns(ensemble.block[members], number), Columns(np.zeros((1, 1)))
    values = drift.program(width + 2, block.data.shape[1])(states.reshape(-1, width), Columns(times), zero, block)
    found = np.zeros((2, count * number, ensemble.model.layout.constraints))
    for which, letter in enumerate(("phi", "psi")):
        if letter in drift.index:
            columns, (rows,) = drift.index[letter]
            found[which][:, rows] = values[:, columns]
    phi, psi = found.reshape(2, count, number, -1)
    return phi, psi


def over_allowed(model: Model, phi: Array, psi: Array, scale: Array, size: Array, speed: Array) -> Array:
    """Return residuals over allowed residuals, (M, T, equation); zero for omitted equations and unknown states."""
    ratios = np.maximum(np.abs(phi) / size[:, None, None], np.abs(psi) / speed[:, None, None]) / scale[:, None]
    kept = np.zeros(ratios.shape[2], dtype=bool)
    kept[model.layout.kept] = True
    found: Array = np.where(kept & np.isfinite(ratios), ratios, 0.0)
    return found
