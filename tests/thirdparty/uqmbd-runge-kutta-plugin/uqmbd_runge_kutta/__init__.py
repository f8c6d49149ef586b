"""The classical Runge-Kutta method, with steps controlled by step doubling, from one impact to the next."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

import uqmbd

__all__ = ["RungeKutta"]

Array = NDArray[np.float64]

SHARE = 0.1
"""Error of a step, over the relative tolerance of the motion."""
SHORTEST = 1e-10
"""Step, over the length of the motion, that is none."""
DEEP = 1e-9
"""Guard that is zero: one that starts there does not fall through it."""


class RungeKutta:
    """Order 4; it follows impacts, as long as the bodies leave each other again."""

    name: ClassVar[str] = "runge-kutta"
    capabilities: ClassVar[uqmbd.extend.Capabilities] = uqmbd.extend.Capabilities(events=True, bounded_steps=True)

    def integrate(self, ensemble: uqmbd.extend.Ensemble, times: Array, rtol: float) -> uqmbd.extend.Trajectories:
        """Integrate one realisation after the other."""
        start = ensemble.start.state
        states = np.full((len(ensemble), len(times), start.shape[1]), np.nan)
        messages, happened, steps = list(ensemble.start.messages), {}, 0
        for k in np.flatnonzero(ensemble.start.ok).tolist():
            motion = Motion(ensemble.select(np.array([k])), times, rtol, states[k])
            messages[k], happened[k] = motion.run(start[k]), motion.happened
            steps += motion.steps
        counters = uqmbd.extend.Counters(steps=steps, events=sum(len(found) for found in happened.values()))
        scalars = ensemble.event_times(happened)
        return uqmbd.extend.Trajectories(times, states, tuple(messages), counters, scalars)


@dataclass
class Motion:
    """The motion of one realisation."""

    one: uqmbd.extend.Ensemble
    times: Array
    rtol: float
    states: Array
    happened: list[tuple[float, int, str]] = field(default_factory=list)
    steps: int = 0

    def run(self, state: Array) -> str:
        """Fill in the states at the output times; return the reason where it fails."""
        now, span = float(self.times[0]), float(self.times[-1] - self.times[0])
        self.states[0], size = state, span / 100
        for end, longest, _ in self.one.pace(self.times, self.rtol):
            while now < end:
                goal = min(end, float(self.times[self.times > now][0]))
                whole = min(size, longest)
                last = now + whole >= goal - 1e-3 * whole
                whole = goal - now if last else whole
                middle = self.step(now, state, whole / 2)
                after = self.step(now + whole / 2, middle, whole / 2)
                error = self.error(after, self.step(now, state, whole))
                parts = [(now, state, middle), (now + whole / 2, middle, after)]
                sunk = (
                    error <= 1 and self.sunk(now + whole, after) and not any(self.falls(*p, whole / 2) for p in parts)
                )
                if not error <= 1 or sunk:
                    size = 0.3 * whole
                    if size < SHORTEST * span:
                        why = "bodies stay together" if sunk else "the step size falls to nothing"
                        return f"the motion stops at t = {now:.6g} s: {why}"
                    continue
                self.steps += 1
                if not last or error > 0:
                    size = whole * float(np.clip(0.9 * max(error, 1e-12) ** -0.2, 0.2, 4.0))
                moment, event, state = self.first(parts, whole / 2, after)
                now = goal if event < 0 and last else moment
                if event >= 0:
                    self.happened.append((now, event, self.one.events[event][1]))
                if event >= 0 and self.one.events[event][2]:
                    closed = self.one.guards(now, state[None]) <= DEEP
                    state = self.one.after_impact(now, state[None], closed)[0]
                self.states[self.times == now] = state
        return ""

    def step(self, time: float, state: Array, size: float) -> Array:
        """One step of the classical method, put onto the constraints."""
        inner = 1e-14 * max(1.0, abs(time))  # what is prescribed may jump where an interval ends

        def rate(at: float, z: Array) -> Array:
            return np.asarray(self.one.rates(min(max(at, time + inner), time + size - inner), z[None])[0])

        a = rate(time, state)
        b = rate(time + size / 2, state + size / 2 * a)
        c = rate(time + size / 2, state + size / 2 * b)
        d = rate(time + size, state + size * c)
        after = state + size / 6 * (a + 2 * b + 2 * c + d)
        return np.asarray(self.one.on_constraints(time + size, after[None])[0])

    def error(self, better: Array, worse: Array) -> float:
        """Estimated error of a step, over what is allowed."""
        size = np.maximum(np.abs(better), max(1e-3, float(np.abs(better).max())) * 0.1)
        return float(np.max(np.abs(better - worse) / (15 * SHARE * self.rtol * size)))

    def sunk(self, time: float, state: Array) -> bool:
        """Tell whether bodies overlap."""
        gaps = self.one.guards(time, state[None])[0]
        return any(gap < -DEEP for gap, (*_, impact) in zip(gaps, self.one.events, strict=True) if impact)

    def falls(self, time: float, before: Array, after: Array, size: float) -> list[int]:
        """Events whose guards fall through zero in a step."""
        first, last = (self.one.guards(at, z[None])[0] for at, z in ((time, before), (time + size, after)))
        return [int(k) for k in np.flatnonzero((first > DEEP) & (last <= 0))]

    def first(self, parts: list[tuple[float, Array, Array]], size: float, after: Array) -> tuple[float, int, Array]:
        """Time, number and state of the first event in a step of two parts; without one its end, and -1."""
        for time, before, then in parts:
            found = [(self.moment(time, before, size, event), event) for event in self.falls(time, before, then, size)]
            if found:
                length, event = min(found)
                return time + length, event, self.step(time, before, length)
        return parts[-1][0] + size, -1, after

    def moment(self, time: float, before: Array, size: float, event: int) -> float:
        """How long after the begin of a step a guard is zero."""

        def guard(length: float) -> float:
            there = self.step(time, before, length) if length > 0 else before
            return float(self.one.guards(time + length, there[None])[0, event])

        length: Any = brentq(guard, 0.0, size, xtol=1e-14)
        return float(length)


@uqmbd.hookimpl
def uqmbd_integrators() -> list[type[uqmbd.extend.Integrator]]:
    """Return the integrator of this package."""
    return [RungeKutta]
