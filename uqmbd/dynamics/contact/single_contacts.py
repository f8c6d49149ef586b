"""Decisions about one contact of each of many realisations at once: rest, lift-off, and the end of sliding.

The results are those of `Decisions.after`, which handles all other events: several contacts, the start of sliding,
sliding to the opposite side, and states near the limits of the laws.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uqmbd.compiled import Touching
from uqmbd.dynamics.contact.decisions import HELD, Decisions
from uqmbd.dynamics.contact.evaluator import ContactQuantities
from uqmbd.dynamics.contact.persistent import CLOSED, Mode, onto_contacts
from uqmbd.dynamics.contact.single_impacts import solve_single_impacts
from uqmbd.dynamics.linear import excess
from uqmbd.typing import Array, Index, Mask

__all__ = ["SingleContacts"]


CLEAR = 1e-6
"""Least relative distance from the limit of friction, and least relative eigenvalue, for a decision in this module."""


MODES: tuple[Mode, ...] = ("stick", "slip")
HOLDS = {"": 0, "stick": 1, "slip": 2}


class _SingleMode(NamedTuple):
    """Mode of a contact, heading (tangent,) of slip, and the `Mode` by which a projection removes speeds."""

    touching: Touching
    heading: Array | None
    holds: str


_OPEN, _SMOOTH = _SingleMode(Touching.OPEN, None, ""), _SingleMode(Touching.SMOOTH, None, "slip")
_STICK = _SingleMode(Touching.STICK, None, "stick")


class SingleContacts:
    """Decisions about realisations with one closed contact; `decisions` contains their state."""

    def __init__(self, decisions: Decisions) -> None:
        self.decisions, self.model, self.evaluator = decisions, decisions.model, decisions.evaluator
        self.n, self.velocities = decisions.n, decisions.velocities
        self.first, self.bodies = np.array(self.evaluator.first), np.array(decisions.bodies, dtype=np.int64)

    def after(
        self, members: Index, guards: Index, now: Array, times: Array, z: Array, contacts: ContactQuantities
    ) -> tuple[Array, Mask]:
        """Return states after events from the states `z` (M, width) before them, and a mask (M,) of the decided events.

        The events are guards (M,) at times `now` (M,), s; the contacts belong to the states, at times (M,), s, at which
        prescribed functions do not jump.
        """
        d, z, (events, friction) = self.decisions, z.copy(), np.divmod(guards, 2)
        rows, normals = np.arange(len(members)), self.first[events]
        lasting = d.encounters.mode[members] != Touching.OPEN
        own = lasting[rows, events]
        length = d.length[members]
        alone = self._others_open(contacts, events, length)
        alone &= lasting.sum(axis=1) == own
        alone &= (np.diff(self.first)[events] > 0) & (friction <= own)
        alone &= ~contacts.loads[np.minimum(normals, self.first[-1] - 1)]
        alone &= np.array([not d.messages[m] for m in members.tolist()], dtype=bool)
        done = np.zeros(len(members), dtype=bool)
        for some, decide in (
            (alone & own & (friction == 0), self._lift_off),
            (alone & ~own, self._impact),
            (alone & own & (friction == 1), self._end_sliding),
        ):
            some = np.flatnonzero(some)
            if len(some):
                given = members[some], events[some], now[some], times[some], z[some], contacts.select(some)
                z[some], done[some] = decide(*given)
        return z, done

    def _others_open(self, contacts: ContactQuantities, events: Index, length: Array) -> Mask:
        """Return a mask of states in which all other contacts are open."""
        closed = contacts.guard[:, self.bodies] <= CLOSED * length[:, None]
        found: Mask = closed.sum(axis=1) == (contacts.guard[np.arange(len(events)), events] <= CLOSED * length)
        return found

    def _lift_off(
        self, members: Index, events: Index, now: Array, times: Array, z: Array, contacts: ContactQuantities
    ) -> tuple[Array, Mask]:
        d, rows = self.decisions, np.arange(len(members))
        done = np.abs(contacts.speed[rows, self.first[events]]) <= d.chatter.slow(members)
        for row in np.flatnonzero(done).tolist():
            m = int(members[row])
            d.starting[m] = 0.0
            d.keep_one(m, int(events[row]), Touching.OPEN, None)
            d.records.add(m, float(now[row]), int(events[row]), "lift-off")
        return z, done

    def _impact(
        self, members: Index, events: Index, now: Array, times: Array, z: Array, contacts: ContactQuantities
    ) -> tuple[Array, Mask]:
        d, rows, normals, before = self.decisions, np.arange(len(members)), self.first[events], z
        approach = np.maximum(0.0, -contacts.speed[rows, normals])
        d.chatter.fastest[members] = np.maximum(d.chatter.fastest[members], approach)
        slow = d.chatter.slow(members)
        hits = np.flatnonzero(approach > 1e-3 * slow)
        impulse, done, z = np.zeros_like(contacts.speed), np.ones(len(members), dtype=bool), z.copy()
        if len(hits):
            impulse[hits], _, done[hits] = solve_single_impacts(contacts.select(hits), events[hits])
        answer = contacts.answer[:, : self.n]
        back = -contacts.guard[rows, events] / contacts.delassus[rows, normals, normals]
        z[:, : self.n] += answer[rows, :, normals] * back[:, None]
        z[:, self.velocities :] += np.sum(answer * impulse[:, None, :], axis=2)
        contacts = self.evaluator(times, z, d.batch.block[members])
        done &= contacts.guard[rows, events] <= CLOSED * d.length[members]
        done &= self._others_open(contacts, events, d.length[members])
        found = [self._mode(contacts, row, int(events[row]), float(slow[row])) for row in rows.tolist()]
        done &= np.array([mode is not None for mode in found])
        for row in np.flatnonzero(done).tolist():
            m, k, mode = int(members[row]), int(events[row]), found[row]
            assert mode is not None
            d.starting[m] = 0.0
            if approach[row] > slow[row] and impulse[row, normals[row]] > 0:
                d.records.add(m, float(now[row]), k, self.model.events[k][1])
            d.keep_one(m, k, mode.touching, mode.heading)
            if mode.touching != Touching.OPEN:
                d.records.add(m, float(now[row]), k, "rest")
        z = self._onto(members, events, times, z, [mode if done[row] else None for row, mode in enumerate(found)])
        return np.where(done[:, None], z, before), done

    def _end_sliding(
        self, members: Index, events: Index, now: Array, times: Array, z: Array, contacts: ContactQuantities
    ) -> tuple[Array, Mask]:
        d, rows = self.decisions, np.arange(len(members))
        still = d.chatter.slow(members)
        slow = np.maximum(still, d.starting[members])
        done = contacts.guard[rows, events] <= HELD * d.length[members]
        done &= d.encounters.mode[members, events] == Touching.SLIP
        found = [
            self._mode(contacts, row, int(events[row]), float(slow[row])) if done[row] else None
            for row in rows.tolist()
        ]
        for row, mode in enumerate(found):
            m, k = int(members[row]), int(events[row])
            tangents = slice(int(self.first[k]) + 1, int(self.first[k + 1]))
            fast = np.linalg.norm(contacts.speed[row, tangents])
            # in all other cases, such as a turning direction of sliding, the decision depends on the history of the
            # contact
            done[row] = mode is not None and (
                (mode.touching == Touching.STICK and fast <= slow[row])
                or (mode.touching == Touching.SLIP and fast <= still[row])
            )
            if not done[row] or mode is None:
                found[row] = None
                continue
            d.keep_one(m, k, mode.touching, mode.heading)
            d.starting[m] = 0.0 if mode.touching == Touching.STICK else d.coarse[m]
            if mode.touching == Touching.STICK:
                d.records.add(m, float(now[row]), k, "stick")
        return self._onto(members, events, times, z, found), done

    def _mode(self, contacts: ContactQuantities, row: int, event: int, slow: float) -> _SingleMode | None:
        """Return the mode of the only closed contact of a state; None unless one solution is clear of all limits."""
        n, end = int(self.first[event]), int(self.first[event + 1])
        matrix, mu = contacts.delassus[row], float(contacts.law[row, event, 1])
        natural = contacts.bias[row] + np.sum(contacts.slope[row] * contacts.free[row, : self.n], axis=1)
        size, pressed = float(matrix[n, n]), bool(natural[n] < 0)
        if not (abs(contacts.speed[row, n]) <= slow and size > 0 and np.isfinite(natural).all()):
            return None
        if not mu > 0 or end == n + 1:
            return _SMOOTH if pressed else _OPEN
        sliding = contacts.speed[row, n + 1 : end]
        fast = float(np.linalg.norm(sliding))
        if fast > slow:
            heading = sliding / fast
            if not size - mu * float(matrix[n, n + 1 : end] @ heading) > CLEAR * size:
                return None
            return _SingleMode(Touching.SLIP, heading, "slip") if pressed else _OPEN
        inner = matrix[n:end, n:end]
        values = np.linalg.eigvalsh(inner)
        if not values[0] > CLEAR * values[-1]:
            return None
        if not size - mu * float(np.linalg.norm(matrix[n, n + 1 : end])) > CLEAR * size:
            return None  # Painlevé: another motion may be possible as well
        force = np.linalg.solve(inner, -natural[n:end])
        friction, most = float(np.linalg.norm(force[1:])), mu * float(force[0])
        if force[0] > 0 and friction < (1 - CLEAR) * most:
            return _STICK
        if end > n + 2 or not pressed or (force[0] > 0 and friction < (1 + CLEAR) * most):
            return None
        # in planar space, the contact begins to slide as it would without friction
        sense = float(np.copysign(1.0, natural[n + 1]))
        divisor = size - mu * sense * float(matrix[n, n + 1])
        if not divisor > CLEAR * size:
            return None
        along = natural[n + 1] - (matrix[n + 1, n] - mu * sense * matrix[n + 1, n + 1]) * natural[n] / divisor
        if not sense * along > CLEAR * abs(natural[n + 1]):
            return None
        return _SingleMode(Touching.SLIP, np.array([sense]), "stick" if sliding[0] * sense < 0 else "slip")

    def _onto(
        self, members: Index, events: Index, times: Array, z: Array, modes: Sequence[_SingleMode | None]
    ) -> Array:
        """Project states onto the constraints and their persistent contacts; others remain unchanged."""
        held = np.array([0 if mode is None else HOLDS[mode.holds] for mode in modes])
        some, d, z = np.flatnonzero(held), self.decisions, z.copy()
        if not len(some):
            return z
        states, blocks = z[some], d.batch.block[members[some]]
        if self.model.layout.rank:
            q, v = excess(self.model, states, times[some], blocks)
            states[:, : self.n] -= np.nan_to_num(q)
            states[:, self.velocities :] -= np.nan_to_num(v)
        contacts = self.evaluator(times[some], states, blocks)
        for k in np.unique(events[some]).tolist():
            for mode in MODES:
                chosen = np.flatnonzero((events[some] == k) & (held[some] == HOLDS[mode]))
                if len(chosen):
                    q, v = onto_contacts(contacts.select(chosen), {k: mode})
                    states[chosen, : self.n] += np.nan_to_num(q)
                    states[chosen, self.velocities :] += np.nan_to_num(v)
        z[some] = states
        return z
