"""Clocks: phases of a motion that grow in all realisations, at equal values of which they are compared.

References
----------
X. Wan and G. E. Karniadakis, SIAM Journal on Scientific Computing 28 (2006) 901-928 (long-term behaviour of chaoses).
D. M. Luchtenburg, S. L. Brunton and C. W. Rowley, Journal of Computational Physics 274 (2014) 783-802.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import sympy

from uqmbd.errors import StudyError
from uqmbd.propagation.chaos.dense import Dense
from uqmbd.propagation.problem import Problem
from uqmbd.typing import Array, Mask

__all__ = ["Clock", "Phases", "choose_clock", "require_clock", "watched_angles"]


TURN = 2 * np.pi
LEAST_TURNS = 1.0
"""Turns that a clock makes in every realisation, at least: in less there is nothing to align."""

WATCHED = "angle_of_"
"""Before the name of a body or joint whose angle is watched."""

STEADY = 0.02
"""Least rate of a clock, over its mean one: below it nearly stands, and times of equal phase are far apart."""


@dataclass(frozen=True)
class Clock:
    """What the phase of a realisation is read from.

    Attributes
    ----------
    name : str
        Of the output, or of the body.
    row : int
        Of the watched outputs.
    turn : float
        Length of a turn, in the units of the output; negative where it turns backwards; 0: it oscillates, and the
        phase is that of value and rate.
    start : float
        Phase near which realisations start, rad: which of the phases that differ by whole turns is meant.
    """

    name: str
    row: int
    turn: float
    start: float = 0.0

    @property
    def words(self) -> str:
        """What it is."""
        return f"the angle {self.name!r}" if self.turn else f"the oscillation of {self.name!r}"

    def phases(self, found: Dense, end: float) -> Phases:
        """Read the phases (K, T) of realisations, rad; `end` is the last time that counts for an oscillation."""
        values = found.values[:, self.row]
        phase = values / self.turn * TURN if self.turn else self._swinging(found, values, end)
        return Phases(found.times, phase)

    def _swinging(self, found: Dense, values: Array, end: float) -> Array:
        """Phases in the plane of value and rate, both centred and scaled in each realisation."""
        within = found.times <= end * (1 + 1e-12)
        rate = np.stack([found.spline(k).derivative()(found.times)[:, self.row] for k in range(len(values))])
        low, high = values[:, within].min(axis=1, keepdims=True), values[:, within].max(axis=1, keepdims=True)
        fastest = np.abs(rate[:, within]).max(axis=1, keepdims=True)
        centred = (values - (low + high) / 2) / _divisor((high - low) / 2)
        phase = np.unwrap(np.arctan2(-rate / _divisor(fastest), centred), axis=1)
        return np.asarray(phase - TURN * np.round((phase[:, :1] - self.start) / TURN))

    def fitted(self, found: Dense, end: float) -> Clock:
        """Return the clock that runs forwards in most of some realisations, and starts near where these do."""
        phase = self.phases(found, end).values
        if self.turn:
            return replace(self, turn=self.turn * float(np.sign(np.median(phase[:, -1] - phase[:, 0])) or 1.0))
        return replace(self, start=float(np.angle(np.exp(1j * phase[:, 0]).mean())))


@dataclass(frozen=True, eq=False)
class Phases:
    """Phases of K realisations.

    Attributes
    ----------
    times : array, shape (T,)
        s.
    values : array, shape (K, T)
        rad.
    """

    times: Array
    values: Array

    def running(self, end: float) -> Mask:
        """Say in which realisations the clock runs until a time, shape (K,): makes a turn, and never nearly stands."""
        return np.asarray((self._turned(end) >= LEAST_TURNS * TURN) & (self._least(end) >= STEADY))

    def at(self, time: float) -> Array:
        """Return the phases (K,) at a time, rad."""
        return np.array([np.interp(time, self.times, row) for row in self.values])

    def lacking(self, phase: float) -> float:
        """Return how much longer it takes until all have reached a phase, s, if they go on as they do at the end."""
        last = self.values[:, -1]
        back = max(2, len(self.times) // 8)
        rate = (last - self.values[:, -back]) / (self.times[-1] - self.times[-back])
        missing = np.maximum(phase - last, 0.0)
        return float((missing / np.maximum(rate, 1e-12)).max(initial=0.0))

    def steadiness(self, end: float) -> float:
        """Return the least rate over the mean one, of the worst realisation, until a time."""
        return float(self._least(end).min())

    def _until(self, end: float) -> Array:
        return self.values[:, : max(2, int(np.searchsorted(self.times, end * (1 - 1e-12))) + 1)]

    def _turned(self, end: float) -> Array:
        phase = self._until(end)
        return np.asarray(phase[:, -1] - phase[:, 0])

    def _least(self, end: float) -> Array:
        """Least rate (K,) over the mean one; a motion that starts at rest counts from its first quarter turn on."""
        phase, turned = self._until(end), self._turned(end)
        steps = np.diff(phase, axis=1) * (phase.shape[1] - 1) / np.where(turned == 0, np.inf, turned)[:, None]
        started = phase[:, 1:] - phase[:, :1] > TURN / 4
        return np.where((steps > 0).all(axis=1), np.where(started, steps, np.inf).min(axis=1), -1.0)


def watched_angles(mechanism: Any) -> Mapping[str, Any]:
    """Return the angles of all bodies and joints that have one, by the names of these, as expressions."""
    found: dict[str, Any] = {}
    for part in (*mechanism.bodies.values(), *mechanism.components.values()):
        angle = getattr(part, "angle", None)
        if isinstance(angle, sympy.Expr) and angle.free_symbols:
            found[WATCHED + part.name] = angle
    return found


def choose_clock(problem: Problem, found: Dense, end: float, wanted: str | None) -> tuple[Clock | None, str]:
    """Choose what tells the phase in all realisations, or as many as possible; else say why there is none.

    An angle that grows comes before an oscillation; of several the steadiest.

    Parameters
    ----------
    problem : uqmbd.Problem
        That of the study.
    found : Dense
        Realisations, with what is watched.
    end : float
        Last time of the study, s.
    wanted : str, optional
        Name of an output, a body or a joint; default: whatever serves.

    Raises
    ------
    uqmbd.StudyError
        If there is nothing of the wanted name.
    """
    known = _candidates(problem) if wanted is None else [require_clock(problem, wanted)]
    good = np.isfinite(found.values).all(axis=(1, 2))
    if not good.any():
        return None, "all realisations failed"
    seen = Dense(found.times, found.values[good], found.error)
    best: tuple[tuple[float, bool, float], Clock] | None = None
    # an angle may oscillate, too
    for clock in [*known, *(Clock(c.name, c.row, 0.0) for c in known if c.turn)]:
        clock = clock.fitted(seen, end)
        phases = clock.phases(seen, end)
        share = float(phases.running(end).mean())
        rank = (round(share, 3), bool(clock.turn), phases.steadiness(end))
        if share > 0 and (best is None or rank > best[0]):
            best = rank, clock
    if best is not None:
        return best[1], ""
    what = f"neither does {wanted!r}" if wanted else f"none of {', '.join(repr(c.name) for c in known)} does"
    return None, f"a clock turns or swings on, without standing, for a turn at least in some realisation; {what}"


def require_clock(problem: Problem, wanted: str) -> Clock:
    """Return the clock of a name.

    Raises
    ------
    uqmbd.StudyError
        If there is nothing of that name.
    """
    known = {clock.name: clock for clock in reversed(_candidates(problem))}
    if wanted not in known:
        raise StudyError(
            f"{problem.label}: clock is {wanted!r}; expected the name of an output, or of a body or joint that has an "
            f"angle: {', '.join(map(repr, reversed(known)))}."
        )
    return known[wanted]


def _candidates(problem: Problem) -> list[Clock]:
    """Return whatever may be a clock: outputs, then the angles that are watched."""
    outputs = problem.labels.outputs
    names = [o.name.removeprefix(WATCHED) for o in problem.watching().labels.outputs[len(outputs) :]]
    return [
        *(Clock(o.name, k, _turn(o.units, o.turn)) for k, o in enumerate(outputs)),
        *(Clock(name, len(outputs) + k, TURN) for k, name in enumerate(names)),
    ]


def _turn(units: str, turn: float) -> float:
    if turn:
        return turn
    return {"rad": TURN, "deg": 360.0}.get(units, 0.0)


def _divisor(scale: Array) -> Array:
    return np.where(scale == 0, 1.0, scale)
