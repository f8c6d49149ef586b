"""Events of an explicit integration: what the driver is told of contacts, and what it tells of what happens."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np

from uqmbd.compiled import driver as c
from uqmbd.compiled.driver import address
from uqmbd.compiled.programs import Part
from uqmbd.typing import Index

__all__ = ["Contacts", "Encounters", "Touching"]

ROOM = 64
"""Marks of a realisation that are noted before somebody takes them, besides those of one step."""
STEP = 8
"""Marks of one kind that a step may bring."""


class Touching(IntEnum):
    """What a contact does; as in events.h."""

    OPEN = 0
    STICK = 1
    SLIP = 2
    SMOOTH = 3


@dataclass(frozen=True)
class Contacts:
    """Events of a mechanism, as programs on the work array of its `Dynamics`; rows are rows of that.

    Attributes
    ----------
    first : array of int, shape (event + 1,)
        First direction of each event, then the end; an event without directions is a mark.
    guards : Part
        From a state to its guards.
    guard : array of int, shape (event,)
        Rows of the guards.
    contact : Part
        From a state to all that is known of its contacts, and its index-1 system.
    gap, law : array of int, shape (event,) and (event, 2)
        Rows of the gaps, of the coefficients of restitution and of friction.
    speed, bias : array of int, shape (direction,)
        Rows of relative velocities, and of their rates without accelerations.
    slope : array of int, shape (direction, coordinate)
        Rows of how velocities enter the speeds.
    size : int
        Unknowns of the index-1 system.
    rows, columns, values : array of int, shape (entry,)
        Where its entries are, and their rows of the work array.
    right : array of int, shape (size,)
        Rows of its right-hand side.
    """

    first: Index
    guards: Part
    guard: Index
    contact: Part
    gap: Index
    law: Index
    speed: Index
    bias: Index
    slope: Index
    size: int
    rows: Index
    columns: Index
    values: Index
    right: Index

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what is made anew: addresses."""
        return {key: value for key, value in self.__dict__.items() if key != "structure"}

    @cached_property
    def structure(self) -> c.Contacts:
        """What the driver reads."""
        parts = self.guards.structure, self.contact.structure
        found = c.Contacts(
            *(len(self.guard), len(self.speed), address(self.first)),
            *(parts[0], address(self.guard), parts[1]),
            *map(address, (self.gap, self.law, self.speed, self.bias, self.slope)),
            *(self.size, len(self.rows)),
            *map(address, (self.rows, self.columns, self.values, self.right)),
        )
        found.kept = parts
        return found


class Encounters:
    """What happens to M realisations: rows of arrays, which the driver and whoever decides share.

    Parameters
    ----------
    contacts : Contacts
        What may happen.
    count : int
        M.
    watched : bool
        Whether guards are looked at; else contacts stay as they are.

    Attributes
    ----------
    mode : array of int, shape (M, event)
        What each contact does, see `Touching`.
    heading : array, shape (M, direction)
        In which direction a contact slides that slips.
    internal : array, shape (M, direction)
        Forces of redundant contacts that last, beside the least ones: they move nothing, and enter the guards.
    resting : array of int, shape (M, 2 event)
        Guards that are zero, and have to rise before they can fall: of each event that of its gap (or of the normal
        force, while it lasts), then that of its friction.
    rise : array, shape (M, 2 event)
        Their rates, where they are known.
    length, slow : array, shape (M,)
        Size of the mechanism, and a speed that is none.
    happened : array of int, shape (M,)
        The guard that has fallen.
    noted : array of int, shape (M,)
        How many marks wait to be taken.
    mark, mark_times : array, shape (M, room)
        Which they are, and when they were.
    """

    def __init__(self, contacts: Contacts, count: int, *, watched: bool = True) -> None:
        events, directions = len(contacts.guard), len(contacts.speed)
        self.mode, self.heading = np.zeros((count, events), dtype=np.int64), np.zeros((count, directions))
        self.internal = np.zeros((count, directions))
        self.resting, self.rise = np.zeros((count, 2 * events), dtype=np.int64), np.zeros((count, 2 * events))
        self.length, self.slow = np.zeros((2, count))
        self.happened, self.noted = np.zeros((2, count), dtype=np.int64)
        marks = int(np.sum(np.diff(contacts.first) == 0))
        self.room = STEP * events + ROOM if marks else 0
        self.mark, self.mark_times = np.zeros((count, self.room), dtype=np.int64), np.zeros((count, self.room))
        self.watched = watched

    @cached_property
    def structure(self) -> c.Encounters:
        """What the driver reads and writes."""
        return c.Encounters(*(address(getattr(self, name)) for name in c.ENCOUNTERS), self.room, int(self.watched))
