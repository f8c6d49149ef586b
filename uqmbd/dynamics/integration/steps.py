"""Recorded steps: polynomials of degree 7 for the motion between times with known states.

SciPy's interpolants through values and rates have degree 3, or degree 5 with known second derivatives. The error of an
integrator is far below the error of such a polynomial over one step.
"""

from __future__ import annotations

import numpy as np

from uqmbd.compiled import PLACES, RecordedSteps
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.linear import excess
from uqmbd.typing import Array, Index

__all__ = ["interpolate_steps", "projected_steps"]


ALONE = 8
"""Number of neighbouring states that determine a polynomial without rates; with rates, four states suffice."""

APART = 0.5
"""Least distance between the times of a polynomial, relative to its step; short steps amplify noise in states."""


INSIDE = 1e-12
"""Offset into a step, relative to the time, at which constraints are evaluated."""


def interpolate_steps(
    times: Array, states: Array, rates: Array | None, owner: Index, end: float | None = None
) -> RecordedSteps:
    """Return the motion from each time to the next, on an interval with a smooth motion.

    Times (S,) in s are increasing. Realisations with numbers `owner` (M,) share the times, and have states and optional
    rates (M, S, width).  The interval ends at `end`, s; default: the last time.
    """
    if len(times) < 2:
        none = np.zeros((0, len(PLACES), states.shape[2]))
        return RecordedSteps(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros(0, dtype=bool), none)
    last = times[1:].copy()
    last[-1] = last[-1] if end is None else min(end, float(last[-1]))
    places = PLACES * ((last - times[:-1]) / np.diff(times))[:, None]
    found = np.zeros((len(states), len(last), len(PLACES), states.shape[2]))
    for some, window in _even_windows(len(times)) if rates is None else _separated_windows(times):
        found[:, some] = _polynomials(times, states, rates, some, window, places[some])
    members = len(states)
    ends = np.broadcast_to(np.stack([times[:-1], last], axis=1), (members, len(last), 2)).reshape(-1, 2)
    flat = found.reshape(-1, *found.shape[2:])
    return RecordedSteps(np.repeat(owner, len(last)), ends.copy(), np.zeros(len(flat), dtype=bool), flat)


def projected_steps(batch: Batch, owner: Index, ends: Array, states: Array) -> Array:
    """Project states (P, 8, width) of steps of realisations `owner` (P,) onto the constraints.

    The states are at `PLACES` between the beginning and the end of each step, `ends` (P, 2), s.
    """
    model = batch.model
    if not model.layout.rank or model.system is None or model.system.programs is None or not len(owner):
        return states
    shape, owner, begin, end = states.shape, np.repeat(owner, len(PLACES)), ends[:, :1], ends[:, 1:]
    # forces may jump at the ends of a step
    margin = np.minimum(INSIDE * np.maximum(1.0, np.maximum(np.abs(begin), np.abs(end))), 0.5 * (end - begin))
    times = np.clip(begin + (end - begin) * PLACES, begin + margin, end - margin).ravel()
    states = states.reshape(len(owner), -1).copy()
    q, v = excess(model, states, times, batch.block[owner])
    n, first = model.layout.coordinates, model.layout.velocities
    states[:, :n] -= np.where(np.isfinite(q), q, 0.0)
    states[:, first:] -= np.where(np.isfinite(v), v, 0.0)
    return states.reshape(shape)


def _even_windows(count: int) -> list[tuple[Index, Index]]:
    """Return the intervals between evenly spaced times, and their neighbouring times, (interval, neighbour)."""
    number, most = np.arange(count - 1), min(ALONE, count)
    return [(number, np.clip(number - (most - 2) // 2, 0, count - most)[:, None] + np.arange(most))]


def _separated_windows(times: Array) -> list[tuple[Index, Index]]:
    """Return intervals between the times of steps, with the times of their polynomials: ends and distant further times.

    Intervals with the same number of times are returned together.
    """
    number, far = np.arange(len(times) - 1), APART * np.diff(times)

    def before(chosen: Index) -> Index:
        return np.where(chosen < 0, -1, np.searchsorted(times, times[chosen] - far, side="right") - 1)

    def after(chosen: Index) -> Index:
        known = np.minimum(chosen, len(times) - 1)
        return np.where(chosen < len(times), np.searchsorted(times, times[known] + far), len(times))

    left, right = before(number), after(number + 1)
    # at the ends of the interval, all further times are on the same side
    earlier = np.where(right < len(times), -1, before(left))
    later = np.where(left < 0, after(right), len(times))
    chosen = np.stack([earlier, left, number, number + 1, right, later], axis=1)
    there = (chosen >= 0) & (chosen < len(times))
    counts = there.sum(axis=1)
    return [
        (some, chosen[some][there[some]].reshape(len(some), -1))
        for some in (np.flatnonzero(counts == count) for count in np.unique(counts).tolist())
    ]


def _polynomials(times: Array, states: Array, rates: Array | None, some: Index, window: Index, places: Array) -> Array:
    """Evaluate polynomials through states and rates at relative places of the selected intervals."""
    length = np.diff(times)[some]
    at = (times[window] - times[some, None]) / length[:, None]
    found = np.zeros((len(states), len(some), len(PLACES), states.shape[2]))
    for j in range(window.shape[1]):
        others = np.delete(np.arange(window.shape[1]), j)
        apart = at[:, j, None] - at[:, others]
        basis = np.ones_like(places)
        for k, other in enumerate(others.tolist()):
            basis *= (places - at[:, other, None]) / apart[:, k, None]
        value, slope = basis, np.zeros_like(basis)
        if rates is not None:
            beside = places - at[:, j, None]
            value = (1 - 2 * np.sum(1 / apart, axis=1)[:, None] * beside) * basis**2
            slope = beside * basis**2 * length[:, None]
        found += value[None, :, :, None] * states[:, window[:, j], None]
        if rates is not None:
            found += slope[None, :, :, None] * rates[:, window[:, j], None]
    return found
