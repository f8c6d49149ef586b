"""Event-driven integration: the driver integrates each realisation from one of its events to the next.

The driver makes steps and locates events in a step. A realisation with an event waits at the event, while the others
continue.  Waiting realisations are processed together: after an impact, the motion restarts with velocities from the
impact laws.  Decreasing bounces end in a persistent contact, which sticks or slips, and from which bodies may lift off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from uqmbd.compiled import Encounters, ExplicitStatus, IntegrationState, Touching
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.contact.chatter import Chatter
from uqmbd.dynamics.contact.decisions import Decisions
from uqmbd.dynamics.contact.evaluator import ContactEvaluator, ContactQuantities
from uqmbd.dynamics.contact.persistent import CLOSED, onto_contacts
from uqmbd.dynamics.contact.programs import contact_programs
from uqmbd.dynamics.contact.records import Records
from uqmbd.dynamics.contact.single_contacts import SingleContacts
from uqmbd.dynamics.contact.single_impacts import solve_single_impacts
from uqmbd.dynamics.integration import Pace, explicit_method, intervals_of_members, speed_jumps
from uqmbd.typing import Array, Index, Mask

__all__ = ["EventDrivenMotion"]


DEEP = 1e-6
"""Largest initial penetration, relative to the size of the mechanism, without an error."""
MOST = 10_000
"""Number of events of a realisation that counts as an endless motion."""
AT_ONCE = 100
"""Number of events of a realisation without progress in time that counts as an endless motion."""
STEPS = 50_000
"""Largest number of attempted steps in an interval."""
LONGEST = 20
"""Least number of steps over the output times."""
FLIGHT = 2.05
"""First step after an impact, relative to the estimated flight time."""


class EventDrivenMotion:
    """Motion of M assembled realisations with events, at output times (T,), s.

    The index-1 system of the model of `evaluator` is compiled; steps are recorded if `recording`, and implicit if there
    are `stages`.
    """

    def __init__(
        self,
        batch: Batch,
        times: Array,
        rtol: float,
        evaluator: ContactEvaluator,
        *,
        recording: bool = False,
        stages: int = 0,
    ) -> None:
        self.batch, self.model, self.times, self.rtol = batch, batch.model, times, rtol
        self.evaluator, count = evaluator, len(batch)
        self.n, self.velocities = self.model.layout.coordinates, self.model.layout.velocities
        self.first = np.array(evaluator.first)
        self.bodies = np.flatnonzero(np.diff(self.first))
        dynamics, contacts = contact_programs(self.model, stages)
        length = np.clip(np.abs(batch.start.q).max(axis=1, initial=0.0), 1e-3, 1.0)
        self.sampling = batch.sampling(times)
        samples = np.zeros(0) if self.sampling is None else self.sampling.times
        self.encounters = Encounters(contacts, count)
        self.encounters.length[:] = self.length = length
        rtol = max(rtol, 1e-13)
        self.run = IntegrationState(
            dynamics,
            replace(explicit_method(rtol, guarded=False, attempts=STEPS), patience=2**62),
            batch.start.state,
            batch.block,
            times,
            intervals_of_members(batch, times, rtol, samples=samples, longest=float(times[-1] - times[0]) / LONGEST),
            rtol * length,
            contacts,
            self.encounters,
            recording=recording,
        )
        self.pace = Pace(self.model, float(times[0]), float(times[-1]))
        self.chatter = Chatter(length, float(times[-1] - times[0]))
        self.records = Records(self.model, count)
        duration, floor = float(times[-1] - times[0]), self.run.floor
        self.decisions = Decisions(batch, evaluator, self.encounters, self.chatter, self.records, duration, floor)
        self.single = SingleContacts(self.decisions)
        self.messages = self.decisions.messages
        # restarts (M,): number of restarts of each realisation
        self.restarts, self.stalled = np.zeros((2, count), dtype=np.int64)
        self.since = np.full(count, -np.inf)
        self.sampled = {time: k for k, time in enumerate(samples.tolist())}
        # called after each restart
        self.restarted: Callable[[], None] | None = None

    # -- the whole motion --------------------------------------------------------------------------------------------
    def follow(self) -> None:
        """Integrate all members to the last output time, or until they fail."""
        every, begin = np.arange(len(self.batch)), float(self.times[0])
        self._begin(every)
        self._stop(self._active(every), begin)
        self._guard(self._active(every))
        self._restart(self._active(every))
        while self.advance():
            pass
        if self.sampling is not None and (end := float(self.times[-1])) in self.sampled and end > begin:
            self._stop(self._active(every), end)
        self._failed()
        self.run.project()
        for m in np.flatnonzero(self.run.column < len(self.times)).tolist():
            self.run.result[m, self.run.column[m] :] = np.nan

    def advance(self) -> bool:
        """Integrate all active members, then decide on waiting members; return whether members were waiting."""
        run = self.run
        run.advance(watch=self.pace.watch)
        self._note()
        status = run.status
        events = np.flatnonzero(status == ExplicitStatus.EVENT)
        status[status == ExplicitStatus.NOTED] = ExplicitStatus.RUNNING
        for code, why in (
            (ExplicitStatus.MANY, f"more than {STEPS} steps"),
            (ExplicitStatus.SMALL, "the step size fell to {:.1g} s"),
        ):
            for m in np.flatnonzero(status == code).tolist():
                reason = why.format(run.tried[m])
                self.messages[m] = (
                    f"the integration stopped at t = {run.now[m]:.6g} s: {reason}; the mechanism may be stiff"
                )
        self._failed()
        if len(events):
            others = self._happened(events)
            self._guard(self._active(others))
            self._restart(self._active(events))
        elif not np.any(status == ExplicitStatus.RUNNING) and len(
            waiting := np.flatnonzero(status == ExplicitStatus.JUMP)
        ):
            # controllers are called when all members without failure have reached the sample
            time = float(run.now[waiting].min())
            some = waiting[run.now[waiting] == time]
            self._stop(some, time)
            self._guard(self._active(some))
            self._restart(self._active(some))
        return bool(np.any((status == ExplicitStatus.RUNNING) | (status == ExplicitStatus.JUMP)))

    def _active(self, members: Index) -> Index:
        """Return the members without failure."""
        return members[[not self.messages[m] for m in members.tolist()]]

    def _failed(self) -> None:
        for m, message in enumerate(self.messages):
            if message:
                self.run.status[m] = ExplicitStatus.DONE

    def _inside(self, members: Index) -> Array:
        """Return the times of members at which prescribed quantities may jump, without the ends of intervals."""
        run = self.run
        begin, end = (
            run.begin[members],
            run.interval_ends[np.minimum(run.interval[members], run.last_interval[members])],
        )
        delta = 1e-12 * np.maximum(1.0, np.maximum(np.abs(begin), np.abs(end)))
        found: Array = np.clip(run.now[members], begin + delta, end - delta)
        return found

    def _contacts(self, members: Index) -> ContactQuantities:
        return self.evaluator(self._inside(members), self.run.z[members], self.batch.block[members])

    # -- the start ---------------------------------------------------------------------------------------------------
    def _begin(self, members: Index) -> None:
        """Find the contacts that are closed at the start."""
        inside = self._inside(members)
        guards = self.evaluator.guards(inside, self.run.z[members], self.batch.block[members])
        self.encounters.resting[:, ::2] = guards <= 0  # marks: a guard below zero must rise before it can fall
        gaps = guards[:, self.bodies]
        near = np.any(gaps <= CLOSED * self.length[members, None], axis=1)
        for row in np.flatnonzero(near).tolist():
            m = int(members[row])
            if deep := self.bodies[gaps[row] < -DEEP * self.length[m]].tolist():
                name, gap = self.model.events[deep[0]][0], gaps[row, self.bodies == deep[0]][0]
                self.messages[m] = (
                    f"{name!r}: the bodies overlap by {-gap:.3g} m at the start; change the given poses until the "
                    "bodies touch or have a gap"
                )
                self.run.result[m] = np.nan
                continue
            if overlapping := self.bodies[gaps[row] < 0].tolist():
                one = self.decisions.contacts(m, float(inside[row]), self.run.z[m])
                self.run.z[m, : self.n] += onto_contacts(one, dict.fromkeys(overlapping, "slip"))[0][0]
            self.run.z[m] = self.decisions.settle(m, float(inside[row]), self.run.z[m])

    # -- stops at given times ----------------------------------------------------------------------------------------
    def _stop(self, members: Index, time: float) -> None:
        """Apply jumps of prescribed speeds, and sample controllers, at a time, s."""
        if not len(members):
            return
        run = self.run
        change, reasons = speed_jumps(self.model, run.z[members], time, self.batch.block[members], self.rtol)
        self._record_reasons(members, reasons)
        self._push(members, change)
        members = self._active(members)
        if self.sampling is not None and time in self.sampled and len(members):
            states, reasons = self.sampling.after(self.sampled[time], run.z[members], members)
            change, more = self.sampling.jumps(time, states, members)
            self._record_reasons(members, more | reasons)
            run.z[members] = states
            self._push(members, change)
        at = np.flatnonzero(np.abs(self.times - time) <= 1e-13 * max(1.0, abs(time)))
        if len(at):
            going = self._active(members)
            run.result[going, at[0]] = run.z[going]
        run.status[members] = np.where(
            run.status[members] == ExplicitStatus.JUMP, ExplicitStatus.RUNNING, run.status[members]
        )
        self._failed()

    def _record_reasons(self, members: Index, reasons: dict[int, str]) -> None:
        for row, reason in reasons.items():
            self.messages[int(members[row])] = reason

    def _push(self, members: Index, change: Array) -> None:
        """Change velocities of members by impulses of prescribed speeds."""
        some = np.array([not self.messages[m] for m in members.tolist()], dtype=bool) & np.any(change, axis=1)
        members = members[some]
        if not len(members):
            return
        self.run.z[members, self.velocities :] += change[some]
        contacts, inside = self._contacts(members), self._inside(members)
        closed = np.any(contacts.guard[:, self.bodies] <= CLOSED * self.length[members, None], axis=1)
        closed |= np.any(self.encounters.mode[members] != Touching.OPEN, axis=1)
        for row in np.flatnonzero(closed).tolist():
            m = int(members[row])
            self._turned(m)
            one = contacts.select(np.array([row]))
            self.run.z[m] = self.decisions.pushed(m, float(inside[row]), self.run.z[m], one)

    # -- events ------------------------------------------------------------------------------------------------------
    def _note(self) -> None:
        """Store the marks that the driver has recorded."""
        e = self.encounters
        rows = np.flatnonzero(e.noted)
        if not len(rows):
            return
        used = np.arange(e.room) < e.noted[rows, None]
        members = np.broadcast_to(rows[:, None], used.shape)[used]
        self.records.add_own(members, e.mark_times[rows][used], e.mark[rows][used])
        e.noted[rows] = 0

    def _happened(self, members: Index) -> Index:
        """Decide on members with an event; return the members with unknown guards."""
        run, e = self.run, self.encounters
        now = run.now[members]
        self.chatter.happened(members, now)
        at_once = now - self.since[members] <= 1e-14 * np.maximum(1.0, np.abs(now))
        self.stalled[members] = np.where(at_once, self.stalled[members] + 1, 0)
        events, many = e.happened[members] // 2, self.records.count[members] > MOST
        for row in np.flatnonzero(many | (self.stalled[members] > AT_ONCE)).tolist():
            how = f"more than {MOST} events occur until" if many[row] else f"more than {AT_ONCE} events occur at"
            self.messages[members[row]] = (
                f"{how} t = {now[row]:.6g} s, the last at {self.model.events[events[row]][0]!r}"
            )
        inside = self._inside(members)
        contacts = self.evaluator(inside, run.z[members], self.batch.block[members])
        done = self._bounced(members, contacts)
        self.decisions.until[members] = run.interval_ends[np.minimum(run.interval[members], run.last_interval[members])]
        left = np.flatnonzero(~done)
        if len(left):
            who = members[left]
            given = who, e.happened[who], now[left], inside[left], run.z[who], contacts.select(left)
            run.z[who], decided = self.single.after(*given)
            left = left[~decided]
        for row in left.tolist():
            m = int(members[row])
            if self.messages[m]:
                continue
            self._turned(m)
            one = contacts.select(np.array([row]))
            run.z[m] = self.decisions.after(m, int(e.happened[m]), float(inside[row]), run.z[m], one)
        return members[~done]

    def _turned(self, member: int) -> None:
        if member in self.decisions.lasting:
            self.decisions.turned(member)

    def _bounced(self, members: Index, contacts: ContactQuantities) -> Mask:
        """Apply fast rebounds from single contacts if no contact is persistent; return a mask of rebounding members."""
        run, e, rows = self.run, self.encounters, np.arange(len(members))
        events, length = e.happened[members] // 2, self.length[members]
        normal = self.first[events]
        free = ~np.any(e.mode[members] != Touching.OPEN, axis=1)
        closed = np.sum(contacts.guard[:, self.bodies] <= CLOSED * length[:, None], axis=1)
        alone = closed == (contacts.guard[rows, events] <= CLOSED * length)
        approach = -contacts.speed[rows, normal]
        fastest = np.maximum(self.chatter.fastest[members], approach)
        slow = self.chatter.slow(members)
        possible: Mask = free & alone & (approach > slow)
        possible &= np.array([not self.messages[m] for m in members.tolist()])
        some = np.flatnonzero(possible)
        if not len(some):
            return possible
        impulse, after, solved = solve_single_impacts(contacts.select(some), events[some])
        before, self.chatter.fastest[members[some]] = self.chatter.fastest[members[some]], fastest[some]
        slow = self.chatter.slow(members[some])
        good = solved & (approach[some] > slow) & (after > slow)
        self.chatter.fastest[members[some[~good]]] = before[~good]
        possible[some[~good]] = False
        some, impulse = some[good], impulse[good]
        who, events, normal = members[some], events[some], normal[some]
        answer = contacts.answer[some, : self.n]
        back = -contacts.guard[some, events] / contacts.delassus[some, normal, normal]
        run.z[who, : self.n] += answer[np.arange(len(some)), :, normal] * back[:, None]
        run.z[who, self.velocities :] += np.sum(answer * impulse[:, None, :], axis=2)
        self.records.add_own(who, run.now[who], events)
        # the gap rises from zero; the acceleration before the impact only affects the first step
        rise, free = after[good], contacts.free[some, : self.n]
        rates = contacts.bias[some, normal] + np.sum(contacts.slope[some, normal] * free, axis=1)
        self._rest(who)
        e.slow[who] = slow[good]
        e.resting[who, 2 * events], e.rise[who, 2 * events] = 1, rise
        run.wanted[who] = np.minimum(run.wanted[who], np.where(rates < 0, -FLIGHT * rise / rates, np.inf))
        return possible

    # -- restarts ----------------------------------------------------------------------------------------------------
    def _restart(self, members: Index) -> None:
        """Continue members with known guards."""
        if not len(members):
            return
        run = self.run
        self.since[members] = run.now[members]
        self.restarts[members] += 1
        run.fresh[members], run.rejected[members], run.refused[members] = 1, 0, 0
        run.status[members] = np.where(
            run.status[members] == ExplicitStatus.DONE, ExplicitStatus.DONE, ExplicitStatus.RUNNING
        )
        self._end_intervals(members)
        if self.restarted is not None:
            self.restarted()

    def _guard(self, members: Index) -> None:
        """Find the guards that rise from zero, and estimate flight times."""
        if not len(members):
            return
        run, e, bodies = self.run, self.encounters, self.bodies
        e.slow[members] = slow = np.maximum(self.chatter.slow(members), self.decisions.starting[members])
        self._rest(members)
        states, mode = run.z[members], e.mode[members][:, bodies]
        free = mode == Touching.OPEN
        gaps = self.evaluator.guards(self._inside(members), states, self.batch.block[members])[:, bodies]
        some = np.any(~free | (gaps <= CLOSED * self.length[members, None]), axis=1)
        if not some.any():
            return
        members, mode, free, slow = members[some], mode[some], free[some], slow[some]
        contacts, normals = self._contacts(members), self.first[bodies]
        closed = contacts.guard[:, bodies] <= CLOSED * self.length[members, None]
        # below the zero limit of speed the gap does not rise: the contact has only been released
        speed = contacts.speed[:, normals]
        rise = np.where(free & (speed > slow[:, None]), speed, 0.0)
        accelerations = contacts.free[:, None, : self.n]
        rates = contacts.bias[:, normals] + np.sum(contacts.slope[:, normals] * accelerations, axis=2)
        flies = closed & (rise > 0) & free.all(axis=1)[:, None] & (rates < 0)
        flight = np.where(flies, -FLIGHT * rise / np.where(flies, rates, -1.0), np.inf).min(axis=1, initial=np.inf)
        run.wanted[members] = np.minimum(run.wanted[members], flight)
        e.resting[np.ix_(members, 2 * bodies)], e.rise[np.ix_(members, 2 * bodies)] = free & closed, rise
        for row, at in np.argwhere(mode == Touching.SLIP).tolist():
            k, heading = bodies[at], e.heading[members[row]]
            tangents = slice(self.first[k] + 1, self.first[k + 1])
            e.resting[members[row], 2 * k + 1] = contacts.speed[row, tangents] @ heading[tangents] <= slow[row]
        for m in members.tolist():
            for k in self.decisions.sticking_at_limit(m, float(run.now[m])):
                e.resting[m, 2 * k + 1] = e.mode[m, k] == Touching.STICK

    def _rest(self, members: Index) -> None:
        """Activate all guards of contacts; the driver handles guards of marks."""
        guards = np.concatenate([2 * self.bodies, 2 * self.bodies + 1])
        self.encounters.resting[np.ix_(members, guards)] = 0
        self.encounters.rise[members] = 0.0

    def _end_intervals(self, members: Index) -> None:
        """Start the next interval of members at the end of an interval."""
        run = self.run
        end = run.interval_ends[np.minimum(run.interval[members], run.last_interval[members])]
        near = 1e-12 * np.maximum(1.0, np.maximum(np.abs(run.begin[members]), np.abs(end)))
        for row in np.flatnonzero(
            (run.status[members] == ExplicitStatus.RUNNING) & (run.now[members] >= end - near)
        ).tolist():
            m, interval = int(members[row]), int(run.interval[members[row]])
            last = int(np.searchsorted(self.times, end[row] + near[row], side="right"))
            run.result[m, run.column[m] : last], run.column[m] = run.z[m], last
            run.now[m] = run.begin[m] = end[row]
            run.interval[m], run.attempts[m] = interval + 1, 0
            run.status[m] = ExplicitStatus.RUNNING
            if interval == run.last_interval[m]:
                run.status[m] = ExplicitStatus.DONE
            elif run.interval_jumps[interval]:
                run.status[m] = ExplicitStatus.JUMP
