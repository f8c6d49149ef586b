"""Guards of an event-driven integration: what may end a motion between restarts, and when it does."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.dynamics.contact.evaluator import ContactEvaluator, Contacts
from uqmbd.dynamics.contact.event_location import SAMPLES, Guard, fall
from uqmbd.dynamics.contact.lasting import CLOSED, Lasting, contact_motion
from uqmbd.dynamics.contact.pieces import EventRecord
from uqmbd.dynamics.integration import Curve
from uqmbd.typing import Array

__all__ = ["Guards"]


TINY = 1e-10
"""Gap, over the size of the mechanism, by which an interpolant may be wrong where bodies touch."""


class Guards:
    """Guards of one realisation.

    Parameters
    ----------
    evaluator : ContactEvaluator
        Of the model.
    block : array, shape (1, parameter)
        Parameters of the blocks.
    length : float
        Size of the mechanism, m.

    Attributes
    ----------
    bodies, marks : list of int
        Events in which bodies meet, and those that change nothing.
    inside : tuple of float
        Times within which the equations are evaluated: at the ends of a piece what is prescribed may jump, s.
    """

    def __init__(self, evaluator: ContactEvaluator, block: Array, length: float) -> None:
        self.evaluator, self.length = evaluator, length
        self.blocks = np.repeat(block, SAMPLES + 1, axis=0)
        self.bodies = [k for k, (*_, directions) in enumerate(evaluator.model.events) if directions]
        self.marks = [k for k, (*_, directions) in enumerate(evaluator.model.events) if not directions]
        self.inside = (-np.inf, np.inf)
        self.seen: tuple[float, Array, Contacts] | None = None

    def within(self, times: ArrayLike) -> Array:
        """Keep times within the piece: at its ends what is prescribed may jump."""
        found: Array = np.clip(np.asarray(times, dtype=float), *self.inside)
        return found

    def contacts(self, time: float, z: Array) -> Contacts:
        """Contacts of one state; the last one is remembered."""
        time = float(self.within(time))
        if self.seen is None or self.seen[0] != time or not np.array_equal(self.seen[1], z):
            self.seen = time, z.copy(), self.evaluator(np.array([time]), z[None], self.blocks[:1])
        return self.seen[2]

    def open(self, now: float, z: Array, lasting: Lasting, slow: float) -> tuple[list[Guard], float]:
        """Find what may end the motion from here, and how long the shortest flight lasts, about."""
        contacts = self.contacts(now, z)
        guards: list[Guard] = []
        shortest = np.inf
        rates = contacts.bias[0] + contacts.slope[0] @ contacts.free[0, : contacts.coordinates]
        for k in self.bodies:
            normal = contacts.normal(k)
            if k not in lasting.modes:
                resting = bool(contacts.guard[0, k] <= CLOSED * self.length)
                # below the speed that is none it does not rise: it has only been let go
                rise = float(contacts.speed[0, normal])
                rise = rise if rise > slow else 0.0
                if resting and rise > 0 and not lasting.modes and rates[normal] < 0:
                    shortest = min(shortest, -2.05 * rise / rates[normal])
                guards.append(Guard("gap", k, resting, rise))
                continue
            guards.append(Guard("lift-off", k))
            if contacts.rubs(k):
                if lasting.modes[k] == "stick":
                    guards.append(Guard("slip", k))
                else:
                    along = float(contacts.sliding(k)[0] @ lasting.headings[k])
                    guards.append(Guard("stick", k, along <= slow))
        return guards, shortest

    def _values(self, guards: list[Guard], times: Array, states: Array, lasting: Lasting) -> Array:
        """Values of guards at states (T, width), shape (guard, T)."""
        blocks, times = self.blocks[: len(times)], self.within(times)
        if not lasting.modes:
            return self.evaluator.guards(times, states, blocks)[:, [g.event for g in guards]].T
        contacts = self.evaluator(times, states, blocks)
        force = contact_motion(contacts, lasting).force
        found = np.empty((len(guards), len(times)))
        for row, guard in zip(found, guards, strict=True):
            k = guard.event
            normal, tangents = force[:, contacts.normal(k)], contacts.tangents(k)
            if guard.kind == "gap":
                row[:] = contacts.guard[:, k]
            elif guard.kind == "lift-off":
                row[:] = normal
            elif guard.kind == "slip":  # by how much friction could be larger
                row[:] = contacts.law[:, k, 1] * normal * (1 + 1e-9) - np.linalg.norm(force[:, tangents], axis=1)
            else:
                row[:] = contacts.sliding(k) @ lasting.headings[k]
        return found

    def first(
        self, guards: list[Guard], span: tuple[float, float], curve: Curve, lasting: Lasting, slow: float
    ) -> tuple[float, Guard] | None:
        """First time in a step at which a guard falls through zero."""
        if not guards:
            return None
        best: tuple[float, Guard] | None = None
        times = np.linspace(*span, SAMPLES + 1)
        values = self._values(guards, times, curve(times), lasting)

        for guard, row in zip(guards, values, strict=True):

            def value(t: float, guard: Guard = guard) -> float:
                moment = np.array([t])
                return float(self._values([guard], moment, curve(moment), lasting)[0, 0])

            tiny = {"gap": TINY * self.length, "stick": 0.1 * slow}.get(guard.kind, 0.0)
            found = fall(guard, times, row, value, tiny)
            if found is not None and (best is None or found < best[0]):
                best = found, guard
        return best

    def notes(self, begin: float, end: float, curve: Curve) -> Iterator[EventRecord]:
        """Events of a step that change nothing."""
        if not self.marks or end <= begin:
            return
        times = np.linspace(begin, end, SAMPLES + 1)
        values = self.evaluator.guards(self.within(times), curve(times), self.blocks)
        for k in self.marks:

            def value(t: float, k: int = k) -> float:
                moment = np.array([t])
                return float(self.evaluator.guards(self.within(moment), curve(moment), self.blocks[:1])[0, k])

            first = 0
            while first < SAMPLES:
                if values[first, k] <= 0:
                    first += 1
                    continue
                found = fall(Guard("gap", k), times[first:], values[first:, k], value, 0.0)
                if found is None:
                    break
                yield EventRecord(found, k, self.evaluator.model.events[k][1])
                first = int(np.searchsorted(times, found, side="right"))
