"""Integration from sample to sample by any integrator, between instants at which controllers change states."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from uqmbd.compiled import RecordedSteps
from uqmbd.dynamics.assembly import Start
from uqmbd.dynamics.control import Sampling
from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.integration import Counters, Trajectories, instant, speed_jumps
from uqmbd.dynamics.linear import accelerations
from uqmbd.dynamics.projection import ProjectedEquations, ProjectedStart, ProjectedTrajectories, Watch
from uqmbd.typing import Array, Index

__all__ = ["projected_in_samples", "interval_times", "trajectories_in_samples"]

Method = Callable[[Ensemble, Array, float], Trajectories]
ProjectedMethod = Callable[[ProjectedEquations, Array, float], ProjectedTrajectories]

WATCHED = 20
"""Number of calls of the observer of a projected integration."""


def interval_times(sampling: Sampling, times: Array) -> list[Array]:
    """Return the times of the integrations between instants, s: begins, output times inside, and ends."""
    edges = [*sampling.times.tolist(), float(times[-1])]
    return [
        np.array([begin, *times[(times > begin) & (times < end)], end])
        for begin, end in zip(edges[:-1], edges[1:], strict=True)
    ]


def trajectories_in_samples(method: Method, ensemble: Ensemble, times: Array, rtol: float) -> Trajectories:
    """Integrate K realisations with controllers at output times (T,) in s, by a method without controller support.

    If an output time is a sample, its state is the state right after the sample.
    """
    start, width, velocities = ensemble.start, ensemble.model.layout.width, ensemble.model.layout.velocities
    sampling = Sampling(ensemble, times)
    states = np.full((len(ensemble), len(times), width), np.nan)
    messages, counters, notes = list(start.messages), Counters(), list[str]()
    happened: dict[int, dict[str, list[float]]] = {}
    paths = list[RecordedSteps | None]()
    alive, now = np.flatnonzero(start.ok), start.state[start.ok]
    for number, grid in enumerate(interval_times(sampling, times)):
        begin = float(grid[0])
        # jumps of prescribed motions precede samples, so that controllers measure the new values
        change, reasons = speed_jumps(ensemble.model, now, begin, ensemble.block[alive], rtol)
        now[:, velocities:] += change
        alive, now = _active(messages, alive, now, reasons)
        if not len(alive):
            break
        now, reasons = sampling.after(number, now, alive)
        change, more = sampling.jumps(begin, now, alive)
        now[:, velocities:] += change
        alive, now = _active(messages, alive, now, more | reasons)
        if not len(alive):
            break
        at = np.flatnonzero(times == begin)
        states[np.ix_(alive, at)] = now[:, None]
        if len(grid) < 2 or grid[-1] <= begin:
            break
        part = _continued(ensemble, alive, begin, now)
        for row, message in zip(alive.tolist(), part.start.messages, strict=True):
            messages[row] = message
        found = method(part, grid, rtol)
        inside = np.flatnonzero((times > begin) & (times <= grid[-1]))
        states[np.ix_(alive, inside)] = found.states[:, 1 : 1 + len(inside)]
        counters = _joined(counters, found.counters)
        paths.append(None if found.path is None else found.path.placed(alive))
        notes += [note for note in found.notes if note not in notes]
        _note(happened, found.scalars, alive, begin if number else -np.inf)
        alive, now = _active(messages, alive, found.states[:, -1], dict(enumerate(found.messages)))
    scalars, path = _times_of(happened, len(ensemble)), RecordedSteps.joined(paths)
    return Trajectories(times, states, tuple(messages), counters, scalars, tuple(notes), path=path)


def _active(messages: list[str], alive: Index, now: Array, reasons: dict[int, str]) -> tuple[Index, Array]:
    """Store the reasons of failed rows as messages; return the other realisations, and their states (K, width)."""
    for row, reason in reasons.items():
        messages[alive[row]] = reason
    going = np.array([not messages[k] for k in alive], dtype=bool)
    return alive[going], now[going]


def projected_in_samples(
    method: ProjectedMethod, projected: ProjectedEquations, times: Array, rtol: float, watch: Watch | None = None
) -> ProjectedTrajectories:
    """Integrate coefficients, with controllers at the nodes, by a method without controller support.

    The function of a controller is called with the measurements at the nodes; its nodal commands and states are
    projected like all moving quantities.  The callable `watch` is called repeatedly with the coefficients so far.
    """
    ensemble, layout = projected.ensemble, projected.model.layout
    sampling, every = Sampling(ensemble, times), np.arange(len(projected.ensemble))
    coefficients = np.full((projected.terms, len(times), layout.width), np.nan)
    now, message, integrator, requested = projected.start.state.copy(), "", "none", 0
    counters: dict[str, Any] = {}
    for number, grid in enumerate(interval_times(sampling, times)):
        begin = float(grid[0])
        now[:, layout.velocities :] += projected.impulse(now, begin, rtol)
        nodal = projected.psi @ now
        after, reasons = sampling.after(number, nodal, every)
        held = slice(layout.velocities - layout.states, layout.velocities)
        # unchanged values must keep their bits
        changed = (after[:, held] != nodal[:, held]).any(axis=0)
        now[:, held][:, changed] = projected.adjoint @ after[:, held][:, changed]
        change, more = sampling.jumps(begin, after, every, nodal)
        if not reasons and np.any(change):
            now[:, layout.velocities :] += projected.follow(now, begin + instant(begin))
        if reasons := more | reasons:
            node, text = next(iter(reasons.items()))
            message = f"at node {node} {text}"
            break
        coefficients[:, times == begin] = now[:, None]
        if grid[-1] <= begin:
            break
        found = method(_continued_projection(projected, begin, now), grid, rtol)
        inside = np.flatnonzero((times > begin) & (times <= grid[-1]))
        coefficients[:, inside] = found.coefficients[:, 1 : 1 + len(inside)]
        integrator = found.integrator if found.integrator != "none" else integrator
        counters = {
            key: counters.get(key, 0) + x if isinstance(x, (int, float)) else x
            for key, x in {**dict.fromkeys(counters, 0), **found.counters}.items()
        }
        now, message = found.coefficients[:, -1].copy(), found.message
        if message:
            break
        if watch is not None and len(inside) and inside[-1] * WATCHED // len(times) > requested:
            requested = int(inside[-1]) * WATCHED // len(times)
            if watch(coefficients):
                break
    return ProjectedTrajectories(times, coefficients, message, integrator, counters)


def _continued(ensemble: Ensemble, members: Index, time: float, states: Array) -> Ensemble:
    """Return the ensemble of the selected realisations with a start time in s and initial states (M, width)."""
    model = ensemble.model.between_samples(time)
    q, s, v = model.layout.split(states)
    a, multipliers, rates = accelerations(model, q, s, v, time, ensemble.block[members])
    lost = np.asarray(~np.isfinite(a).all(axis=1)).tolist()
    messages = tuple(f"the accelerations are not determined at t = {time:.6g} s" if x else "" for x in lost)
    start = Start(q, s, v, a, rates, multipliers, messages, np.zeros(len(q), dtype=bool))
    paths = None if ensemble.paths is None else ensemble.paths.select(members)
    return Ensemble(model, ensemble.values[members], start=start, paths=paths)


def _continued_projection(projected: ProjectedEquations, time: float, state: Array) -> ProjectedEquations:
    """Return the projected ensemble with a start time in s and initial coefficients (P, width)."""
    ensemble = _continued(projected.ensemble, np.arange(len(projected.ensemble)), time, projected.psi @ state)
    a, multipliers, _ = projected.accelerations(state, time)
    return projected.continued(ensemble, ProjectedStart(state, a, multipliers, 0))


def _joined(one: Counters, other: Counters) -> Counters:
    """Join the counters of two consecutive integrations of the same realisations."""
    by = {key: max(getattr(one, key), getattr(other, key)) for key in ("by_dop853", "by_ida", "by_radau")}
    return replace(one + other, **by)


def _note(
    happened: dict[int, dict[str, list[float]]], scalars: Mapping[str, Array], members: Index, since: float
) -> None:
    """Collect times of events of one interval, without contacts that are closed at its start."""
    for name, times in scalars.items():
        for row, time in zip(members.tolist(), times.tolist(), strict=True):
            if np.isfinite(time) and time > since:
                happened.setdefault(row, {}).setdefault(name.rpartition(" ")[0], []).append(time)


def _times_of(happened: Mapping[int, Mapping[str, list[float]]], count: int) -> dict[str, Array]:
    """Return the times of all events by name, numbered over all intervals."""
    found: dict[str, Array] = {}
    for row, events in happened.items():
        for name, times in events.items():
            for number, time in enumerate(sorted(times), start=1):
                found.setdefault(f"{name} {number}", np.full(count, np.nan))[row] = time
    return found
