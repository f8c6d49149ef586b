"""Decisions for one realisation at an event: impacts, and contacts that persist, stick, slip or open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from uqmbd.compiled import Encounters, Touching
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.contact.evaluator import ContactEvaluator, ContactQuantities
from uqmbd.dynamics.contact.impacts import impact
from uqmbd.dynamics.contact.limits import contacts_at_limit, most_durable_forces, slipping_together
from uqmbd.dynamics.contact.persistent import (
    CLOSED,
    ContactModes,
    ContactMotion,
    Mode,
    contact_motion,
    onto_contacts,
    persistent_contacts,
    pressed,
    with_internal,
)
from uqmbd.dynamics.contact.records import Records
from uqmbd.dynamics.linear import accelerations, excess
from uqmbd.typing import Array

__all__ = ["HELD", "Decisions"]


AHEAD = 1e-7
"""Time difference for rates of forces, relative to the duration of the motion."""
AT_ONCE = 1e-14
"""Time between two events, relative to the larger of the time and 1 s, that counts as zero."""
TOGETHER = 1e-9
"""Time between decisions on friction at its limit, relative to the duration of the motion, that counts as zero.

A reserve below `AT_LIMIT` vanishes within this time. Feet of one body that reach their limits together may therefore do
so at times that differ by it."""
START = 10.0
"""Speed at the start of slip that counts as zero, m/s, divided by the tolerance, m; equal to the value in decisions.c.

It follows from the accuracy of the interpolant."""
HOLDS, SLIDES = 1, 2
"""Decisions at an instant: a contact sticks without a friction reserve, or slips in any case; as in decisions.c."""
HELD = 1e-6
"""Largest gap of a contact that has persisted so far, relative to the size of the mechanism."""


class Decisions:
    """Handler of the events of M realisations, one realisation at a time.

    `encounters` contains the states of the contacts; `duration` of the motion is in s; absolute tolerances (M,), m.
    """

    def __init__(
        self,
        batch: Batch,
        evaluator: ContactEvaluator,
        encounters: Encounters,
        records: Records,
        duration: float,
        tolerance: Array,
    ) -> None:
        self.batch, self.model, self.evaluator = batch, batch.model, evaluator
        self.encounters, self.records = encounters, records
        self.n, self.velocities = self.model.layout.coordinates, self.model.layout.velocities
        # events with contacts of bodies
        self.bodies = [k for k, (*_, directions) in enumerate(self.model.events) if directions]
        # reason why a realisation cannot continue
        self.messages = [""] * len(batch)
        self.length, self.starting = encounters.length, encounters.starting
        self.duration, self.coarse = duration, START * tolerance
        # (M,): time until which prescribed functions are smooth, s
        self.until = np.full(len(batch), np.inf)
        # by realisation: first time and contacts at which several motions satisfy the laws
        self.several: dict[int, str] = {}

    def slow(self, member: int) -> float:
        """Return the speed that counts as zero, m/s."""
        return max(float(self.encounters.still(member)), float(self.starting[member]))

    def contacts(self, member: int, time: float, z: Array) -> ContactQuantities:
        """Evaluate the contacts of one state."""
        return self.evaluator(np.array([time]), z[None], self.batch.block[member : member + 1])

    # -- events ------------------------------------------------------------------------------------------------------
    def after(self, member: int, guard: int, time: float, z: Array, contacts: ContactQuantities) -> Array:
        """Return the state after an event from the state (width,) right before it, at a time in s.

        The contacts belong to this state; `guard` is the guard with the zero crossing, see `Encounters`.
        """
        k, friction = divmod(guard, 2)
        before = self._modes(member)
        mode = before.get(k)
        if mode != "slip" or not friction:
            self.starting[member] = 0.0
        z, contacts = self._still_touching(member, time, z, contacts)
        if mode is None:
            z = self._hit(member, time, z, k, contacts)
        elif not friction:
            if self._unloaded(member, time, z, contacts):
                return z
            z = self.settle(member, time, z, leaving=k)
        elif mode == "slip":
            lasting, sliding = self.lasting(member), contacts.sliding(k)[0]
            fast = float(np.linalg.norm(sliding))
            if fast > self.slow(member):  # the sliding has only changed direction
                self._keep(member, lasting._replace(headings={**lasting.headings, k: sliding / fast}), contacts)
                return z
            settled = self.settle(member, time, z)
            begins = self._modes(member).get(k) == "slip"
            self.starting[member] = self.coarse[member] if begins else 0.0
            at_once = time - self.encounters.turned[member] <= AT_ONCE * max(1.0, abs(time))
            turns = self._modes(member) == before and fast > float(self.encounters.still(member))
            if turns and not at_once:
                self.encounters.turned[member] = time
                # the direction of a starting slide may turn in three dimensions; repeated stops would hold the bodies
                lasting = self.lasting(member)
                self._keep(member, lasting._replace(headings={**lasting.headings, k: sliding / fast}), contacts)
                return z
            z = settled
        else:
            z = self._slipping(member, time, z, k, contacts)
        self._changed(member, time, before, contacts)
        return z

    def _still_touching(
        self, member: int, time: float, z: Array, contacts: ContactQuantities
    ) -> tuple[Array, ContactQuantities]:
        """Project a state onto the persistent contacts, because the driver projects only to first order."""
        modes = self._modes(member)
        normals = [contacts.normal(k) for k in modes]
        for _ in range(3):
            if not np.abs(contacts.speed[0, normals]).max(initial=0.0) > self.slow(member):
                break
            z = self._onto(member, time, z, modes)
            contacts = self.contacts(member, time, z)
        return z, contacts

    def _changed(self, member: int, time: float, before: Mapping[int, Mode], contacts: ContactQuantities) -> None:
        """Record the persistent contacts that begin to stick or slip; several may change at once."""
        after = self._modes(member)
        for k, mode in before.items():
            if k in after and after[k] != mode and contacts.has_friction(k):
                self.records.add(member, time, k, after[k])

    def _slipping(self, member: int, time: float, z: Array, event: int, contacts: ContactQuantities) -> Array:
        """Return the state after friction has reached its limit in a sticking contact.

        All contacts at their limit are decided together.  The decisions at one instant terminate, because decisions
        after the first only add slipping contacts.
        """
        before, again = self.lasting(member), self._again(member, time)
        forced = {*np.flatnonzero(self.encounters.held[member] == SLIDES).tolist(), event} if again else set[int]()
        if len(before.modes) > 1 and not again:
            # other contacts may also slip, or internal forces may hold the bodies
            z = self.settle(member, time, z)
            after = self.lasting(member)
            if self.messages[member] or after.modes.get(event) != "stick":
                return z
            before, contacts = after, self.contacts(member, time, z)
        motion = contact_motion(contacts, before)
        limited = contacts_at_limit(contacts, before, motion.force[0])
        span = self._span(member, time)
        ahead = self._ahead(member, time, z, motion, span) if len(before.modes) > 1 else contacts
        if len(before.modes) > 1 and event not in limited and not again:
            self._keep(member, most_durable_forces(contacts, ahead, before, motion, span), contacts)
            self.note_limit(member, time)
            return z
        limited = sorted({*limited, *forced, event})
        slips = slipping_together(contacts, ahead, before, motion, limited, forced)
        if slips is None:
            names = ", ".join(repr(self.model.events[k][0]) for k in limited)
            self.messages[member] = (
                f"{names}: friction reaches its limit in these contacts at t = {time:.6g} s. After that, no "
                "combination of sticking and slipping satisfies the laws of contact and friction. Lower the "
                "coefficients of friction, or use compliant contacts."
            )
            return z
        modes: dict[int, Mode] = {**before.modes, **dict.fromkeys(slips, "slip")}
        found, _ = with_internal(contacts, ContactModes(modes, {**before.headings, **slips}))
        self._keep(member, found, contacts)
        self.starting[member] = self.coarse[member]
        self.note_limit(member, time, forced=list(slips), held=[k for k in limited if k not in slips])
        return z

    def _unloaded(self, member: int, time: float, z: Array, contacts: ContactQuantities) -> bool:
        """Redistribute loads of redundant contacts if one is no longer pressed; return whether this is possible."""
        lasting = self.lasting(member)
        if len(lasting.modes) < 2 or self._again(member, time):
            return False
        found, motion = with_internal(contacts, lasting._replace(internal=None))
        if found.internal is None or not pressed(contacts, found, motion):
            return False
        span = self._span(member, time)
        found = most_durable_forces(contacts, self._ahead(member, time, z, motion, span), found, motion, span)
        self._keep(member, found, contacts)
        self.note_limit(member, time)
        return True

    def note_limit(self, member: int, time: float, forced: Sequence[int] = (), held: Sequence[int] = ()) -> None:
        """Store a decision about contacts at their limit: those that slip in any case, and those without reserve."""
        self.encounters.held[member] = 0
        self.encounters.held[member, list(forced)] = SLIDES
        self.encounters.held[member, list(held)] = HOLDS
        self.encounters.later[member] = time + self._instant(time)

    def _instant(self, time: float) -> float:
        """Return the time between decisions on friction at its limit that counts as zero, s."""
        return max(TOGETHER * self.duration, AT_ONCE * abs(time))

    def _again(self, member: int, time: float) -> bool:
        """Return whether the last decision about contacts at their limit was at this time."""
        return time <= float(self.encounters.later[member])

    def _span(self, member: int, time: float) -> float:
        """Return the time difference for rates of forces, s."""
        return max(0.0, min(AHEAD * self.duration, 0.5 * float(self.until[member] - time)))

    def _ahead(self, member: int, time: float, z: Array, motion: ContactMotion, span: float) -> ContactQuantities:
        """Evaluate the contacts a short time later, with the present motion."""
        layout = self.model.layout
        later, block = z + 0.0, self.batch.block[member : member + 1]
        q, s, v = layout.split(z[None])
        _, _, rates = accelerations(self.model, q, s, v, np.array([time]), block)
        a = motion.motion[0, : self.n]
        later[: self.n] += span * (v[0] + 0.5 * span * a)
        later[self.n : self.velocities] += span * rates[0]
        later[self.velocities :] += span * a
        return self.contacts(member, time + span, later)

    def _hit(self, member: int, time: float, z: Array, event: int, contacts: ContactQuantities) -> Array:
        """Return the state after an impact, with new velocities or a persistent contact."""
        gaps, lasting = contacts.guard[0], self._modes(member)
        closed = [k for k in self.bodies if k == event or k in lasting or gaps[k] <= CLOSED * self.length[member]]
        approach = max(0.0, -float(contacts.speed[0, [contacts.normal(k) for k in closed]].min()))
        self.encounters.fastest[member] = max(self.encounters.fastest[member], approach)
        if (jumped := self._impact(member, time, contacts, closed)) is None:
            return z
        jump, hit = jumped
        z = z.copy()
        z[: self.n] += onto_contacts(contacts, {event: "slip"})[0][0]
        z[self.velocities :] += jump
        if approach > self.slow(member):
            for k in self.bodies:
                if k in hit and k not in lasting:
                    self.records.add(member, time, k, self.model.events[k][1])
        return self.settle(member, time, z)

    def pushed(self, member: int, time: float, z: Array, contacts: ContactQuantities) -> Array:
        """Return the state after a jump of prescribed speeds has led to `z`; pressed contacts remain closed."""
        closed = [
            k for k in self.bodies if k in self._modes(member) or contacts.guard[0, k] <= CLOSED * self.length[member]
        ]
        # bodies that did not approach before do not rebound
        law = contacts.law.copy()
        law[..., 0] = 0.0
        if (jumped := self._impact(member, time, replace(contacts, law=law), closed)) is None:
            return z
        before, z = self._modes(member), z.copy()
        z[self.velocities :] += jumped[0]
        z = self.settle(member, time, z)
        self._changed(member, time, before, contacts)
        return z

    def _impact(
        self, member: int, time: float, contacts: ContactQuantities, closed: list[int]
    ) -> tuple[Array, set[int]] | None:
        """Return the jump of the velocities and the hit contacts; None, with a message, if no impulses exist."""
        found = impact(contacts, closed, 1e-3 * self.slow(member))
        if found is None:
            normals = [contacts.normal(k) for k in closed]
            name = self.model.events[closed[int(np.argmin(contacts.speed[0, normals]))]][0]
            self.messages[member] = (
                f"{name!r}: no impulses satisfy the laws of impact at t = {time:.6g} s. Check whether a driver pushes "
                "one body into another."
            )
        return found

    # -- contacts that last ------------------------------------------------------------------------------------------
    def settle(self, member: int, time: float, z: Array, leaving: int | None = None) -> Array:
        """Make closed and pressed contacts persistent if they do not open; treat other contacts as open."""
        contacts = self.contacts(member, time, z)
        slow, before = self.slow(member), dict(self._modes(member))
        gaps, length = contacts.guard[0], self.length[member]
        near = [
            k
            for k in self.bodies
            if k != leaving
            and gaps[k] <= (HELD if k in before else CLOSED) * length
            and abs(contacts.speed[0, contacts.normal(k)]) <= slow
        ]
        if (found := persistent_contacts(contacts, near, slow)) is None:
            # normal speeds that count as zero would change the sliding of bodies that stay together
            z = self._onto(member, time, z, dict.fromkeys(near, "slip"))
            contacts = self.contacts(member, time, z)
            found = persistent_contacts(contacts, near, slow)
        if found is None:
            names = ", ".join(repr(self.model.events[k][0]) for k in near)
            self.messages[member] = (
                f"{names}: no forces satisfy the laws of contact and friction at t = {time:.6g} s. A sliding body is "
                "wedged (Painleve's paradox). Lower the coefficient of friction, or use a compliant contact."
            )
            return z
        self._keep(member, found.lasting, contacts)
        modes, headings, _ = found.lasting
        if found.several and member not in self.several:
            names = ", ".join(repr(self.model.events[k][0]) for k in near)
            # contacts at the start are evaluated slightly after the first time
            when = self.duration * round(time / self.duration, 9)
            self.several[member] = (
                f"at t = {when:.6g} s, two motions satisfy the laws of contact and friction at {names}"
            )
        for k in before:
            if k not in modes:
                self.records.add(member, time, k, "lift-off")
        for k in modes:
            if k not in before:
                self.records.add(member, time, k, "rest")
        # remove a sliding speed that counts as zero if the contact starts to slide in the opposite direction
        held: dict[int, Mode] = {
            k: "stick" if k in headings and contacts.sliding(k)[0] @ headings[k] < 0 else mode
            for k, mode in modes.items()
        }
        return self._onto(member, time, z, held) if modes else z

    def lasting(self, member: int) -> ContactModes:
        """Return the persistent contacts of a realisation, which the driver follows."""
        e, first = self.encounters, self.evaluator.first
        modes: dict[int, Mode] = {
            k: "stick" if mode == Touching.STICK else "slip"
            for k, mode in enumerate(e.mode[member].tolist())
            if mode != Touching.OPEN
        }
        headings = {
            k: e.heading[member, first[k] + 1 : first[k + 1]].copy()
            for k in modes
            if e.mode[member, k] == Touching.SLIP
        }
        return ContactModes(modes, headings, e.internal[member].copy() if e.internal[member].any() else None)

    def _modes(self, member: int) -> dict[int, Mode]:
        return self.lasting(member).modes

    def _keep(self, member: int, lasting: ContactModes, contacts: ContactQuantities) -> None:
        """Store the persistent contacts in the arrays of the driver."""
        e = self.encounters
        e.mode[member], e.heading[member], e.internal[member] = Touching.OPEN, 0.0, 0.0
        if lasting.internal is not None:
            e.internal[member] = lasting.internal
        for k, mode in lasting.modes.items():
            if not contacts.has_friction(k):
                e.mode[member, k] = Touching.SMOOTH
                continue
            e.mode[member, k] = Touching.STICK if mode == "stick" else Touching.SLIP
            if mode == "slip":
                e.heading[member, contacts.tangents(k)] = lasting.headings[k]

    def _onto(self, member: int, time: float, z: Array, modes: dict[int, Mode]) -> Array:
        """Project a state onto constraints and persistent contacts."""
        z = z.copy()
        if self.model.layout.rank:
            q, v = excess(self.model, z[None], np.array([time]), self.batch.block[member : member + 1])
            z[: self.n] -= np.nan_to_num(q[0])
            z[self.velocities :] -= np.nan_to_num(v[0])
        q, v = onto_contacts(self.contacts(member, time, z), modes)
        z[: self.n] += np.nan_to_num(q[0])
        z[self.velocities :] += np.nan_to_num(v[0])
        return z
