"""Integration with events: from one to the next, one realisation at a time.

Between events it is the explicit method of order 8 on the index-1 form, with projection after each step; an event is
found on the interpolant of the step in which it lies.  After an impact the motion starts anew with the velocities that
the laws of impact give.  Bounces that become ever smaller end in a contact that lasts, from which bodies may lift off,
and which sticks or slips.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from uqmbd.dynamics.batch import Batch, Sampler
from uqmbd.dynamics.contact.chatter import Chatter
from uqmbd.dynamics.contact.evaluator import ContactEvaluator, Contacts
from uqmbd.dynamics.contact.event_location import Guard
from uqmbd.dynamics.contact.guards import Guards
from uqmbd.dynamics.contact.impacts import impact
from uqmbd.dynamics.contact.lasting import (
    CLOSED,
    Lasting,
    Mode,
    contact_motion,
    heading_of,
    lasting_contacts,
    onto_contacts,
)
from uqmbd.dynamics.contact.pieces import EventRecord, MotionPiece
from uqmbd.dynamics.integration import ORDER, BatchEquations, Curve, Leg, Out, Stepper, instant, pace, speed_jumps
from uqmbd.dynamics.linear import accelerations, excess
from uqmbd.typing import Array

__all__ = ["EventDrivenMotion"]


DEEP = 1e-6
"""Penetration at the start, over the size of the mechanism, that is no mistake of the drawing."""
MOST = 10_000
"""Events of a realisation that are taken for a motion that does not end."""
AT_ONCE = 100
"""Events of a realisation without progress in time that are."""
STEPS = 50_000
"""Most attempted steps of a realisation."""
LONGEST = 20
"""Least number of steps."""


@dataclass
class EventDrivenMotion:
    """Motion of one realisation with events.

    Parameters
    ----------
    ensemble : Batch
        Of one realisation.
    times : array, shape (T,)
        Output times, s.
    rtol : float
        Relative tolerance.
    evaluator : ContactEvaluator
        Of the model.

    Attributes
    ----------
    pieces : list of MotionPiece
    records : list of EventRecord
        In the order of time.
    message : str
        Why it ended early, or empty.
    """

    ensemble: Batch
    times: Array
    rtol: float
    evaluator: ContactEvaluator
    pieces: list[MotionPiece] = field(default_factory=list)
    records: list[EventRecord] = field(default_factory=list)
    message: str = ""
    last: Array | None = None
    steps: int = 0
    evaluations: int = 0

    def __post_init__(self) -> None:
        model = self.model = self.ensemble.model
        layout = model.layout
        self.n, self.velocities = layout.coordinates, layout.velocities
        compiled = model.system is not None and model.system.programs is not None
        self.flight = BatchEquations(model, self.ensemble.block) if compiled else None
        self.stepper = Stepper(self._rate, self.n, self.velocities, layout.width, max(self.rtol, 1e-13))
        self.lasting = Lasting({}, {})
        self.size, self.stalled = 0.0, 0
        self.legs: tuple[Leg, ...] = ()
        self.most = STEPS
        size = float(np.abs(self.ensemble.start.q[0]).max(initial=0.0))
        self.length = max(1e-3, min(1.0, size))
        self.guards = Guards(self.evaluator, self.ensemble.block, self.length)
        self.chatter = Chatter(self.length, float(self.times[-1] - self.times[0]))

    # -- the whole motion --------------------------------------------------------------------------------------------
    def run(self) -> None:
        """Integrate to the last output time."""
        start = self.ensemble.start
        self.legs = pace(self.ensemble, self.times, self.rtol, knots=True)
        begins = [float(self.times[0]), *(leg.end for leg in self.legs)]
        # whoever wants short steps gets as many as that takes
        self.most += int(sum((leg.end - t) / leg.longest for leg, t in zip(self.legs, begins, strict=False)))
        z = start.state[0]
        now, end = float(self.times[0]), float(self.times[-1])
        contacts = self.guards.contacts(now, z)
        deep = [k for k in self.guards.bodies if contacts.guard[0, k] < -DEEP * self.length]
        if deep:
            name, gap = self.model.events[deep[0]][0], contacts.guard[0, deep[0]]
            self.message = (
                f"{name!r}: the bodies overlap by {-gap:.3g} m at the start; draw them apart, or just touching"
            )
            return
        if overlapping := [k for k in self.guards.bodies if contacts.guard[0, k] < 0]:
            z[: self.n] += onto_contacts(contacts, dict.fromkeys(overlapping, "slip"))[0][0]
        z = self._settle(now, z)
        jumping = {leg.end for leg in self.legs[:-1] if leg.jumps}
        sampling = self.ensemble.sampling(self.times)
        sampled = {} if sampling is None else {time: k for k, time in enumerate(sampling.times.tolist())}
        for stop in [*sorted((jumping | sampled.keys()) - {now, end}), end]:
            self.guards.inside = (now + instant(now), np.inf)
            z = self._cross(now, z)
            if sampling is not None and now in sampled:
                z = self._sampled(sampling, sampled[now], now, z)
            while now < stop and not self.message:
                now, z = self._piece(now, z, stop)
            if self.message:
                return
        if sampling is not None and end in sampled:
            z = self._cross(end, z)
            self.last = self._sampled(sampling, sampled[end], end, z)

    def _sampled(self, sampling: Sampler, number: int, now: float, z: Array) -> Array:
        """State right after a sample of a controller."""
        if self.message:  # prescribed speeds that jump there cannot be followed
            return z
        one = np.zeros(1, dtype=np.int64)
        states, reasons = sampling.after(number, z[None], one)
        change, more = sampling.jumps(now, states, one)
        self.message = reasons.get(0) or more.get(0) or self.message
        return self._pushed(now, states[0], change[0])

    def _cross(self, now: float, z: Array) -> Array:
        """State right after a time at which prescribed speeds may jump."""
        change, reasons = speed_jumps(self.model, z[None], now, self.ensemble.block, self.rtol)
        if reasons:
            self.message = reasons[0]
        return self._pushed(now, z, change[0])

    def _pushed(self, now: float, z: Array, change: Array) -> Array:
        """State after a jump of velocities that speeds impose; contacts that this presses together hold."""
        if self.message or not np.any(change):
            return z
        z = z.copy()
        z[self.velocities :] += change
        contacts = self.guards.contacts(now, z)
        closed = [
            k for k in self.guards.bodies if k in self.lasting.modes or contacts.guard[0, k] <= CLOSED * self.length
        ]
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
        if self.last is not None:
            found[-1] = self.last
        return found

    def observed(self, times: Array, piece: MotionPiece) -> Array:
        """States of a piece at times (T,) within it, on the constraints: (T, width)."""
        return self._on(times, piece(times), piece.modes)

    # -- between events ----------------------------------------------------------------------------------------------
    def _rate(self, time: float, z: Array, out: Out) -> None:
        self.evaluations += 1
        time = min(max(time, self.guards.inside[0]), self.guards.inside[1])
        if not self.lasting.modes and self.flight is not None:
            self.flight.state[:] = z
            self.flight.rate(time, out)
            return
        q, s, v = (x[None] for x in np.split(z, [self.n, self.velocities]))
        out[0][:] = v
        if self.model.layout.states or not self.lasting.modes:
            a, _, out[2][:, self.n : self.velocities] = accelerations(self.model, q, s, v, time, self.ensemble.block)
            out[1][:] = a
        if self.lasting.modes:
            out[1][:] = contact_motion(self.guards.contacts(time, z), self.lasting).motion[:, : self.n]

    def _on(self, times: Array, states: Array, modes: dict[int, Mode]) -> Array:
        """Put states (T, width) onto constraints and lasting contacts."""
        if not (self.model.layout.rank or modes):
            return states
        states = states.copy()
        blocks = self.ensemble.block.repeat(len(states), axis=0)
        if self.model.layout.rank and self.flight is not None:
            q, v = excess(self.model, states, times, blocks)
            states[:, : self.n] -= np.nan_to_num(q)
            states[:, self.velocities :] -= np.nan_to_num(v)
        if modes:
            q, v = onto_contacts(self.evaluator(times, states, blocks), modes)
            states[:, : self.n] += np.nan_to_num(q)
            states[:, self.velocities :] += np.nan_to_num(v)
        return states

    def _piece(self, now: float, z: Array, stop: float) -> tuple[float, Array]:
        """Integrate to the next event that changes the motion, or to `stop`."""
        begin, curves = now, list[Curve]()
        self.guards.inside = (now + instant(now), stop - instant(stop))
        speed = float(np.abs(z[self.velocities :]).max(initial=0.0))
        floor = np.full(len(z), self.rtol * self.length)
        floor[self.velocities :] = self.rtol * max(self.length, 1e-3 * speed)
        guards, flight_time = self.guards.open(now, z, self.lasting, self.chatter.slow)
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
            found = self.guards.first(guards, (now, after), curve, self.lasting, self.chatter.slow)
            self.records += self.guards.notes(now, after if found is None else found[0], curve)
            if found is not None:
                self.pieces.append(MotionPiece(begin, found[0], tuple(curves), dict(self.lasting.modes)))
                moment = np.array([found[0]])
                there = self._on(self.guards.within(moment), curve(moment), self.lasting.modes)[0]
                return found[0], self._after_event(found[0], there, found[1], begin)
            z = self._on(self.guards.within([after]), new[None], self.lasting.modes)[0]
            if slow := self._turned(after, z):
                self.pieces.append(MotionPiece(begin, after, tuple(curves), dict(self.lasting.modes)))
                return after, self._after_event(after, z, slow, begin)
            self.stepper.start(after, z)
            now = after
            factor = min(5.0, 0.9 * max(error, 1e-10) ** (-1 / ORDER))
            self.size = size = size * (min(1.0, factor) if refused else factor)
            refused = False
        self.pieces.append(MotionPiece(begin, stop, tuple(curves), dict(self.lasting.modes)))
        return stop, z

    def _turned(self, time: float, z: Array) -> Guard | None:
        """Follow the directions of sliding; a contact in space that has nearly come to rest."""
        sliders = [k for k, mode in self.lasting.modes.items() if mode == "slip" and k in self.lasting.headings]
        if not sliders:
            return None
        contacts = self.guards.contacts(time, z)
        for k in sliders:
            sliding = contacts.sliding(k)[0]
            fast = float(np.linalg.norm(sliding))
            if len(sliding) > 1 and fast > 0:
                if fast <= self.chatter.slow and sliding @ self.lasting.headings[k] >= 0:
                    rate = contact_motion(contacts, self.lasting).rate[0, contacts.tangents(k)]
                    if rate @ sliding < 0:
                        return Guard("stick", k)
                self.lasting.headings[k] = sliding / fast
        return None

    # -- events ------------------------------------------------------------------------------------------------------
    def _after_event(self, time: float, z: Array, guard: Guard, begin: float) -> Array:
        """State after an event."""
        self.chatter.count(time)
        self.stalled = self.stalled + 1 if time - begin <= 1e-14 * max(1.0, abs(time)) else 0
        if self.stalled > AT_ONCE or len(self.records) > MOST:
            many = len(self.records) > MOST
            how = f"more than {MOST} events until" if many else "events follow each other without end at"
            self.message = f"{how} t = {time:.6g} s, at {self.model.events[guard.event][0]!r}"
            return z
        if guard.kind == "gap":
            return self._hit(time, z, guard.event)
        if guard.kind == "lift-off":
            return self._settle(time, z, leaving=guard.event)
        contacts, k = self.guards.contacts(time, z), guard.event
        sliding = contacts.sliding(k)[0]
        if guard.kind == "stick":
            if float(np.linalg.norm(sliding)) > self.chatter.slow:  # it has only turned
                self.lasting.headings[k] = sliding / float(np.linalg.norm(sliding))
                return z
            z = self._settle(time, z)
            if self.lasting.modes.get(k) == "stick":
                self.records.append(EventRecord(time, k, "stick"))
            return z
        self.records.append(EventRecord(time, k, "slip"))
        friction = contact_motion(contacts, self.lasting).force[0, contacts.tangents(k)]
        modes, headings = self.lasting
        modes[k], headings[k] = "slip", heading_of(friction)
        return z

    def _hit(self, time: float, z: Array, event: int) -> Array:
        """Impact: new velocities, or a contact that lasts."""
        contacts = self.guards.contacts(time, z)
        gaps = contacts.guard[0]
        closed = [
            k for k in self.guards.bodies if k == event or k in self.lasting.modes or gaps[k] <= CLOSED * self.length
        ]
        approach = max(0.0, -float(contacts.speed[0, contacts.normal(event)]))
        self.chatter.fastest = max(self.chatter.fastest, approach)
        if (jumped := self._impact(time, contacts, closed)) is None:
            return z
        jump, hit = jumped
        z = z.copy()
        z[: self.n] += onto_contacts(contacts, {event: "slip"})[0][0]
        z[self.velocities :] += jump
        if approach > self.chatter.slow:
            found = [k for k in self.guards.bodies if k in hit and k not in self.lasting.modes]
            self.records += [EventRecord(time, k, self.model.events[k][1]) for k in found]
        return self._settle(time, z)

    def _impact(self, time: float, contacts: Contacts, closed: list[int]) -> tuple[Array, set[int]] | None:
        """Jump of the velocities, and what is hit; None, with a message, where no impulses satisfy the laws."""
        found = impact(contacts, closed, 1e-3 * self.chatter.slow)
        if found is None:
            normals = [contacts.normal(k) for k in closed]
            name = self.model.events[closed[int(np.argmin(contacts.speed[0, normals]))]][0]
            self.message = (
                f"{name!r}: no impulses satisfy the laws of impact at t = {time:.6g} s; is a body driven into another?"
            )
        return found

    def _settle(self, time: float, z: Array, leaving: int | None = None) -> Array:
        """Let contacts last that are closed, do not open and are pressed; the others are open."""
        contacts = self.guards.contacts(time, z)
        slow, before = self.chatter.slow, dict(self.lasting.modes)
        gaps = contacts.guard[0]
        near = [
            k
            for k in self.guards.bodies
            if k != leaving
            and gaps[k] <= (1e-6 if k in before else CLOSED) * self.length
            and abs(contacts.speed[0, contacts.normal(k)]) <= slow
        ]
        if (found := lasting_contacts(contacts, near, slow)) is None:
            names = ", ".join(repr(self.model.events[k][0]) for k in near)
            self.message = (
                f"{names}: no forces satisfy the laws of contact and friction at t = {time:.6g} s; what slides is "
                "wedged (Painleve's paradox). Lower the coefficient of friction, or use a compliant contact."
            )
            return z
        self.lasting = found[0]
        for k in before:
            if k not in self.lasting.modes:
                self.records.append(EventRecord(time, k, "lift-off"))
        for k in self.lasting.modes:
            if k not in before:
                self.records.append(EventRecord(time, k, "rest"))
        return self._on(self.guards.within([time]), z[None], self.lasting.modes)[0] if self.lasting.modes else z
