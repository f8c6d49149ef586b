"""What every integration is held against: constraints that are the same from one instant to the next, and are kept."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from uqmbd.dynamics.assembly.rank import named
from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.equations.model import Model
from uqmbd.dynamics.integration.prescribed import gradient_lengths, instant, position_jumps
from uqmbd.dynamics.integration.restarts import Drift
from uqmbd.dynamics.integration.trajectories import Trajectories
from uqmbd.dynamics.projection.ensemble import ProjectedEnsemble
from uqmbd.typing import Array, Index

__all__ = ["checked", "off_constraints", "projected_off"]

Method = Callable[[Ensemble, Array, float], Trajectories]

OFF = 100.0
"""Tolerances by which a result may be off the constraints: coordinates over the size of the mechanism, velocities over
the largest one."""
LEAST, MOST = 1e-6, 1e-2
"""The same at least and at most."""
BLOCK = 2048
"""States whose residuals are evaluated at once."""


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
    off = off_constraints(ensemble, times, found.states, rtol)
    texts = {k: text for k, text in off.items() if not found.messages[k]}
    if not texts:
        return found
    states, messages = found.states.copy(), list(found.messages)
    for k, (first, text) in texts.items():
        # the start is a state that could be assembled: the integration has failed, not the assembly
        states[k, max(1, first) :], messages[k] = np.nan, text
    return replace(found, states=states, messages=tuple(messages))


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
    return replace(found, states=states, messages=tuple(messages), scalars=scalars)


def off_constraints(ensemble: Ensemble, times: Array, states: Array, rtol: float) -> dict[int, tuple[int, str]]:
    """Find results that are off the constraints, in position or in velocity, by more than the tolerance.

    At a break time the constraints of either side count.

    Parameters
    ----------
    ensemble : Ensemble
        K realisations.
    times : array, shape (T,)
        Output times, s.
    states : array, shape (K, T, width)
        NaN where there are none.
    rtol : float
        Relative tolerance.

    Returns
    -------
    dict of int to (int, str)
        By realisation: the number of the first time at which that is so, and what to say.
    """
    layout = ensemble.model.layout
    good = np.flatnonzero(np.isfinite(states[:, 0]).all(axis=1))
    if not layout.rank or not len(good):
        return {}
    velocities = layout.coordinates + layout.states
    size = np.clip(np.abs(states[:, 0, : layout.coordinates]).max(axis=1), 1e-3, 1.0)
    speed = np.nanmax(np.abs(states[..., velocities:]), axis=(1, 2), initial=0.0)
    allowed = _allowed(rtol)
    scale = allowed * gradient_lengths(ensemble)
    breaks, texts = ensemble.breaks, dict[int, tuple[int, str]]()
    per = max(1, BLOCK // len(times))
    for first in range(0, len(good), per):
        some = good[first : first + per]

        def ratios(at: Array, which: Index | slice, some: Index = some) -> Array:
            phi, psi = _residuals(ensemble, some, at, states[some][:, which])
            return _over(ensemble.model, phi, psi, scale[some], size[some], np.maximum(speed, 1e-3 * size)[some])

        for row, wrong, found in _wrong(ratios, times, breaks[some]):
            text = _text(ensemble.model, found, float(times[wrong]), allowed, rtol)
            texts.setdefault(int(some[row]), (wrong, text))
    return texts


def projected_off(projected: ProjectedEnsemble, times: Array, coefficients: Array, rtol: float) -> tuple[int, str]:
    """Find where coefficients are off the projected constraints by more than the tolerance.

    Parameters
    ----------
    projected : ProjectedEnsemble
        What was integrated.
    times : array, shape (T,)
        s.
    coefficients : array, shape (P, T, width)
        NaN where there are none.
    rtol : float
        Relative tolerance of the integration.

    Returns
    -------
    int, str
        The number of the first such time, and what to say; 0 and nothing if there is none.
    """
    ensemble, layout = projected.ensemble, projected.model.layout
    if not layout.rank:
        return 0, ""
    nodes, velocities = np.arange(len(ensemble)), layout.coordinates + layout.states
    # of the means: the first polynomial is one
    size = np.clip(np.abs(ensemble.start.q).max(keepdims=True).ravel(), 1e-3, 1.0)
    speed = np.nanmax(np.abs(coefficients[..., velocities:]), initial=0.0)
    allowed = _allowed(rtol)
    scale = allowed * gradient_lengths(ensemble).mean(axis=0, keepdims=True)
    breaks = ensemble.breaks.reshape(1, -1)
    per = max(1, BLOCK // len(ensemble))
    for first in range(0, len(times), per):
        part = slice(first, first + per)

        def ratios(at: Array, which: Index | slice, part: slice = part) -> Array:
            nodal = projected.nodal(coefficients[:, part][:, which])
            # an equation of the coefficients: its largest one
            phi, psi = (np.abs(projected.project(x)).max(axis=0)[None] for x in _residuals(ensemble, nodes, at, nodal))
            return _over(projected.model, phi, psi, scale, size, np.maximum(speed, 1e-3 * size))

        for _, wrong, found in _wrong(ratios, times[part], breaks):
            return first + wrong, _text(projected.model, found, float(times[first + wrong]), allowed, rtol)
    return 0, ""


def _allowed(rtol: float) -> float:
    return min(MOST, max(LEAST, OFF * rtol))


def _text(model: Model, ratios: Array, time: float, allowed: float, rtol: float) -> str:
    return (
        f"the state at t = {time:.6g} s is off the constraints {named(model, np.flatnonzero(ratios > 1.0))}, by "
        f"{allowed * float(ratios.max()):.2g} of the size or the speed of the mechanism (allowed: {allowed:.2g}). "
        f"Try another integrator, or a smaller rtol (now {rtol:g})"
    )


def _wrong(
    ratios: Callable[[Array, Index | slice], Array], times: Array, breaks: Array
) -> Iterator[tuple[int, int, Array]]:
    """Yield row, time and ratios (equation,) of states that are off the constraints of either side of a break time."""
    found = ratios(times, slice(None))
    for row, k in np.argwhere((found > 1.0).any(axis=2)).tolist():
        delta = instant(float(times[k]))
        if np.any(np.abs(breaks[row] - times[k]) <= 2 * delta):
            one = np.array([k])
            if min(float(ratios(times[one] + side, one)[row].max()) for side in (-delta, delta)) <= 1.0:
                continue
        yield row, k, found[row, k]


def _residuals(ensemble: Ensemble, members: Index, times: Array, states: Array) -> tuple[Array, Array]:
    """Residuals in position and velocity of states (M, T, width), each of shape (M, T, equation)."""
    count, number, width = states.shape
    block = np.repeat(ensemble.block[members], number, axis=0)
    phi, psi = Drift(ensemble.model)(states.reshape(-1, width), np.tile(times, count), block)
    return phi.reshape(count, number, -1), psi.reshape(count, number, -1)


def _over(model: Model, phi: Array, psi: Array, scale: Array, size: Array, speed: Array) -> Array:
    """Residuals over what is allowed, shape (M, T, equation); zero where equations are left out or states unknown."""
    ratios = np.maximum(np.abs(phi) / size[:, None, None], np.abs(psi) / speed[:, None, None]) / scale[:, None]
    kept = np.zeros(ratios.shape[2], dtype=bool)
    kept[model.layout.kept] = True
    found: Array = np.where(kept & np.isfinite(ratios), ratios, 0.0)
    return found
