"""Contacts, events and sampled controllers of an explicit integration: data that the driver and Python share."""

from __future__ import annotations

import ctypes
from copy import copy
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property

import numpy as np

from uqmbd.compiled import driver as c
from uqmbd.compiled.driver import address
from uqmbd.compiled.programs import Addressed, ProgramPart
from uqmbd.typing import Array, Index

__all__ = ["ContactPrograms", "ControlLaws", "Encounters", "Happening", "SampledControl", "Touching"]

ROOM = 64
"""Number of marker events that a realisation stores before they are read, in addition to those of one step."""
STEP = 8
"""Maximum number of marker events of one kind in a step."""


CLUSTER = 100
"""Number of events in a short time that count as a cluster, as in events.h."""
BOUNCES = 1e-6
"""Impact speed, relative to the fastest previous impact, below which bodies stay together, as in decisions.c."""


class Happening(IntEnum):
    """What has happened at an event, as in events.h: its declaration, or a change of a contact."""

    OWN = 0
    STICK = 1
    SLIP = 2
    REST = 3
    LIFT_OFF = 4


class Touching(IntEnum):
    """State of a contact, as in events.h."""

    OPEN = 0
    STICK = 1
    SLIP = 2
    SMOOTH = 3


@dataclass(frozen=True)
class ContactPrograms(Addressed):
    """Events of a mechanism, as programs on the work array of its `Dynamics`; rows refer to this array."""

    first: Index  # (event + 1,): first direction of each event, and the end; an event without directions is a marker
    guards: ProgramPart  # maps a state to its guards
    guard: Index  # (event,): rows of the guards
    contact: ProgramPart  # maps a state to the quantities of its contacts and its index-1 system
    gap: Index  # (event,): rows of the gaps
    law: Index  # (event, 2): rows of the coefficients of restitution and of friction
    speed: Index  # (direction,): rows of the relative velocities
    bias: Index  # (direction,): rows of the rates of relative velocities at zero acceleration
    slope: Index  # (direction, coordinate): rows of the derivatives of the relative velocities by velocities
    size: int  # number of unknowns of the index-1 system
    rows: Index  # (entry,): row of each entry of the matrix
    columns: Index  # (entry,): column of each entry
    values: Index  # (entry,): row of the work array of each entry
    right: Index  # (size,): rows of the right-hand side
    # factorisation, and solution for a right-hand side that begins in row `side`; without steps, none is compiled
    factor: ProgramPart = ProgramPart((), 0)
    solve: ProgramPart = ProgramPart((), 0)
    side: int = 0
    solution: Index = field(default_factory=lambda: np.zeros(0, dtype=np.int64))  # (size,): rows of the solution

    @cached_property
    def structure(self) -> c.ContactsStruct:
        """Return the C structure for the driver."""
        parts = [x.structure for x in (self.guards, self.contact, self.factor, self.solve)]
        found = c.ContactsStruct(
            *(len(self.guard), len(self.speed), address(self.first)),
            *(parts[0], address(self.guard), parts[1]),
            *map(address, (self.gap, self.law, self.speed, self.bias, self.slope)),
            *(self.size, len(self.rows)),
            *map(address, (self.rows, self.columns, self.values, self.right)),
            *(parts[2], parts[3], self.side, address(self.solution)),
        )
        found.kept = parts
        return found


class Encounters:
    """Contact states of M realisations: arrays that the driver and the event handling in Python share.

    Guards are evaluated if `watched`; otherwise contacts keep their states. Each event has two guards. The first is the
    guard of its gap (or of the normal force, while the contact lasts), the second the guard of its friction. If the
    driver `decides`, it handles most events; events within `window`, s, may be a cluster, and decisions within
    `together`, s, are at one instant.
    """

    def __init__(
        self,
        contacts: ContactPrograms,
        count: int,
        *,
        watched: bool = True,
        decides: bool = False,
        window: float = 0.0,
        together: float = 0.0,
    ) -> None:
        events, directions = len(contacts.guard), len(contacts.speed)
        # (M, event): state of each contact, see `Touching`; (M, direction): direction of sliding during slip
        self.mode, self.heading = np.zeros((count, events), dtype=np.int64), np.zeros((count, directions))
        # (M, direction): forces of redundant lasting contacts in addition to the minimum-norm forces; they affect the
        # guards, but not the motion
        self.internal = np.zeros((count, directions))
        # (M, 2 event): guards that are zero, and must rise before they can fall; (M, 2 event): their rates, if known
        self.resting, self.rise = np.zeros((count, 2 * events), dtype=np.int64), np.zeros((count, 2 * events))
        # (M,): size of the mechanism, and a speed below which it counts as zero
        self.length, self.slow = np.zeros((2, count))
        # (M,): the guard that has fallen, and the number of unread markers
        self.happened, self.noted = np.zeros((2, count), dtype=np.int64)
        marks = int(np.sum(np.diff(contacts.first) == 0))
        self.room = STEP * events + ROOM if marks or decides else 0
        # (M, room): the events, what has happened, see `Happening`, and their times, s
        self.mark, self.mark_labels = np.zeros((2, count, self.room), dtype=np.int64)
        self.mark_times = np.zeros((count, self.room))
        self.watched, self.decides, self.window, self.together = watched, decides, window, together
        # whether realisations stop at each restart
        self.reports = False
        # (M,): numbers of events, of restarts, and of events without progress in time
        self.total, self.restarts, self.stalled = np.zeros((3, count), dtype=np.int64)
        # times of the last events, s (M, event), and their number (M,)
        self.recent, self.clustered = np.zeros((count, CLUSTER)), np.zeros(count, dtype=np.int64)
        # (M,): times of the last restart and the last turn of a starting slide, and until which the caller decides, s
        self.since, self.turned, self.later = np.full((3, count), -np.inf)
        # (M,): fastest impact, m/s; factor of the speed below which bodies stay together; speed that counts as zero
        # after the start of sliding, m/s
        self.fastest, self.coarse, self.starting = np.zeros(count), np.ones(count), np.zeros(count)
        # (M, event): contacts that stick without a reserve of friction; (M,): guards are unknown
        self.held, self.arming = np.zeros((count, events), dtype=np.int64), np.zeros(count, dtype=np.int64)

    def still(self, members: Index | int) -> Array:
        """Return the normal speeds below which bodies stay together, m/s."""
        found: Array = np.maximum(self.coarse[members] * BOUNCES * self.fastest[members], 1e-12 * self.length[members])
        return found

    @cached_property
    def structure(self) -> c.EncountersStruct:
        """Return the C structure that the driver reads and writes."""
        if self.decides:
            c.link("decisions")
        return c.EncountersStruct(
            *(address(getattr(self, name)) for name in c.ENCOUNTERS),
            *(self.room, int(self.watched), int(self.decides), int(self.reports), self.window, self.together),
        )


@dataclass(frozen=True)
class ControlLaws(Addressed):
    """Sampled controllers, as programs of (state, time, zero, numbers of a realisation) on one work array.

    The program of a law computes commands and states. The program of a function, which the caller evaluates, computes
    measured values. Held entries are the commands of each loop, then its states, loop by loop.
    """

    laws: tuple[ProgramPart, ...]  # (loop,): maps a state to commands and states, or to measured values
    rows: int  # number of rows of the work array
    asked: Index  # (loop + 1,): first measured value of each function, and the end; laws have none
    seen: Index  # (measured,): rows of the measured values of functions
    first: Index  # (loop + 1,): first held entry of each loop, and the end
    commands: Index  # (loop,): number of commands
    residual: Index  # (loop,): row of the residual of measured accelerations; -1: no accelerations are measured
    poor: float  # largest residual of accurate accelerations
    result: Index  # (entry,): rows of the results; any row for functions
    held: Index  # (entry,): indices in a state

    @cached_property
    def structure(self) -> ctypes.Array[c.ProgramStruct]:
        """Return the C structures of the programs for the driver."""
        parts = [law.structure for law in self.laws]
        found = (c.ProgramStruct * len(parts))(*parts)
        vars(found)["kept"] = parts
        return found


class SampledControl:
    """Sampled controllers of M realisations: arrays that the driver and the decisions in Python share.

    The `instants` (N,) are ascending times in s at which integration intervals end; the first is due at the start.
    `acting` and `sampled` (N, loop) are indices in `pending`: of the commands that begin to act, and of the commands
    computed by a sample; -1: none. Commands of loops that are `direct` (loop,) act at their sample. The numbers of each
    realisation are `values` (M, number), and the limits of the commands `low` and `high` (M, entry).
    """

    def __init__(
        self,
        laws: ControlLaws,
        instants: Array,
        acting: Index,
        sampled: Index,
        direct: Index,
        values: Array,
        low: Array,
        high: Array,
        places: int,
    ) -> None:
        self.laws, self.instants, self.acting, self.sampled, self.direct = laws, instants, acting, sampled, direct
        self.values, self.low, self.high = (np.ascontiguousarray(x, dtype=float) for x in (values, low, high))
        # (M, place): commands that do not act yet; (M,): the instant that is due, or -1
        self.pending, self.instant = np.zeros((len(values), places)), np.zeros(len(values), dtype=np.int64)
        # (M, measured): measured values for functions; (M, entry): returned commands and states, valid if `answered`
        # (M,)
        self.measured, self.answers = np.zeros((len(values), len(laws.seen))), np.zeros(self.low.shape)
        self.answered = np.zeros(len(values), dtype=np.int64)
        self.ends = np.zeros(0, dtype=np.int64)

    def ending(self, ends: Array) -> Index:
        """Set and return the instants at the ends (interval,) of integration intervals, s; -1 without an instant."""
        at = np.minimum(np.searchsorted(self.instants, ends), len(self.instants) - 1)
        self.ends = np.where(self.instants[at] == ends, at, -1).astype(np.int64)
        return self.ends

    def of(self, member: int) -> SampledControl:
        """Return the controllers of one realisation, which continues in a separate integration state."""
        other = copy(self)
        other.__dict__.pop("structure", None)
        for name in ("values", "low", "high", "pending", "instant", "measured", "answers", "answered"):
            setattr(other, name, getattr(self, name)[member : member + 1].copy())
        return other

    @cached_property
    def structure(self) -> c.ControlStruct:
        """Return the C structure that the driver reads and writes."""
        laws, programs = self.laws, self.laws.structure
        found = c.ControlStruct(
            *(laws.rows, self.values.shape[1], len(laws.laws), len(laws.held), ctypes.addressof(programs)),
            *map(address, (laws.asked, laws.seen, laws.first, laws.commands, self.direct, laws.residual)),
            laws.poor,
            *map(address, (laws.result, laws.held, self.acting, self.sampled, self.ends)),
            *map(address, (self.values, self.low, self.high, self.pending)),
            self.pending.shape[1],
            *map(address, (self.instant, self.measured, self.answers, self.answered)),
        )
        found.kept = programs
        return found
