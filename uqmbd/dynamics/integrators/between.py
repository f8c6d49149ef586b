"""The motion between output times by integrators that do not return their steps: through states at more times.

Evenly spaced times between the breaks of a realisation are doubled until polynomials of degree 7 through every second
of its states agree with the others.  What is not resolved by as many as there may be, as the jump of a velocity in an
impact, is a straight line from one time to the next.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from uqmbd.compiled import PLACES, Path
from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.integration import Counters, Trajectories, path_through, settled, stops
from uqmbd.typing import Array, Mask

__all__ = ["with_motion_between"]

Method = Callable[[Ensemble, Array, float], Trajectories]

FIRST, MOST = 256, 1 << 14
"""Intervals of time that are tried first, and at most."""

LEAST = 16
"""Intervals between two breaks, at least."""

ENOUGH = 25.0
"""Tolerances by which polynomials through every second state may differ from the others: by 2^8 less through all."""

BESIDE = 4
"""Intervals on each side of one that is not resolved whose polynomials see it."""


def with_motion_between(method: Method, ensemble: Ensemble, times: Array, rtol: float) -> Trajectories:
    """Integrate an ensemble, and find its motion between the output times.

    Parameters
    ----------
    method : callable
        From an ensemble, times and a relative tolerance to trajectories.
    ensemble : Ensemble
        K realisations.
    times : array, shape (T,)
        Output times, s.
    rtol : float
        Relative tolerance.
    """
    count, width = len(ensemble), ensemble.model.layout.width
    states = np.full((count, len(times), width), np.nan)
    messages, counters, notes = [""] * count, Counters(), list[str]()
    scalars, paths = dict[str, Array](), list[Path]()
    # whoever has the same breaks shares its times with nobody else
    _, which = np.unique(np.nan_to_num(ensemble.breaks, nan=np.inf), axis=0, return_inverse=True)
    for group in range(int(which.max(initial=-1)) + 1):
        left, intervals = np.flatnonzero(which.ravel() == group), FIRST
        edges = np.array([times[0], *stops(ensemble.breaks[left[:1]], times).tolist(), times[-1]])
        while len(left):
            stretches = [_even(begin, end, times, intervals) for begin, end in zip(edges[:-1], edges[1:], strict=True)]
            every = np.unique(np.concatenate([times, *stretches]))
            found = method(ensemble.select(left), every, rtol)
            pieces, rough = list[Path](), np.zeros(len(left), dtype=np.bool_)
            for grid in stretches:
                path, resolved = _smooth(grid, found.states[:, np.searchsorted(every, grid)], rtol)
                pieces.append(path)
                rough |= ~resolved
            failed = np.array([bool(message) for message in found.messages])
            done = np.flatnonzero(~rough | failed | (intervals >= MOST))
            mine = left[done]
            states[mine] = found.states[np.ix_(done, np.searchsorted(every, times))]
            for k, member in zip(done.tolist(), mine.tolist(), strict=True):
                messages[member] = found.messages[k]
            for name, values in found.scalars.items():
                scalars.setdefault(name, np.full(count, np.nan))[mine] = values[done]
            numbers = np.full(len(left), -1)
            numbers[done] = mine
            for path in (piece.placed(numbers) for piece in pieces):
                paths.append(path._replace(states=settled(ensemble, path.owner, path.ends, path.states)))
            counters = counters + found.counters
            notes += [note for note in found.notes if note not in notes]
            left, intervals = np.delete(left, done), 2 * intervals
    found = Trajectories(times, states, tuple(messages), counters, scalars, tuple(notes))
    return replace(found, path=Path.joined(paths))


def _even(begin: float, end: float, times: Array, intervals: int) -> Array:
    """Evenly spaced times of a stretch, an even number of intervals."""
    share = (end - begin) / float(times[-1] - times[0])
    return np.linspace(begin, end, 1 + max(LEAST, 2 * round(share * intervals / 2)))


def _smooth(grid: Array, states: Array, rtol: float) -> tuple[Path, Mask]:
    """Return polynomials through states (M, S, width), straight where they are not smooth, and who is all smooth."""
    members = np.arange(len(states))
    path = path_through(grid, states, None, members)
    coarse = path_through(grid[::2], states[:, ::2], None, members)
    shape = (len(states), -1, len(PLACES), states.shape[2])
    middle = _between(coarse.states.reshape(shape), 0.5)
    scale = np.maximum(np.abs(states).max(axis=1), 1e-3)[:, None]
    wrong = (np.abs(middle - states[:, 1::2]) / scale).max(axis=2)
    bad = np.repeat(~(wrong <= ENOUGH * rtol), 2, axis=1)
    spread = bad.copy()
    for k in range(1, BESIDE + 1):
        spread[:, k:] |= bad[:, :-k]
        spread[:, :-k] |= bad[:, k:]
    straight = states[:, :-1, None] + PLACES[:, None] * (states[:, 1:] - states[:, :-1])[:, :, None]
    values = np.where(spread[:, :, None, None], straight, path.states.reshape(shape))
    return path._replace(states=values.reshape(path.states.shape)), np.asarray(~bad.any(axis=1))


def _between(states: Array, part: float) -> Array:
    """Value of polynomials at a part of each step, by barycentric interpolation."""
    weights = np.where(np.arange(len(PLACES)) % 2, -1.0, 1.0) / (part - PLACES)
    weights[[0, -1]] *= 0.5
    return np.asarray(np.einsum("j,mijw->miw", weights / weights.sum(), states))
