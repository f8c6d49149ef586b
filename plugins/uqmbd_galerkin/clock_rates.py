"""The clock of a projected motion: its phase is the independent variable, so that its rate at states is needed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

import uqmbd
from uqmbd.typing import Array

__all__ = ["PILOTS", "TURN", "ClockRates", "find_clock", "watched_rates"]


TURN = 2 * np.pi

FIRST, SECOND = "clock_rate_of_", "clock_acceleration_of_"
"""Prefixes of the name of a possible clock: its first and second derivative in time."""

TOGETHER, APART = 1e-9, np.pi
"""Phases, rad, by which nodes differ, between which they are brought to the same one."""

PILOTS = 8
"""Realisations, at least, from which the clock is found."""

AT_REST = 0.3
"""Rate of an angle at the start, over that a radian later, below which the motion is started in time."""

STARTED = 1.0
"""Angle, rad, that is passed in time where the motion starts at rest: the time per angle is infinite there."""


def watched_rates(mechanism: Any) -> Mapping[str, Any]:
    """Return possible clocks in addition to the outputs, and the rates of all, as expressions by name."""
    found = dict(uqmbd.extend.watched_angles(mechanism))
    known = {name: output.expression for name, output in mechanism.outputs.items()} | found
    for name, expression in known.items():
        rate = expression
        for prefix in (FIRST, SECOND):
            try:
                rate = uqmbd.time_derivative(rate)
            except uqmbd.StudyError:
                # what has accelerations or reactions in it, or in its rate, is no clock
                break
            if not rate.free_symbols:
                break
            found[prefix + name] = rate
    return found


@dataclass(frozen=True, eq=False)
class ClockRates:
    """Phase rates (K,), rad/s, at the nodes, as a function of times (K,) and states (K, width)."""

    clock: uqmbd.extend.Clock  # that of the realisations
    ensemble: uqmbd.extend.Ensemble  # the nodes; watched outputs follow those of the study
    rows: tuple[int, int, int]  # of value, rate and second rate among the outputs
    centre: float
    """Centre of the value; `reach` and `speed` scale value and rate of an oscillation, alike in all realisations."""
    reach: float
    speed: float
    until: float  # time up to which the motion is integrated in time, s: the start, or later for a start at rest

    def __call__(self, times: Array, states: Array) -> Array:
        """Return rates (K,), rad/s."""
        value, rate, second = self._seen(times, states)
        if self.clock.turn:
            return np.asarray(rate * (TURN / self.clock.turn))
        x, y = (value - self.centre) / self.reach, -rate / self.speed
        # of the angle of the point (x, y)
        return np.asarray((-x * second / self.speed - y * rate / self.reach) / (x**2 + y**2))

    def ahead(self, times: Array, states: Array, step: float) -> tuple[Array | None, float]:
        """Return the phases that nodes pass until all are at the same one, rad, shape (K,), and that phase.

        It is a multiple of `step` in the mean, and no less for anyone.  Nothing where all are at the same phase, or so
        far apart that it is not known in which turn they are.
        """
        value, rate, _ = self._seen(times, states)
        if self.clock.turn:
            phase = value / self.clock.turn * TURN
        else:
            phase = np.arctan2(-rate / self.speed, (value - self.centre) / self.reach)
            middle = np.angle(np.exp(1j * phase).mean())
            phase = middle + np.angle(np.exp(1j * (phase - middle)))
        if not TOGETHER < np.ptp(phase) < APART:
            return None, 0.0
        ahead = (np.floor(phase.max() / step) + 2) * step - phase
        return ahead, max(1, round(float(ahead.mean()) / step)) * step

    def _seen(self, times: Array, states: Array) -> Array:
        """Value, rate and second rate (3, K)."""
        return self.ensemble.outputs(times[:, None], states[:, None])[:, self.rows, 0].T


def find_clock(
    problem: uqmbd.extend.Problem, ensemble: uqmbd.extend.Ensemble, pilots: Array, wanted: str | None
) -> tuple[ClockRates, int]:
    """Choose a clock from realisations at `pilots` (K, input) up to the last output time; return it and their number.

    `wanted` names a clock. Raise StudyError if there is none, or if it stands in some realisations.
    """
    end = float(problem.times[-1])
    names = [o.name for o in problem.watching().labels.outputs]
    found, told = uqmbd.extend.dense(problem.watching(), pilots, end, 2 * len(problem.times))
    label = f"{problem.label}: alignment='phase' needs a clock"

    def rows_of(clock: uqmbd.extend.Clock) -> tuple[int, int, int] | None:
        name = names[clock.row]
        known = [names.index(x) if x in names else None for x in (FIRST + name, SECOND + name)]
        if known[0] is None or (known[1] is None and not clock.turn):
            return None
        return clock.row, known[0], known[0] if known[1] is None else known[1]

    if not told.good.all():
        raise uqmbd.StudyError(
            f"{label}, and {int((~told.good).sum())} of {len(pilots)} realisations from which it is found fail: "
            f"{told.most_frequent_reason()} Truncate the distributions."
        )
    clock, why = uqmbd.extend.choose_clock(problem, found, end, wanted)
    if clock is None:
        raise uqmbd.StudyError(
            f"{label}, and there is none: {why}. Observe an angle that grows, name it by clock=, use collocation with "
            "elements, or leave alignment out."
        )
    rows = rows_of(clock)
    if rows is None:
        what = "its acceleration" if FIRST + names[clock.row] in names else "its rate"
        raise uqmbd.StudyError(
            f"{label} whose rate at a state is known, and {clock.words} depends on what has none: {what} contains "
            "accelerations, reactions or commands. Name a position or an angle by clock=."
        )
    phases = clock.phases(found)
    runs = phases.running(end)
    if not runs.all():
        worst = pilots[int(np.argmin(runs))]
        values = ", ".join(f"{n} = {x:.6g}" for n, x in zip(problem.inputs.names, worst, strict=True))
        raise uqmbd.StudyError(
            f"{label} that runs in all realisations, and {clock.words} stands or turns back in {int((~runs).sum())} of "
            f"{len(runs)}, the first at {values}. Use Collocation(alignment='phase', elements=...), truncate the "
            f"inputs, or name another clock."
        )
    value = found.values[:, clock.row]
    low, high = value.min(axis=1), value.max(axis=1)
    rate = np.abs(found.values[:, rows[1]]).max(axis=1)
    about = float(((low + high) / 2).mean()), float(((high - low) / 2).mean()), float(rate.mean())
    return ClockRates(clock, ensemble, rows, *about, _start(clock, found, phases, rows[1])), len(
        pilots
    ) * found.integrations


def _start(clock: uqmbd.extend.Clock, found: uqmbd.extend.Dense, phases: uqmbd.extend.Phases, row: int) -> float:
    """Time up to which the motion is followed in time: an angle that starts at rest takes infinite time per phase."""
    begin = float(found.times[0])
    if not clock.turn:
        return begin
    moved = phases.values - phases.values[:, :1]
    passed = (moved >= STARTED).argmax(axis=1)
    rates = found.values[:, row] / clock.turn
    later = rates[np.arange(len(rates)), passed]
    return begin if (rates[:, 0] > AT_REST * later).all() else float(found.times[passed.max()])
