"""Integration with events: from one to the next, one realisation at a time.

Between events it is the explicit method of order 8 on the index-1 form, with projection after each step; an event is
found on the interpolant of the step in which it lies.  After an impact the motion starts anew with the velocities that
the laws of impact give.  Bounces that become ever smaller end in a contact that lasts, from which bodies may lift off,
and which sticks or slips.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.contact.contacts import CLOSED, Contacts, Lens, Mode, at_rest, heading_of, pressed, project
from uqmbd.dynamics.contact.event_location import SAMPLES, Guard, fall
from uqmbd.dynamics.contact.impacts import impact
from uqmbd.dynamics.integration import ORDER, BatchEquations, Curve, Leg, Out, Stepper, instant, pace, speed_jumps
from uqmbd.dynamics.linear import accelerations, excess
from uqmbd.typing import Array

__all__ = ["Happening", "Hybrid", "Piece"]


SLOWEST = 1e-6
"""Speed of an impact, over that of the fastest one before, from which bodies stay together."""
DEEP = 1e-6
"""Penetration at the start, over the size of the mechanism, that is no mistake of the drawing."""
TINY = 1e-10
"""Gap, over the size of the mechanism, by which an interpolant may be wrong where bodies touch."""
MOST = 10_000
"""Events of a realisation that are taken for a motion that does not end."""
CROWD = 100
"""As many events ..."""
CROWDED = 2e-3
"""... within this share of the output times let bodies stay together from a speed that `COARSER` times larger ..."""
COARSER = 4.0
COARSEST = 1e4
"""... until it is larger by this at most, or there was no event for ten such times."""
AT_ONCE = 100
"""Events of a realisation without progress in time that are."""
STEPS = 50_000
"""Most attempted steps of a realisation."""
LONGEST = 20
"""Least number of steps."""


@dataclass(frozen=True)
class Happening:
    """Something that happened to a realisation: to which event of the model, what, and when."""

    time: float
    event: int
    label: str


@dataclass(frozen=True)
class Piece:
    """A motion between two restarts.

    Attributes
    ----------
    begin, end : float
        s.
    curves : tuple of Curve
        One after the other; near the constraints, not on them.
    modes : dict
        Contacts that last throughout, and how.
    """

    begin: float
    end: float
    curves: tuple[Curve, ...]
    modes: dict[int, Mode]

    def __call__(self, times: Array) -> Array:
        """States at times (T,), shape (T, width)."""
        which = np.searchsorted([c.begin for c in self.curves[1:]], times, side="right")
        found = np.empty((len(times), len(self.curves[0].start)))
        for k in np.unique(which):
            mine = which == k
            found[mine] = self.curves[k](times[mine])
        return found


@dataclass
class Hybrid:
    """Motion of one realisation with events.

    Parameters
    ----------
    ensemble : Batch
        Of one realisation.
    times : array, shape (T,)
        Output times, s.
    rtol : float
        Relative tolerance.
    lens : Lens
        Of the model.

    Attributes
    ----------
    pieces : list of Piece
    happenings : list of Happening
        In the order of time.
    message : str
        Why it ended early, or empty.
    """

    ensemble: Batch
    times: Array
    rtol: float
    lens: Lens
    pieces: list[Piece] = field(default_factory=list)
    happenings: list[Happening] = field(default_factory=list)
    message: str = ""
    steps: int = 0
    evaluations: int = 0

    def __post_init__(self) -> None:
        model = self.model = self.ensemble.model
        layout = model.layout
        self.n, self.velocities = layout.coordinates, layout.velocities
        compiled = model.system is not None and model.system.project is not None
        self.flight = BatchEquations(model, self.ensemble.block) if compiled else None
        self.blocks = np.repeat(self.ensemble.block, SAMPLES + 1, axis=0)
        self.stepper = Stepper(self._rate, self.n, self.velocities, layout.width, max(self.rtol, 1e-13))
        self.bodies = [k for k, (*_, directions) in enumerate(model.events) if directions]
        self.marks = [k for k, (*_, directions) in enumerate(model.events) if not directions]
        self.modes: dict[int, Mode] = {}
        self.headings: dict[int, Array] = {}
        self.fastest, self.size, self.stalled = 0.0, 0.0, 0
        self.crowd, self.coarse = list[float](), 1.0
        self.seen: tuple[float, Array, Contacts] | None = None
        self.inside = (-np.inf, np.inf)
        self.legs: tuple[Leg, ...] = ()
        self.most = STEPS
        size = float(np.abs(self.ensemble.start.q[0]).max(initial=0.0))
        self.length = max(1e-3, min(1.0, size))

    # -- the whole motion --------------------------------------------------------------------------------------------
    def run(self) -> None:
        """Integrate to the last output time."""
        start = self.ensemble.start
        self.legs = pace(self.ensemble, self.times, self.rtol)
        begins = [float(self.times[0]), *(leg.end for leg in self.legs)]
        # whoever wants short steps gets as many as that takes
        self.most += int(sum((leg.end - t) / leg.longest for leg, t in zip(self.legs, begins, strict=False)))
        z = start.state[0]
        now, end = float(self.times[0]), float(self.times[-1])
        contacts = self._look(now, z)
        deep = [k for k in self.bodies if contacts.guard[0, k] < -DEEP * self.length]
        if deep:
            name, gap = self.model.events[deep[0]][0], contacts.guard[0, deep[0]]
            self.message = (
                f"{name!r}: the bodies overlap by {-gap:.3g} m at the start; draw them apart, or just touching"
            )
            return
        if overlapping := [k for k in self.bodies if contacts.guard[0, k] < 0]:
            z[: self.n] += project(contacts, dict.fromkeys(overlapping, "slip"))[0][0]
        z = self._settle(now, z)
        for stop in [*(leg.end for leg in self.legs[:-1] if leg.jumps), end]:
            self.inside = (now + instant(now), np.inf)
            z = self._cross(now, z)
            while now < stop and not self.message:
                now, z = self._piece(now, z, stop)

    def _cross(self, now: float, z: Array) -> Array:
        """State right after a time at which prescribed speeds may jump; contacts that this presses together hold."""
        change, reasons = speed_jumps(self.model, z[None], now, self.blocks[:1], self.rtol)
        if reasons:
            self.message = reasons[0]
        if self.message or not np.any(change):
            return z
        z = z.copy()
        z[self.velocities :] += change[0]
        contacts = self._look(now, z)
        closed = [k for k in self.bodies if k in self.modes or contacts.guard[0, k] <= CLOSED * self.length]
        # what did not approach before does not rebound
        law = contacts.law.copy()
        law[..., 0] = 0.0
        if (jumped := self._impact(now, replace(contacts, law=law), closed)) is None:
            return z
        z[self.velocities :] += jumped[0]
        return self._settle(now, z)

    def states(self) -> Array:
        """States at the output times, (T, width); NaN from where it ended early.  At an event: those after it."""
        found = np.full((len(self.times), self.model.layout.width), np.nan)
        # an output time that differs from that of an event by rounding is that of the event
        near = 1e-13 * np.maximum(1.0, np.abs(self.times))
        which = np.searchsorted([p.begin for p in self.pieces], self.times + near, side="right") - 1
        for k, piece in enumerate(self.pieces):
            mine = np.flatnonzero((which == k) & (self.times <= piece.end + 1e-14 * max(1.0, abs(piece.end))))
            if len(mine):
                found[mine] = self._on(self.times[mine], piece(self.times[mine]), piece.modes)
        return found

    def observed(self, times: Array, piece: Piece) -> Array:
        """States of a piece at times (T,) within it, on the constraints: (T, width)."""
        return self._on(times, piece(times), piece.modes)

    # -- between events ----------------------------------------------------------------------------------------------
    def _within(self, times: ArrayLike) -> Array:
        """Keep times within the piece: at its ends what is prescribed may jump."""
        found: Array = np.clip(np.asarray(times, dtype=float), *self.inside)
        return found

    def _look(self, time: float, z: Array) -> Contacts:
        time = float(self._within(time))
        if self.seen is None or self.seen[0] != time or not np.array_equal(self.seen[1], z):
            self.seen = time, z.copy(), self.lens(np.array([time]), z[None], self.blocks[:1])
        return self.seen[2]

    def _rate(self, time: float, z: Array, out: Out) -> None:
        self.evaluations += 1
        time = min(max(time, self.inside[0]), self.inside[1])
        if not self.modes and self.flight is not None:
            self.flight.state[:] = z
            self.flight.rate(time, out)
            return
        q, s, v = (x[None] for x in np.split(z, [self.n, self.velocities]))
        out[0][:] = v
        if self.model.layout.states or not self.modes:
            a, _, out[2][:, self.n : self.velocities] = accelerations(self.model, q, s, v, time, self.blocks[:1])
            out[1][:] = a
        if self.modes:
            out[1][:] = at_rest(self._look(time, z), self.modes, self.headings).motion[:, : self.n]

    def _on(self, times: Array, states: Array, modes: dict[int, Mode]) -> Array:
        """Put states (T, width) onto constraints and lasting contacts."""
        if not (self.model.layout.rank or modes):
            return states
        states = states.copy()
        blocks = self.blocks[:1].repeat(len(states), axis=0)
        if self.model.layout.rank and self.flight is not None:
            q, v = excess(self.model, states, times, blocks)
            states[:, : self.n] -= np.nan_to_num(q)
            states[:, self.velocities :] -= np.nan_to_num(v)
        if modes:
            q, v = project(self.lens(times, states, blocks), modes)
            states[:, : self.n] += np.nan_to_num(q)
            states[:, self.velocities :] += np.nan_to_num(v)
        return states

    def _piece(self, now: float, z: Array, stop: float) -> tuple[float, Array]:
        """Integrate to the next event that changes the motion, or to `stop`."""
        begin, curves = now, list[Curve]()
        self.inside = (now + instant(now), stop - instant(stop))
        speed = float(np.abs(z[self.velocities :]).max(initial=0.0))
        floor = np.full(len(z), self.rtol * self.length)
        floor[self.velocities :] = self.rtol * max(self.length, 1e-3 * speed)
        guards, flight_time = self._guards(now, z)
        longest = (self.times[-1] - self.times[0]) / LONGEST
        self.stepper.start(now, z)
        size = self.size or self.stepper.first_size(now, z, floor, stop - now)
        size, refused = min(size, flight_time), False
        while now < stop:
            size = min(size, longest)
            leg = next((leg for leg in self.legs if leg.end > now), self.legs[-1])
            # what the equations themselves do not want ends no piece, but a step
            goal, size = min(leg.end, stop), min(size, leg.longest)
            last = now + size > goal - 0.1 * size
            size = goal - now if last else size
            new, error = self.stepper.attempt(now, z, size, floor)
            self.steps += 1
            if self.steps > self.most or size < 1e-14 * max(abs(now), 1e-3 * (stop - begin)):
                reason = (
                    f"more than {self.most} steps" if self.steps > self.most else f"the step size fell to {size:.1g} s"
                )
                self.message = f"the integration stopped at t = {now:.6g} s: {reason}; the mechanism may be stiff"
                return stop, z
            if error >= 1.0:
                size *= max(0.2, 0.9 * error ** (-1 / ORDER)) if np.isfinite(error) else 0.2
                refused = True
                continue
            after = goal if last else now + size
            curve = self.stepper.curve(now, z, size)
            curves.append(curve)
            found = self._first(guards, now, after, curve)
            self._note(now, after if found is None else found[0], curve)
            if found is not None:
                self.pieces.append(Piece(begin, found[0], tuple(curves), dict(self.modes)))
                moment = np.array([found[0]])
                there = self._on(self._within(moment), curve(moment), self.modes)[0]
                return found[0], self._happen(found[0], there, found[1], begin)
            z = self._on(self._within([after]), new[None], self.modes)[0]
            if slow := self._turned(after, z):
                self.pieces.append(Piece(begin, after, tuple(curves), dict(self.modes)))
                return after, self._happen(after, z, slow, begin)
            self.stepper.start(after, z)
            now = after
            factor = min(5.0, 0.9 * max(error, 1e-10) ** (-1 / ORDER))
            self.size = size = size * (min(1.0, factor) if refused else factor)
            refused = False
        self.pieces.append(Piece(begin, stop, tuple(curves), dict(self.modes)))
        return stop, z

    def _turned(self, time: float, z: Array) -> Guard | None:
        """Follow the directions of sliding; a contact in space that has nearly come to rest."""
        sliders = [k for k, mode in self.modes.items() if mode == "slip" and k in self.headings]
        if not sliders:
            return None
        contacts = self._look(time, z)
        for k in sliders:
            sliding = contacts.sliding(k)[0]
            fast = float(np.linalg.norm(sliding))
            if len(sliding) > 1 and fast > 0:
                if fast <= self._slow() and sliding @ self.headings[k] >= 0:
                    rate = at_rest(contacts, self.modes, self.headings).rate[0, contacts.tangents(k)]
                    if rate @ sliding < 0:
                        return Guard("stick", k)
                self.headings[k] = sliding / fast
        return None

    # -- guards ------------------------------------------------------------------------------------------------------
    def _slow(self) -> float:
        """Speed that is none, m/s."""
        return max(self.coarse * SLOWEST * self.fastest, 1e-12 * self.length)

    def _count(self, time: float) -> None:
        """Let bodies stay together earlier where they chatter: in a corner, friction may feed bounces for long."""
        window = CROWDED * float(self.times[-1] - self.times[0])
        if self.crowd and time - self.crowd[-1] > 10 * window:
            self.coarse, self.crowd = 1.0, []
        self.crowd.append(time)
        if len(self.crowd) >= CROWD:
            if self.crowd[-1] - self.crowd[-CROWD] < window:
                self.coarse = min(self.coarse * COARSER, COARSEST)
            self.crowd = self.crowd[1:] if self.crowd[-1] - self.crowd[-CROWD] >= window else self.crowd[-1:]

    def _guards(self, now: float, z: Array) -> tuple[list[Guard], float]:
        """Find what may end the motion from here, and how long the shortest flight lasts, about."""
        contacts = self._look(now, z)
        guards: list[Guard] = []
        shortest = np.inf
        rates = contacts.bias[0] + contacts.slope[0] @ contacts.free[0, : self.n]
        for k in self.bodies:
            normal = contacts.normal(k)
            if k not in self.modes:
                resting = bool(contacts.guard[0, k] <= CLOSED * self.length)
                # below the speed that is none it does not rise: it has only been let go
                rise = float(contacts.speed[0, normal])
                rise = rise if rise > self._slow() else 0.0
                if resting and rise > 0 and not self.modes and rates[normal] < 0:
                    shortest = min(shortest, -2.05 * rise / rates[normal])
                guards.append(Guard("gap", k, resting, rise))
                continue
            guards.append(Guard("lift-off", k))
            if contacts.rubs(k):
                if self.modes[k] == "stick":
                    guards.append(Guard("slip", k))
                else:
                    along = float(contacts.sliding(k)[0] @ self.headings[k])
                    guards.append(Guard("stick", k, along <= self._slow()))
        return guards, shortest

    def _values(self, guards: list[Guard], times: Array, states: Array) -> Array:
        """Values of guards at states (T, width), shape (guard, T)."""
        blocks, times = self.blocks[: len(times)], self._within(times)
        if not self.modes:
            return self.lens.guards(times, states, blocks)[:, [g.event for g in guards]].T
        contacts = self.lens(times, states, blocks)
        force = at_rest(contacts, self.modes, self.headings).force
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
                row[:] = contacts.sliding(k) @ self.headings[k]
        return found

    def _first(self, guards: list[Guard], begin: float, end: float, curve: Curve) -> tuple[float, Guard] | None:
        """First time in a step at which a guard falls through zero."""
        if not guards:
            return None
        best: tuple[float, Guard] | None = None
        times = np.linspace(begin, end, SAMPLES + 1)
        values = self._values(guards, times, curve(times))

        for guard, row in zip(guards, values, strict=True):

            def value(t: float, guard: Guard = guard) -> float:
                moment = np.array([t])
                return float(self._values([guard], moment, curve(moment))[0, 0])

            tiny = {"gap": TINY * self.length, "stick": 0.1 * self._slow()}.get(guard.kind, 0.0)
            found = fall(guard, times, row, value, tiny)
            if found is not None and (best is None or found < best[0]):
                best = found, guard
        return best

    def _note(self, begin: float, end: float, curve: Curve) -> None:
        """Note events that change nothing."""
        if not self.marks or end <= begin:
            return
        times = np.linspace(begin, end, SAMPLES + 1)
        values = self.lens.guards(self._within(times), curve(times), self.blocks)
        for k in self.marks:

            def value(t: float, k: int = k) -> float:
                moment = np.array([t])
                return float(self.lens.guards(self._within(moment), curve(moment), self.blocks[:1])[0, k])

            first = 0
            while first < SAMPLES:
                if values[first, k] <= 0:
                    first += 1
                    continue
                found = fall(Guard("gap", k), times[first:], values[first:, k], value, 0.0)
                if found is None:
                    break
                self.happenings.append(Happening(found, k, self.model.events[k][1]))
                first = int(np.searchsorted(times, found, side="right"))

    # -- events ------------------------------------------------------------------------------------------------------
    def _happen(self, time: float, z: Array, guard: Guard, begin: float) -> Array:
        """State after an event."""
        self._count(time)
        self.stalled = self.stalled + 1 if time - begin <= 1e-14 * max(1.0, abs(time)) else 0
        if self.stalled > AT_ONCE or len(self.happenings) > MOST:
            many = len(self.happenings) > MOST
            how = f"more than {MOST} events until" if many else "events follow each other without end at"
            self.message = f"{how} t = {time:.6g} s, at {self.model.events[guard.event][0]!r}"
            return z
        if guard.kind == "gap":
            return self._hit(time, z, guard.event)
        if guard.kind == "lift-off":
            return self._settle(time, z, leaving=guard.event)
        contacts, k = self._look(time, z), guard.event
        sliding = contacts.sliding(k)[0]
        if guard.kind == "stick":
            if float(np.linalg.norm(sliding)) > self._slow():  # it has only turned
                self.headings[k] = sliding / float(np.linalg.norm(sliding))
                return z
            z = self._settle(time, z)
            if self.modes.get(k) == "stick":
                self.happenings.append(Happening(time, k, "stick"))
            return z
        self.happenings.append(Happening(time, k, "slip"))
        friction = at_rest(contacts, self.modes, self.headings).force[0, contacts.tangents(k)]
        self.modes[k], self.headings[k] = "slip", heading_of(friction)
        return z

    def _hit(self, time: float, z: Array, event: int) -> Array:
        """Impact: new velocities, or a contact that lasts."""
        contacts = self._look(time, z)
        gaps = contacts.guard[0]
        closed = [k for k in self.bodies if k == event or k in self.modes or gaps[k] <= CLOSED * self.length]
        approach = max(0.0, -float(contacts.speed[0, contacts.normal(event)]))
        self.fastest = max(self.fastest, approach)
        if (jumped := self._impact(time, contacts, closed)) is None:
            return z
        jump, hit = jumped
        z = z.copy()
        z[: self.n] += project(contacts, {event: "slip"})[0][0]
        z[self.velocities :] += jump
        if approach > self._slow():
            found = [k for k in self.bodies if k in hit and k not in self.modes]
            self.happenings += [Happening(time, k, self.model.events[k][1]) for k in found]
        return self._settle(time, z)

    def _impact(self, time: float, contacts: Contacts, closed: list[int]) -> tuple[Array, set[int]] | None:
        """Jump of the velocities, and what is hit; None, with a message, where no impulses satisfy the laws."""
        found = impact(contacts, closed, 1e-3 * self._slow())
        if found is None:
            normals = [contacts.normal(k) for k in closed]
            name = self.model.events[closed[int(np.argmin(contacts.speed[0, normals]))]][0]
            self.message = (
                f"{name!r}: no impulses satisfy the laws of impact at t = {time:.6g} s; is a body driven into another?"
            )
        return found

    def _settle(self, time: float, z: Array, leaving: int | None = None) -> Array:
        """Let contacts last that are closed, do not open and are pressed; the others are open."""
        contacts = self._look(time, z)
        slow, before = self._slow(), dict(self.modes)
        gaps = contacts.guard[0]
        near = [
            k
            for k in self.bodies
            if k != leaving
            and gaps[k] <= (1e-6 if k in before else CLOSED) * self.length
            and abs(contacts.speed[0, contacts.normal(k)]) <= slow
        ]
        if (found := pressed(contacts, near, slow)) is None:
            names = ", ".join(repr(self.model.events[k][0]) for k in near)
            self.message = (
                f"{names}: no forces satisfy the laws of contact and friction at t = {time:.6g} s; what slides is "
                "wedged (Painleve's paradox). Lower the coefficient of friction, or use a compliant contact."
            )
            return z
        self.modes, self.headings, _ = found
        for k in before:
            if k not in self.modes:
                self.happenings.append(Happening(time, k, "lift-off"))
        for k in self.modes:
            if k not in before:
                self.happenings.append(Happening(time, k, "rest"))
        return self._on(self._within([time]), z[None], self.modes)[0] if self.modes else z
