"""Clocks: angles or oscillations whose phase grows with time, for the comparison of realisations at equal phase.

References
----------
X. Wan and G. E. Karniadakis, Computer Methods in Applied Mechanics and Engineering 195 (2006) 5582-5596 (long-term
behaviour of chaoses).
D. M. Luchtenburg, S. L. Brunton and C. W. Rowley, Journal of Computational Physics 274 (2014) 783-802.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uqmbd.arguments import Size, typechecked
from uqmbd.errors import StudyError
from uqmbd.propagation.chaos.dense_output import Dense, spline_through
from uqmbd.propagation.chaos.swings import Swing, passing
from uqmbd.typing import Array, Mask

__all__ = ["TURN", "Clock", "Phases"]


TURN = 2 * np.pi
LEAST_TURNS = 1.0
"""Minimum number of turns of a clock in a realisation: fewer turns do not require an alignment."""

SETTLING_TURNS = 5.0
"""Minimum number of turns of a clock that comes to rest: with fewer turns the phases hardly drift apart."""

STEADY = 1e-3
"""Minimum ratio of the smallest to the mean rate of a clock: below it, times of equal phase are far apart.

Near a separatrix, a motion is slow close to the saddle. With this value, the Kraichnan-Orszag problem has elements at
equal phase down to xi = 1e-3, which sixteen points per quarter turn resolve. With 0.02, the error of the variance is
ten times as large.
"""


@typechecked
@dataclass(frozen=True)
class Clock:
    """An angle or an oscillation whose phase replaces the time.

    Attributes
    ----------
    name : str
        Name of the output or the body.
    row : int
        Index of the watched output.
    turn : float
        Length of a turn, in the units of the output; negative for a backward rotation. 0 for an oscillation, with the
        phase in the plane of value and rate.
    start : float
        Phase near the initial phase of the realisations, rad. This phase selects one of several phases that differ by
        whole turns.

    Examples
    --------
    >>> import numpy as np
    >>> import uqmbd
    >>> times = np.linspace(0, 2, 21)
    >>> turning = np.array([6.0, 7.0])[:, None, None] * times  # two realisations of one angle, rad
    >>> found = uqmbd.extend.Dense(times, turning, error=0.0)
    >>> clock = uqmbd.extend.Clock("angle", row=0, turn=2 * np.pi)
    >>> clock.words
    "the angle 'angle'"
    >>> clock.phases(found).at(1.0).round(6).tolist()
    [6.0, 7.0]
    """

    name: str
    row: Size
    turn: float
    start: float = 0.0

    @property
    def words(self) -> str:
        """Describe the clock."""
        return f"the angle {self.name!r}" if self.turn else f"the oscillation of {self.name!r}"

    @property
    def kinds(self) -> tuple[Clock, ...]:
        """Return clocks for the possible kinds of phase: forward rotation, backward rotation, or oscillation."""
        return (self, replace(self, turn=-self.turn), replace(self, turn=0.0)) if self.turn else (self,)

    def phases(self, found: Dense, near: Array | None = None) -> Phases:
        """Read the phases (K, T) of realisations, rad.

        Parameters
        ----------
        found : Dense
            Realisations with their outputs as functions of time.
        near : array, shape (K,), optional
            Phases near which realisations start, rad, for an oscillation. Default: `start`.

        Returns
        -------
        Phases
            Phases of all realisations.
        """
        values = found.values[:, self.row]
        if self.turn:
            return Phases(found.times, values / self.turn * TURN)
        near = np.full(len(values), self.start) if near is None else near
        swings = []
        for own, begin in zip(values, near, strict=True):
            swing = Swing.of(found.times, own, found.through(own))
            swings.append(swing and swing.moved(-float(np.round((swing.values[0] - begin) / TURN))))
        nothing = np.zeros(len(found.times))
        return Phases(found.times, np.stack([s.values if s else nothing for s in swings]), tuple(swings))

    def fitted(self, found: Dense) -> Clock:
        """Return the clock with the sense of rotation of most realisations, and an origin near their start."""
        phase = self.phases(found).values
        if self.turn:
            return replace(self, turn=self.turn * float(np.sign(np.median(phase[:, -1] - phase[:, 0])) or 1.0))
        return replace(self, start=float(np.angle(np.exp(1j * phase[:, 0]).mean())))


@typechecked
@dataclass(frozen=True, eq=False)
class Phases:
    """Phases of K realisations.

    Attributes
    ----------
    times : array, shape (T,)
        Times, s.
    values : array, shape (K, T)
        Phases, rad.
    swings : tuple, length K
        Oscillation of each realisation, or None if it does not oscillate; empty for angles.

    Examples
    --------
    >>> import numpy as np
    >>> import uqmbd
    >>> times = np.linspace(0, 2, 21)
    >>> phases = uqmbd.extend.Phases(times, np.array([6.0, 7.0])[:, None] * times)
    >>> phases.running(2.0).tolist()
    [True, True]
    >>> phases.reaching(21.0).round(6).tolist()  # s
    [3.5, 3.0]
    >>> phases.passed(0, np.array([3.0, 6.0])).round(6).tolist()  # of the first realisation
    [0.5, 1.0]
    """

    times: Array
    values: Array
    swings: tuple[Swing | None, ...] = ()

    def running(self, end: float) -> Mask:
        """Return a mask of the realisations whose phase grows until a time, s, or until it stops, shape (K,).

        The phase makes at least one turn, and its rate does not become very small before this time. The amplitude of an
        oscillation changes slowly.
        """
        even = np.array([swing is not None and swing.even for swing in self.swings] or [True])
        rests = np.array([swing is not None and swing.rests and swing.rest <= end for swing in self._swings])
        turns = np.where(rests, SETTLING_TURNS, LEAST_TURNS)
        return np.asarray(even & (self._turned(end) >= turns * TURN) & (self._least(end) >= STEADY))

    @property
    def lasting(self) -> Array:
        """Return the phases (K,) in rad of the last extremes before rest; inf for phases that do not stop."""
        return np.array([s.last if s is not None and s.rests else np.inf for s in self._swings])

    def passed(self, k: Size, marks: Array) -> Array:
        """Return the times (S,) at which one realisation passes given phases, s; NaN for phases out of reach.

        Parameters
        ----------
        k : int
            Index of the realisation.
        marks : array, shape (S,)
            Increasing phases, rad; those of an oscillation are multiples of a quarter turn.

        Returns
        -------
        array, shape (S,)
            Times, s.

        Raises
        ------
        uqmbd.StudyError
            If there is no such realisation.
        """
        if k >= len(self.values):
            raise StudyError(
                f"Phases.passed: k is {k}; expected the number of a realisation, from 0 to {len(self.values) - 1}."
            )
        if self.swings:
            swing = self.swings[k]
            return np.full(len(marks), np.nan) if swing is None else swing.passed(marks)
        phase, times = self.values[k], self.times
        highest = np.maximum.accumulate(phase)
        spline = spline_through(times, phase)
        right = np.clip(np.searchsorted(highest, marks), 1, len(times) - 1)
        at = passing(spline, spline.derivative(), marks, times[right - 1], times[right])
        return np.where(marks <= highest[-1], at, np.nan)

    def at(self, time: float) -> Array:
        """Return the phases (K,) at a time, rad."""
        return np.array([np.interp(time, self.times, row) for row in self.values])

    def reaching(self, phase: float) -> Array:
        """Estimate the times (K,) of a phase in s, by extrapolation of the final motion; inf if out of reach."""
        if self.swings:
            return np.array([np.inf if s is None else s.reaching(phase, float(self.times[-1])) for s in self.swings])
        last = self.values[:, -1]
        back = max(2, len(self.times) // 8)
        rate = (last - self.values[:, -back]) / (self.times[-1] - self.times[-back])
        mean = (last - self.values[:, 0]) / (self.times[-1] - self.times[0])
        runs = rate > STEADY * np.abs(mean)
        behind = np.where(runs, np.maximum(phase - last, 0.0) / np.where(runs, rate, 1.0), np.inf)
        return np.asarray(self.times[-1] + np.where(self.values.max(axis=1) >= phase, 0.0, behind))

    def steadiness(self, end: float) -> float:
        """Return the ratio of the smallest to the mean phase rate until a time in s, in the worst realisation."""
        return float(self._least(end).min())

    @property
    def _swings(self) -> tuple[Swing | None, ...]:
        return self.swings or (None,) * len(self.values)

    def _until(self, end: float) -> Array:
        return self.values[:, : max(2, int(np.searchsorted(self.times, end * (1 - 1e-12))) + 1)]

    def _turned(self, end: float) -> Array:
        phase = self._until(end)
        return np.asarray(phase[:, -1] - phase[:, 0])

    def _least(self, end: float) -> Array:
        """Return the ratio (K,) of smallest to mean phase rate; after a start from rest, omit the first quarter turn.

        For an oscillation, the ratio refers to the interval between the first and the last extreme.
        """
        phase = self._until(end)
        times = self.times[: phase.shape[1]]
        begins = np.array([-np.inf if s is None else s.begin for s in self._swings])[:, None]
        rests = np.array([np.inf if s is None else s.rest for s in self._swings])[:, None]
        counts = (times[:-1] >= begins) & (times[1:] <= rests)
        duration = np.minimum(times[-1], rests[:, 0]) - times[0]
        mean = self._turned(end) / np.where(duration > 0, duration, np.inf)
        steps = np.diff(phase, axis=1) / np.diff(times) / np.where(mean == 0, np.inf, mean)[:, None]
        started = phase[:, 1:] - phase[:, :1] > TURN / 4
        forwards = ((steps > 0) | ~counts).all(axis=1)
        return np.where(forwards, np.where(started & counts, steps, np.inf).min(axis=1), -1.0)
