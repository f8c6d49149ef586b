"""Event-driven integration: the driver integrates each realisation from one of its events to the next.

The driver makes steps, locates events in a step, and decides about them: impacts, rest, lift-off, and the ends of
sticking and sliding. A realisation whose event it leaves undecided waits for a decision in Python, while the others
continue. Decreasing bounces end in a persistent contact, which sticks or slips, and from which bodies may lift off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from uqmbd.compiled import Encounters, ExplicitStatus, IntegrationState, Touching
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.contact.decisions import TOGETHER, Decisions
from uqmbd.dynamics.contact.evaluator import ContactEvaluator, ContactQuantities
from uqmbd.dynamics.contact.persistent import CLOSED, onto_contacts
from uqmbd.dynamics.contact.programs import contact_programs
from uqmbd.dynamics.contact.records import Records
from uqmbd.dynamics.integration import Pace, explicit_method, intervals_of_members, speed_jumps
from uqmbd.typing import Array, Index

__all__ = ["EventDrivenMotion"]


DEEP = 1e-6
"""Largest initial penetration, relative to the size of the mechanism, without an error."""
MOST = 10_000
"""Number of events of a realisation from which on its motion counts as endless, as in decisions.c."""
AT_ONCE = 100
"""Number of events without progress in time from which on a motion counts as endless, as in decisions.c."""
STEPS = 50_000
"""Largest number of attempted steps in an interval."""
LONGEST = 20
"""Least number of steps over the output times."""
CLUSTER_TIME = 2e-3
"""Time of a cluster of events, relative to the duration; ten times this time without an event ends a cluster."""


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
        duration = float(times[-1] - times[0])
        window, together = CLUSTER_TIME * duration, TOGETHER * duration
        self.encounters = Encounters(contacts, count, decides=True, window=window, together=together)
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
        self.records = Records(self.model, self.encounters)
        self.decisions = Decisions(batch, evaluator, self.encounters, self.records, duration, self.run.floor)
        self.messages = self.decisions.messages
        self.sampled = {time: k for k, time in enumerate(samples.tolist())}
        # called after each restart, if `encounters.reports`
        self.restarted: Callable[[], None] | None = None

    # -- the whole motion --------------------------------------------------------------------------------------------
    def follow(self) -> None:
        """Integrate all members to the last output time, or until they fail."""
        every, begin = np.arange(len(self.batch)), float(self.times[0])
        self._begin(every)
        self._stop(self._active(every), begin)
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
        self.records.take()
        status = run.status
        events = np.flatnonzero(status == ExplicitStatus.EVENT)
        if self.restarted is not None and np.any(status == ExplicitStatus.STEPPED):
            self.restarted()
        status[(status == ExplicitStatus.NOTED) | (status == ExplicitStatus.STEPPED)] = ExplicitStatus.RUNNING
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
            self._happened(events)
            self._restart(self._active(events))
        elif not np.any(status == ExplicitStatus.RUNNING) and len(
            waiting := np.flatnonzero(status == ExplicitStatus.JUMP)
        ):
            # controllers are called when all members without failure have reached the sample
            time = float(run.now[waiting].min())
            some = waiting[run.now[waiting] == time]
            self._stop(some, time)
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
            one = contacts.select(np.array([row]))
            self.run.z[m] = self.decisions.pushed(m, float(inside[row]), self.run.z[m], one)

    # -- events ------------------------------------------------------------------------------------------------------
    def _happened(self, members: Index) -> None:
        """Decide on members with an event that the driver has not decided."""
        run, e = self.run, self.encounters
        events, many = e.happened[members] // 2, e.total[members] > MOST
        for row in np.flatnonzero(many | (e.stalled[members] > AT_ONCE)).tolist():
            m, name = members[row], self.model.events[events[row]][0]
            how = f"more than {MOST} events occur until" if many[row] else f"more than {AT_ONCE} events occur at"
            self.messages[m] = f"{how} t = {run.now[m]:.6g} s, the last at {name!r}"
        inside = self._inside(members)
        self.decisions.until[members] = run.interval_ends[np.minimum(run.interval[members], run.last_interval[members])]
        contacts = self.evaluator(inside, run.z[members], self.batch.block[members])
        for row, m in enumerate(members.tolist()):
            if self.messages[m]:
                continue
            one = contacts.select(np.array([row]))
            run.z[m] = self.decisions.after(m, int(e.happened[m]), float(inside[row]), run.z[m], one)

    # -- restarts ----------------------------------------------------------------------------------------------------
    def _restart(self, members: Index) -> None:
        """Continue members; the driver finds their guards."""
        if not len(members):
            return
        run, e = self.run, self.encounters
        e.since[members] = run.now[members]
        e.restarts[members] += 1
        e.arming[members] = 1
        run.fresh[members], run.rejected[members], run.refused[members] = 1, 0, 0
        run.status[members] = np.where(
            run.status[members] == ExplicitStatus.DONE, ExplicitStatus.DONE, ExplicitStatus.RUNNING
        )
        self._end_intervals(members)

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
