"""Report slow integrations, with tiny steps, while they run.

A report depends on the clock and is therefore not part of the results. The logger ``uqmbd.realisations`` and the
standard error receive it.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable

import numpy as np

from uqmbd.compiled import ExplicitStatus, IntegrationState
from uqmbd.dynamics.equations import Model
from uqmbd.logs import tell
from uqmbd.typing import Array
from uqmbd.wording import format_duration

__all__ = ["Pace", "fastest_body"]

PATIENCE = 5.0
"""Wall time in seconds before the first check of an integration, and between the first two checks of a realisation.
Each further check is at four times the wall time since the start."""

LONG = 600.0
"""Estimated remaining wall time in seconds, at the rate since the last check, that triggers a report."""


class Pace:
    """Monitor of an integration from `begin` to `end`, s; it reports time and cause if the end is far away.

    The clock `now` returns seconds, and `say` receives a report; tests replace both.
    """

    def __init__(
        self,
        model: Model,
        begin: float,
        end: float,
        *,
        now: Callable[[], float] = clock.monotonic,
        say: Callable[[str], None] = tell,
    ) -> None:
        self.model, self.begin, self.end = model, begin, end
        self._now, self._say = now, say
        self._since = self._last = now()
        self._next, self._reached, self._steps = PATIENCE, begin, 0
        self._seen: object = None

    @property
    def due(self) -> bool:
        """Whether a check is due."""
        return self._now() - self._since >= self._next

    def check(self, time: float, state: Array, steps: int, which: object = None) -> None:
        """Check the slowest realisation, given its time in s, its state (q, s, v), its steps so far, and its number.

        The rate follows from two checks of the same realisation.
        """
        instant = self._now()
        spent, lasted = instant - self._since, instant - self._last
        if which != self._seen:
            self._seen, self._last, self._reached, self._steps = which, instant, time, steps
            self._next = spent + PATIENCE
            return
        gained, taken = max(time - self._reached, 0.0), steps - self._steps
        self._last, self._reached, self._steps, self._next = instant, max(time, self._reached), steps, 4 * spent
        rest = self.end - time
        left = rest / gained * lasted if gained > 0 else np.inf
        if not rest > 0 or left < LONG:
            return
        share = 100 * (time - self.begin) / (self.end - self.begin)
        size = f", of {gained / taken:.1g} s each" if gained > 0 and taken > 0 else ""
        name, motion = fastest_body(self.model, state)
        body = f"{name} moves the fastest: {motion}. " if name else ""
        days = left / 86400
        wait = "it makes no progress"
        if np.isfinite(left):
            lasting = f"{days:.3g} days" if days > 2 else format_duration(left, rough=True)
            wait = f"the rest would take {lasting}"
        self._say(
            f"mechanism {self.model.name!r}: after {spent:.0f} s the integration is at t = {time:.6g} s of "
            f"{self.end:.6g} s ({share:.2g} %), in {max(taken, 0)} steps since the last check{size}; at this rate "
            f"{wait}. {body}Usual reasons are very stiff springs, tiny masses, unbounded speeds, or an end time "
            "far beyond the periods of the motion. Ctrl-C ends the run."
        )

    def watch(self, run: IntegrationState) -> None:
        """Check the realisations in the driver."""
        if not self.due or run.dynamics.terms:
            return
        # realisations that wait for a lane have made no step
        running = np.flatnonzero((run.status == ExplicitStatus.RUNNING) & (run.steps > 0))
        if len(running):
            member = int(running[np.argmin(run.now[running])])
            self.check(float(run.now[member]), run.z[member], int(run.steps[member]), (id(run), member))


def fastest_body(model: Model, state: Array) -> tuple[str, str]:
    """Return name and speed of the fastest body in a state (q, s, v) as text; empty if no speed is finite."""
    first, size, dimension = model.layout.velocities, model.size, model.dimension
    count = len(model.bodies)
    speeds = np.asarray(state[first : first + count * size], dtype=float)
    if not count or speeds.size != count * size or not np.isfinite(speeds).any():
        return "", ""
    of_bodies = np.nan_to_num(speeds.reshape(count, size), posinf=np.inf)
    along = np.linalg.norm(of_bodies[:, :dimension], axis=1)
    # the rate of a unit quaternion, or of half an angle, is half the angular velocity
    turning = 2 * np.linalg.norm(of_bodies[:, dimension:], axis=1)
    body = int(np.argmax(along + model.length * turning))
    words = f"{along[body]:.3g} m/s" + (f", {turning[body]:.3g} rad/s" if size > dimension else "")
    return f"Body {model.bodies[body]!r}", words
