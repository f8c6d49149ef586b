"""Clock of a projected motion: its phase is the independent variable, so the phase rate at each state is required."""

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
"""Prefixes of the names of first and second time derivatives of a possible clock."""

SAME_PHASE, APART = 1e-9, np.pi
"""Nodes are shifted to the same phase if the range of their phases in rad is between these values."""

PILOTS = 8
"""Least number of realisations for the search for a clock."""

AT_REST = 0.3
"""The start is integrated over time if the rate of an angle is below this share of its rate a radian later."""

STARTED = 1.0
"""Angle in rad over which a motion from rest is integrated over time: at rest, the time per angle is infinite."""


def watched_rates(mechanism: Any) -> Mapping[str, Any]:
    """Return expressions by name: possible clocks that are no outputs, and the rates of all possible clocks."""
    found = dict(uqmbd.extend.watched_angles(mechanism))
    known = {name: output.expression for name, output in mechanism.outputs.items()} | found
    for name, expression in known.items():
        rate = expression
        for prefix in (FIRST, SECOND):
            try:
                rate = uqmbd.time_derivative(rate)
            except uqmbd.StudyError:
                # a quantity cannot be a clock if it, or its rate, contains accelerations or reactions
                break
            if not rate.free_symbols:
                break
            found[prefix + name] = rate
    return found


@dataclass(frozen=True, eq=False)
class ClockRates:
    """Phase rates (K,), rad/s, at the nodes, as a function of times (K,) and states (K, width)."""

    clock: uqmbd.extend.Clock  # clock of the realisations
    ensemble: uqmbd.extend.Ensemble  # nodes; observed quantities come after the outputs of the study
    rows: tuple[int, int, int]  # rows of value, rate and second rate among the outputs
    centre: float
    """Centre of an oscillation; `reach` and `speed` are the scales of its value and rate, equal in all realisations."""
    reach: float
    speed: float
    until: float  # end of the integration over time, s: the start time, or later if the clock starts at rest

    def __call__(self, times: Array, states: Array) -> Array:
        """Return phase rates (K,) in rad/s, at times (K,) in s and states (K, width)."""
        value, rate, second = self._value_and_rates(times, states)
        if self.clock.turn:
            return np.asarray(rate * (TURN / self.clock.turn))
        x, y = (value - self.centre) / self.reach, -rate / self.speed
        # rate of the angle of the point (x, y)
        return np.asarray((-x * second / self.speed - y * rate / self.reach) / (x**2 + y**2))

    def ahead(self, times: Array, states: Array, step: float) -> tuple[Array | None, float]:
        """Return the phases (K,) that nodes must pass to reach a common phase, and their rounded mean, in rad.

        The common phase is a multiple of `step` after the phases of all nodes. The mean is rounded to a multiple of
        `step`, at least one. Return None and 0 if all nodes have the same phase, or if their phases differ too much to
        determine their turns.
        """
        value, rate, _ = self._value_and_rates(times, states)
        if self.clock.turn:
            phase = value / self.clock.turn * TURN
        else:
            phase = np.arctan2(-rate / self.speed, (value - self.centre) / self.reach)
            middle = np.angle(np.exp(1j * phase).mean())
            phase = middle + np.angle(np.exp(1j * (phase - middle)))
        if not SAME_PHASE < np.ptp(phase) < APART:
            return None, 0.0
        ahead = (np.floor(phase.max() / step) + 2) * step - phase
        return ahead, max(1, round(float(ahead.mean()) / step)) * step

    def _value_and_rates(self, times: Array, states: Array) -> Array:
        """Return value, first and second rate (3, K) of the clock quantity."""
        return self.ensemble.outputs(times[:, None], states[:, None])[:, self.rows, 0].T


def find_clock(
    problem: uqmbd.extend.Problem, ensemble: uqmbd.extend.Ensemble, pilots: Array, wanted: str | None
) -> tuple[ClockRates, int]:
    """Choose a clock from realisations at `pilots` (K, input); return the clock and the number of integrations.

    The realisations end at the last output time. `wanted`: name of a clock. Raise StudyError if there is no clock, or
    if it stands still in some realisations.
    """
    end = float(problem.times[-1])
    names = [o.name for o in problem.watching().labels.outputs]
    found, realised = uqmbd.extend.dense(problem.watching(), pilots, end, 2 * len(problem.times))
    label = f"{problem.label}: alignment='phase' needs a clock"

    def rows_of(clock: uqmbd.extend.Clock) -> tuple[int, int, int] | None:
        name = names[clock.row]
        known = [names.index(x) if x in names else None for x in (FIRST + name, SECOND + name)]
        if known[0] is None or (known[1] is None and not clock.turn):
            return None
        return clock.row, known[0], known[0] if known[1] is None else known[1]

    if not realised.good.all():
        raise uqmbd.StudyError(
            f"{label}, but {int((~realised.good).sum())} of the {len(pilots)} realisations for its selection failed: "
            f"{realised.most_frequent_reason()} Truncate the distributions."
        )
    clock, why = uqmbd.extend.choose_clock(problem, found, end, wanted)
    if clock is None:
        raise uqmbd.StudyError(
            f"{label}, but there is none: {why}. Observe a growing angle, select it with clock=, use collocation "
            "with elements, or use alignment=None."
        )
    rows = rows_of(clock)
    if rows is None:
        what = "acceleration" if FIRST + names[clock.row] in names else "rate"
        raise uqmbd.StudyError(
            f"{label} whose rate is a function of the state, but the {what} of {clock.words} contains accelerations, "
            "reactions or commands. Select a position or an angle with clock=."
        )
    phases = clock.phases(found)
    runs = phases.running(end)
    if not runs.all():
        worst = pilots[int(np.argmin(runs))]
        values = ", ".join(f"{n} = {x:.6g}" for n, x in zip(problem.inputs.names, worst, strict=True))
        raise uqmbd.StudyError(
            f"{label} with a growing phase in all realisations, but {clock.words} stops or reverses in "
            f"{int((~runs).sum())} of {len(runs)}, first at {values}. Use Collocation(alignment='phase', "
            "elements=...), truncate the distributions, or choose another clock."
        )
    value = found.values[:, clock.row]
    low, high = value.min(axis=1), value.max(axis=1)
    rate = np.abs(found.values[:, rows[1]]).max(axis=1)
    about = float(((low + high) / 2).mean()), float(((high - low) / 2).mean()), float(rate.mean())
    return ClockRates(clock, ensemble, rows, *about, _end_over_time(clock, found, phases, rows[1])), len(
        pilots
    ) * found.integrations


def _end_over_time(
    clock: uqmbd.extend.Clock, found: uqmbd.extend.Dense, phases: uqmbd.extend.Phases, row: int
) -> float:
    """Return the end of the integration over time, s; an angle that starts at rest has infinite time per phase."""
    begin = float(found.times[0])
    if not clock.turn:
        return begin
    moved = phases.values - phases.values[:, :1]
    passed = (moved >= STARTED).argmax(axis=1)
    rates = found.values[:, row] / clock.turn
    later = rates[np.arange(len(rates)), passed]
    return begin if (rates[:, 0] > AT_REST * later).all() else float(found.times[passed.max()])
