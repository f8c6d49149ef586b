"""What becomes of one realisation at an event: impacts of all kinds, and contacts that last, stick, slip or open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uqmbd.compiled import Encounters, Touching
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.contact.chatter import Chatter
from uqmbd.dynamics.contact.evaluator import ContactEvaluator, Contacts
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
from uqmbd.dynamics.contact.records import Records
from uqmbd.dynamics.linear import excess
from uqmbd.typing import Array

__all__ = ["Decisions"]


HELD = 1e-6
"""Gap, over the size of the mechanism, that a contact may have that has lasted so far."""


class Decisions:
    """Decides about realisations, one at a time.

    Parameters
    ----------
    batch : Batch
        M realisations.
    evaluator : ContactEvaluator
        Of the model.
    encounters : Encounters
        Where it is written what contacts do.
    chatter : Chatter
    records : Records

    Attributes
    ----------
    messages : list of str
        Why a realisation cannot go on.
    bodies : list of int
        Events in which bodies meet.
    """

    def __init__(
        self, batch: Batch, evaluator: ContactEvaluator, encounters: Encounters, chatter: Chatter, records: Records
    ) -> None:
        self.batch, self.model, self.evaluator = batch, batch.model, evaluator
        self.encounters, self.chatter, self.records = encounters, chatter, records
        self.n, self.velocities = self.model.layout.coordinates, self.model.layout.velocities
        self.bodies = [k for k, (*_, directions) in enumerate(self.model.events) if directions]
        self.messages = [""] * len(batch)
        self.lasting: dict[int, Lasting] = {}
        self.length = encounters.length

    def slow(self, member: int) -> float:
        """Speed that is none, m/s."""
        return float(self.chatter.slow(np.array([member]))[0])

    def contacts(self, member: int, time: float, z: Array) -> Contacts:
        """Contacts of one state."""
        return self.evaluator(np.array([time]), z[None], self.batch.block[member : member + 1])

    # -- events ------------------------------------------------------------------------------------------------------
    def after(self, member: int, guard: int, time: float, z: Array, contacts: Contacts) -> Array:
        """State after an event.

        Parameters
        ----------
        member : int
            Which realisation.
        guard : int
            Which of its guards has fallen, see `Encounters`.
        time : float
            s.
        z : array, shape (width,)
            Right before.
        contacts : Contacts
            Of that state.
        """
        k, friction = divmod(guard, 2)
        lasting = self.lasting.get(member)
        mode = None if lasting is None else lasting.modes.get(k)
        if mode is None:
            return self._hit(member, time, z, k, contacts)
        assert lasting is not None
        if not friction:
            return self.settle(member, time, z, leaving=k)
        if mode == "slip":
            sliding = contacts.sliding(k)[0]
            fast = float(np.linalg.norm(sliding))
            if fast > self.slow(member):  # it has only turned
                self._keep(member, lasting._replace(headings={**lasting.headings, k: sliding / fast}), contacts)
                return z
            z = self.settle(member, time, z)
            if member in self.lasting and self.lasting[member].modes.get(k) == "stick":
                self.records.add(member, time, k, "stick")
            return z
        return self._slipping(member, time, z, k, contacts)

    def _slipping(self, member: int, time: float, z: Array, event: int, contacts: Contacts) -> Array:
        """State after friction has come to its limit in a contact that sticks."""
        before = self.lasting[member]
        if len(before.modes) > 1:
            # others may slip, too, or internal forces hold the bodies
            z = self.settle(member, time, z)
            after = self.lasting.get(member, Lasting({}, {}))
            if self.messages[member] or after.modes.get(event) != "stick" or after.internal is not None:
                for k, mode in before.modes.items():
                    if mode == "stick" and after.modes.get(k) == "slip":
                        self.records.add(member, time, k, "slip")
                return z
            before, contacts = after, self.contacts(member, time, z)
        self.records.add(member, time, event, "slip")
        force = contact_motion(contacts, before).force[0, contacts.tangents(event)]
        slips: dict[int, Mode] = {**before.modes, event: "slip"}
        self._keep(member, Lasting(slips, {**before.headings, event: heading_of(force)}), contacts)
        return z

    def _hit(self, member: int, time: float, z: Array, event: int, contacts: Contacts) -> Array:
        """Impact: new velocities, or a contact that lasts."""
        gaps, lasting = contacts.guard[0], self._modes(member)
        closed = [k for k in self.bodies if k == event or k in lasting or gaps[k] <= CLOSED * self.length[member]]
        approach = max(0.0, -float(contacts.speed[0, contacts.normal(event)]))
        self.chatter.fastest[member] = max(self.chatter.fastest[member], approach)
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

    def pushed(self, member: int, time: float, z: Array, contacts: Contacts) -> Array:
        """State after a jump of velocities that speeds impose, which has led to `z`; contacts that are pressed hold."""
        closed = [
            k for k in self.bodies if k in self._modes(member) or contacts.guard[0, k] <= CLOSED * self.length[member]
        ]
        # what did not approach before does not rebound
        law = contacts.law.copy()
        law[..., 0] = 0.0
        if (jumped := self._impact(member, time, replace(contacts, law=law), closed)) is None:
            return z
        z = z.copy()
        z[self.velocities :] += jumped[0]
        return self.settle(member, time, z)

    def _impact(self, member: int, time: float, contacts: Contacts, closed: list[int]) -> tuple[Array, set[int]] | None:
        """Jump of the velocities, and what is hit; None, with a message, where no impulses satisfy the laws."""
        found = impact(contacts, closed, 1e-3 * self.slow(member))
        if found is None:
            normals = [contacts.normal(k) for k in closed]
            name = self.model.events[closed[int(np.argmin(contacts.speed[0, normals]))]][0]
            self.messages[member] = (
                f"{name!r}: no impulses satisfy the laws of impact at t = {time:.6g} s; is a body driven into another?"
            )
        return found

    # -- contacts that last ------------------------------------------------------------------------------------------
    def settle(self, member: int, time: float, z: Array, leaving: int | None = None) -> Array:
        """Let contacts last that are closed, do not open and are pressed; the others are open."""
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
        if (found := lasting_contacts(contacts, near, slow)) is None:
            # speeds across the surfaces that are none leave slidings that are not those of bodies which stay together
            z = self._onto(member, time, z, dict.fromkeys(near, "slip"))
            contacts = self.contacts(member, time, z)
            found = lasting_contacts(contacts, near, slow)
        if found is None:
            names = ", ".join(repr(self.model.events[k][0]) for k in near)
            self.messages[member] = (
                f"{names}: no forces satisfy the laws of contact and friction at t = {time:.6g} s; what slides is "
                "wedged (Painleve's paradox). Lower the coefficient of friction, or use a compliant contact."
            )
            return z
        self._keep(member, found[0], contacts)
        modes, headings, _ = found[0]
        for k in before:
            if k not in modes:
                self.records.add(member, time, k, "lift-off")
        for k in modes:
            if k not in before:
                self.records.add(member, time, k, "rest")
        # a sliding that is none is let go where the contact starts to slide the other way
        held: dict[int, Mode] = {
            k: "stick" if k in headings and contacts.sliding(k)[0] @ headings[k] < 0 else mode
            for k, mode in modes.items()
        }
        return self._onto(member, time, z, held) if modes else z

    def _modes(self, member: int) -> dict[int, Mode]:
        return self.lasting[member].modes if member in self.lasting else {}

    def _keep(self, member: int, lasting: Lasting, contacts: Contacts) -> None:
        """Remember what lasts, and tell the driver."""
        e = self.encounters
        e.mode[member], e.heading[member], e.internal[member] = Touching.OPEN, 0.0, 0.0
        self.lasting.pop(member, None)
        if not lasting.modes:
            return
        self.lasting[member] = lasting
        if lasting.internal is not None:
            e.internal[member] = lasting.internal
        for k, mode in lasting.modes.items():
            if not contacts.rubs(k):
                e.mode[member, k] = Touching.SMOOTH
                continue
            e.mode[member, k] = Touching.STICK if mode == "stick" else Touching.SLIP
            if mode == "slip":
                e.heading[member, contacts.tangents(k)] = lasting.headings[k]

    def turned(self, member: int) -> None:
        """Read the directions of sliding that the driver has followed."""
        headings = self.lasting[member].headings
        first = self.evaluator.first
        followed = {k: self.encounters.heading[member, first[k] + 1 : first[k + 1]].copy() for k in headings}
        self.lasting[member] = self.lasting[member]._replace(headings=followed)

    def _onto(self, member: int, time: float, z: Array, modes: dict[int, Mode]) -> Array:
        """Put a state onto constraints and lasting contacts."""
        z = z.copy()
        if self.model.layout.rank:
            q, v = excess(self.model, z[None], np.array([time]), self.batch.block[member : member + 1])
            z[: self.n] -= np.nan_to_num(q[0])
            z[self.velocities :] -= np.nan_to_num(v[0])
        q, v = onto_contacts(self.contacts(member, time, z), modes)
        z[: self.n] += np.nan_to_num(q[0])
        z[self.velocities :] += np.nan_to_num(v[0])
        return z
