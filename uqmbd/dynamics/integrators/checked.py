"""What every integration is held against: constraints that are the same from one instant to the next, and are kept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from uqmbd.dynamics.assembly import violated
from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.integration import Trajectories, off_constraints, position_jumps
from uqmbd.typing import Array

__all__ = ["checked"]

Method = Callable[[Ensemble, Array, float], Trajectories]


def checked(method: Method, ensemble: Ensemble, times: Array, rtol: float) -> Trajectories:
    """Integrate by any method; realisations whose positions would have to jump, or are off the constraints, fail.

    Parameters
    ----------
    method : callable
        From an ensemble, output times and a relative tolerance to trajectories.
    ensemble : Ensemble
        K realisations.
    times : array, shape (T,)
        Output times, s.
    rtol : float
        Relative tolerance.

    Returns
    -------
    Trajectories
        Of all realisations.
    """
    jumps = position_jumps(ensemble, times, rtol)
    found = method(ensemble, times, rtol) if not jumps else _others(method, ensemble, times, rtol, jumps)
    found = _stopped(found, _violations(ensemble, times, found.states, rtol), 0)
    # the start is a state that could be assembled: the integration has failed, not the assembly
    return _stopped(found, off_constraints(ensemble, times, found.states, rtol, found.off), 1)


def _stopped(found: Trajectories, off: dict[int, tuple[int, str]], least: int) -> Trajectories:
    """Let realisations fail from a time on, not before that of number `least`."""
    texts = {k: text for k, text in off.items() if not found.messages[k]}
    if not texts:
        return found
    states, messages = found.states.copy(), list(found.messages)
    for k, (first, text) in texts.items():
        states[k, max(least, first) :], messages[k] = np.nan, text
    return replace(found, states=states, messages=tuple(messages))


def _violations(ensemble: Ensemble, times: Array, states: Array, rtol: float) -> dict[int, tuple[int, str]]:
    """Find violations of equations that were left out as redundant."""
    model = ensemble.model
    if model.layout.rank == model.layout.constraints:
        return {}
    return violated(model, times, states, ensemble.block, ensemble.gradient_lengths, rtol)


def _others(method: Method, ensemble: Ensemble, times: Array, rtol: float, jumps: dict[int, str]) -> Trajectories:
    """Integrate the realisations that are left."""
    start, layout, count = ensemble.start, ensemble.model.layout, len(ensemble)
    states = np.full((count, len(times), layout.width), np.nan)
    failed = np.array(sorted(jumps), dtype=np.int64)
    states[failed, 0] = np.concatenate([start.q, start.s, start.v], axis=1)[failed]
    messages = [jumps.get(k, "") for k in range(count)]
    rest = np.setdiff1d(np.arange(count), failed)
    if not len(rest):
        return Trajectories(times, states, tuple(messages))
    found = method(ensemble.select(rest), times, rtol)
    states[rest] = found.states
    for k, message in zip(rest.tolist(), found.messages, strict=True):
        messages[k] = message
    scalars = {}
    for name, values in found.scalars.items():
        scalars[name] = np.full(count, np.nan)
        scalars[name][rest] = values
    off = None if found.off is None else np.full((count, found.off.shape[1]), np.nan)
    if off is not None and found.off is not None:
        off[rest] = found.off
    path = None if found.path is None else found.path.placed(rest)
    return replace(found, states=states, messages=tuple(messages), scalars=scalars, off=off, path=path)
