"""Motion between output times, from states at more times, for integrators that do not return their steps.

A realisation is integrated at evenly spaced times in time spans, initially the spans between its breaks.  A span is
resolved if polynomials of degree 7 through every second state agree with the other states. If states jump between two
times, such as velocities at an impact, the span is divided on both sides of the jump. The part with the jump is divided
until it is short, and its motion is then a straight line. The number of times in other unresolved spans is doubled.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uqmbd.compiled import PLACES, RecordedSteps
from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.integration import Counters, Trajectories, interpolate_steps, projected_steps, stops
from uqmbd.typing import Array, Index

__all__ = ["with_motion_between"]

Method = Callable[[Ensemble, Array, float], Trajectories]

FIRST, MOST = 256, 1 << 14
"""Initial and largest number of time intervals."""

LEAST = 16
"""Least number of intervals of a span."""

ROUNDS = 64
"""Largest number of integrations of a realisation."""

SHORT, SHORTEST = 0.1, 1e-9
"""Shortest interval that is divided, relative to the whole time: `SHORT` times the tolerance, at least `SHORTEST`."""

ENOUGH = 25.0
"""Allowed error of polynomials through every second state, in tolerances: 2^8 times the error with all states."""

BESIDE = 4
"""Number of neighbours on each side of an unresolved interval whose polynomials depend on it."""

ALONE = 8.0
"""Least ratio, at a jump, of the unpredicted change of states in an interval to that in the neighbouring intervals."""


class _TimeSpan(NamedTuple):
    """Time span and its number of intervals, which is even or one."""

    begin: float
    end: float
    intervals: int

    @property
    def times(self) -> Array:
        return np.linspace(self.begin, self.end, self.intervals + 1)


class _IntervalRun(NamedTuple):
    """Integration of a group of realisations: motion in each span, and result of `_smooth`."""

    spans: tuple[_TimeSpan, ...]
    found: Trajectories
    pieces: list[RecordedSteps]
    wrong: list[Array]

    def longest(self, k: int) -> float:
        """Return the longest interval with an unresolved motion of one realisation, s."""
        every = zip(self.spans, self.wrong, strict=True)
        return max((s.end - s.begin) / s.intervals if off[k, 0].any() else 0.0 for s, off in every)


def with_motion_between(method: Method, ensemble: Ensemble, times: Array, rtol: float) -> Trajectories:
    """Integrate K realisations by `method`, and compute their motion between the output times (T,), s.

    A UserWarning reports that the largest number of times does not resolve the motion of a realisation without failure.
    The warning also reports that the integrator fails at a larger number of times; the previous motion remains valid.
    """
    count, counters, notes = len(ensemble), Counters(), list[str]()
    kept, coarse = dict[int, tuple[_IntervalRun, int]](), np.zeros(count)
    waiting, short = _first(ensemble.breaks, times), max(SHORT * rtol, SHORTEST) * float(times[-1] - times[0])
    for turn in range(ROUNDS):
        following = dict[tuple[_TimeSpan, ...], list[int]]()
        for spans, members in waiting.items():
            run = _run(method, ensemble.select(np.array(members)), times, spans, rtol, short)
            counters = counters + run.found.counters
            notes += [note for note in run.found.notes if note not in notes]
            for k, member in enumerate(members):
                failed = bool(run.found.messages[k])
                if failed and member in kept:
                    before, j = kept[member]
                    coarse[member] = before.longest(j)
                    continue
                kept[member], finer = (run, k), _divided(spans, [off[k] for off in run.wrong], short)
                if failed or finer == spans:
                    continue
                if sum(span.intervals for span in finer) > MOST or turn == ROUNDS - 1:
                    coarse[member] = run.longest(k)
                else:
                    following.setdefault(finer, []).append(member)
        waiting = following
    if coarse.any():
        warnings.warn(
            f"mechanism {ensemble.model.name!r}: the motion between output times is not resolved in "
            f"{np.count_nonzero(coarse)} of {count} realisations. It is interpolated linearly on intervals of up "
            f"to {coarse.max():.3g} s. More than {MOST} further times would be necessary there, or the integrator "
            "fails at further times. Try a shorter motion or another integrator.",
            stacklevel=2,
        )
    states = np.full((count, len(times), ensemble.model.layout.width), np.nan)
    messages, scalars, paths = [""] * count, dict[str, Array](), list[RecordedSteps]()
    for run in {id(run): run for run, _ in kept.values()}.values():
        numbers = np.full(len(run.found.messages), -1)
        for member, (its, k) in kept.items():
            if its is run:
                numbers[k], messages[member] = member, run.found.messages[k]
        done = np.flatnonzero(numbers >= 0)
        states[numbers[done]] = run.found.states[np.ix_(done, np.searchsorted(run.found.times, times))]
        for name, values in run.found.scalars.items():
            scalars.setdefault(name, np.full(count, np.nan))[numbers[done]] = values[done]
        for path in (piece.placed(numbers) for piece in run.pieces):
            paths.append(path._replace(states=projected_steps(ensemble, path.owner, path.ends, path.states)))
    found = Trajectories(times, states, tuple(messages), counters, scalars, tuple(notes))
    return replace(found, path=RecordedSteps.joined(paths))


def _run(
    method: Method, ensemble: Ensemble, times: Array, spans: tuple[_TimeSpan, ...], rtol: float, short: float
) -> _IntervalRun:
    """Integrate realisations with the same spans."""
    every = np.unique(np.concatenate([times, *(span.times for span in spans)]))
    found = method(ensemble, every, rtol)
    pieces, wrong = list[RecordedSteps](), list[Array]()
    for span in spans:
        path, off = _smooth(span.times, found.states[:, np.searchsorted(every, span.times)], rtol, short)
        pieces.append(path)
        wrong.append(off)
    return _IntervalRun(spans, replace(found, times=every), pieces, wrong)


def _first(breaks: Array, times: Array) -> dict[tuple[_TimeSpan, ...], list[int]]:
    """Return the spans between breaks, and the realisations with these spans."""
    found = dict[tuple[_TimeSpan, ...], list[int]]()
    for member, row in enumerate(breaks):
        edges = [float(times[0]), *stops(row[None], times).tolist(), float(times[-1])]
        part = FIRST / 2 / (edges[-1] - edges[0])
        every = zip(edges[:-1], edges[1:], strict=True)
        spans = tuple(_TimeSpan(begin, end, max(LEAST, 2 * round(part * (end - begin)))) for begin, end in every)
        found.setdefault(spans, []).append(member)
    return found


def _divided(spans: tuple[_TimeSpan, ...], wrong: list[Array], short: float) -> tuple[_TimeSpan, ...]:
    """Return finer spans where `_smooth` reports unresolved intervals."""
    found = list[_TimeSpan]()
    for span, (bad, unpredicted) in zip(spans, wrong, strict=True):
        if not bad.any():
            found.append(span)
            continue
        jumps, times = _jumps(unpredicted), span.times
        if not len(jumps):
            found.append(span._replace(intervals=2 * span.intervals))
            continue
        for low, high in _pairs([0, *np.unique([jumps, jumps + 1]).tolist(), span.intervals]):
            begin, end = float(times[low]), float(times[high])
            found.append(_TimeSpan(begin, end, 1 if end - begin <= short else max(LEAST, 2 * ((high - low + 1) // 2))))
    return tuple(found)


def _pairs(edges: list[int]) -> list[tuple[int, int]]:
    return [(low, high) for low, high in zip(edges[:-1], edges[1:], strict=True) if low < high]


def _jumps(unpredicted: Array) -> Index:
    """Return the intervals in which states change unpredictably and far more than in the neighbouring intervals."""
    beside = np.maximum(np.append(unpredicted[1:], 0.0), np.insert(unpredicted[:-1], 0, 0.0))
    return np.flatnonzero((unpredicted > 1.0) & (unpredicted > ALONE * np.maximum(beside, np.median(unpredicted))))


def _unpredicted_change(states: Array) -> Array:
    """Return differences of states (M, S, width) at even times from one-sided predictions: (M, S - 1, width).

    Predictions use cubic polynomials, with lower degree near the ends; the better of the two sides counts.
    """
    sides = list[Array]()
    for side in (states, states[:, ::-1]):
        off = np.abs(np.diff(side, axis=1))
        for order in range(2, 5):
            off[:, order - 1 :] = np.abs(np.diff(side, n=order, axis=1))
        sides.append(off)
    return np.asarray(np.minimum(sides[0], sides[1][:, ::-1]))


def _smooth(grid: Array, states: Array, rtol: float, short: float) -> tuple[RecordedSteps, Array]:
    """Return polynomials through states (M, S, width), straight if not smooth, and the unresolved intervals.

    The second result (M, 2, S - 1) is a mask of unresolved intervals, and their unpredicted change in tolerances.
    """
    members = np.arange(len(states))
    path = interpolate_steps(grid, states, None, members)
    if len(grid) == 2:
        return path, np.zeros((len(states), 2, 1))
    coarse = interpolate_steps(grid[::2], states[:, ::2], None, members)
    shape = (len(states), -1, len(PLACES), states.shape[2])
    middle = _interpolate(coarse.states.reshape(shape), 0.5)
    scale = ENOUGH * rtol * np.maximum(np.abs(states).max(axis=1), 1e-3)[:, None]
    wrong = (np.abs(middle - states[:, 1::2]) / scale).max(axis=2)
    bad = np.repeat(~(wrong <= 1.0), 2, axis=1)
    spread = bad.copy()
    for k in range(1, BESIDE + 1):
        spread[:, k:] |= bad[:, :-k]
        spread[:, :-k] |= bad[:, k:]
    straight = states[:, :-1, None] + PLACES[:, None] * (states[:, 1:] - states[:, :-1])[:, :, None]
    values = np.where(spread[:, :, None, None], straight, path.states.reshape(shape))
    unpredicted = (_unpredicted_change(states) / scale).max(axis=2)
    unresolved = bad & (np.diff(grid) > short)
    return path._replace(states=values.reshape(path.states.shape)), np.stack([unresolved, unpredicted], axis=1)


def _interpolate(states: Array, part: float) -> Array:
    """Return values of polynomials at a relative position in each step, by barycentric interpolation."""
    weights = np.where(np.arange(len(PLACES)) % 2, -1.0, 1.0) / (part - PLACES)
    weights[[0, -1]] *= 0.5
    return np.asarray(np.einsum("j,mijw->miw", weights / weights.sum(), states))
