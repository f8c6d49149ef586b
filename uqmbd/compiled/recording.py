"""Steps of an explicit integration, recorded by the driver: the motion between output times."""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy
from typing import NamedTuple

import numpy as np

from uqmbd.typing import Array, Index, Mask

__all__ = ["FULL", "PLACES", "Path", "Recorder"]


PLACES = 0.5 - 0.5 * np.cos(np.pi * np.arange(8) / 7)
"""Parts of a step at which its states are recorded: as many as determine the interpolant, which has degree 7."""

ROOM = 1 << 21
"""Numbers of recorded states that are held until they are taken, and at most ..."""

MOST = 32
"""... so many steps of each."""

FULL, RUNNING = 11, 0
"""Status of a realisation whose steps are to be taken, and afterwards; as in dop853.h."""


class Path(NamedTuple):
    """Recorded steps of realisations, in the order in which they were taken; what comes later holds.

    Attributes
    ----------
    owner : array of int, shape (P,)
        Of which realisation each is.
    ends : array, shape (P, 2)
        Begin and end, s.
    kept : array of bool, shape (P,)
        Whether contacts last.
    states : array, shape (P, 8, width)
        By interpolation, at `PLACES` from begin to end.
    """

    owner: Index
    ends: Array
    kept: Mask
    states: Array

    def placed(self, numbers: Index) -> Path:
        """Return the steps of realisations that have other numbers elsewhere; those with negative ones are left out."""
        owner = numbers[self.owner]
        some = owner >= 0
        return Path(owner[some], self.ends[some], self.kept[some], self.states[some])

    @classmethod
    def joined(cls, paths: Iterable[Path | None]) -> Path | None:
        """Join several; None where there is none."""
        found = [path for path in paths if path is not None]
        return cls(*(np.concatenate(parts) for parts in zip(*found, strict=True))) if found else None


class Recorder:
    """Room for the steps of some realisations, and what was recorded so far.

    Parameters
    ----------
    count, width : int
        Realisations, and length of a state.
    recording : bool
        Whether anything is recorded.
    """

    def __init__(self, count: int, width: int, *, recording: bool) -> None:
        self.room = min(max(ROOM // max(1, count * len(PLACES) * width), 1), MOST) if recording else 0
        self.path = np.empty((count, self.room, len(PLACES), width))
        self.path_ends, self.path_kept = np.empty((count, self.room, 2)), np.zeros((count, self.room), dtype=np.int8)
        self.recorded, self.owner, self.taken = np.zeros(count, dtype=np.int64), np.arange(count), list[Path]()

    def of(self, member: int) -> Recorder:
        """Make the recorder of one of the realisations, which goes on elsewhere; what was recorded stays together."""
        other, one = copy(self), slice(member, member + 1)
        for name in ("path", "path_ends", "path_kept", "recorded", "owner"):
            setattr(other, name, getattr(self, name)[one].copy())
        return other

    def take(self, status: Index) -> None:
        """Take the steps that were recorded, so that there is room again."""
        if not self.room or not np.any(self.recorded):
            return
        used = np.arange(self.room) < self.recorded[:, None]
        owner = np.broadcast_to(self.owner[:, None], used.shape)[used]
        self.taken.append(Path(owner, self.path_ends[used], self.path_kept[used] != 0, self.path[used]))
        self.recorded[:] = 0
        status[status == FULL] = RUNNING

    def passed(self, member: int, begin: float, end: float, states: Array) -> None:
        """Record what somebody else has led a member through: states (8, width) at `PLACES` from begin to end."""
        if self.room:
            ends, kept = np.array([[begin, end]]), np.zeros(1, dtype=bool)
            self.taken.append(Path(self.owner[member : member + 1], ends, kept, states[None]))

    @property
    def found(self) -> Path | None:
        """All steps that were recorded; None: none is."""
        if not self.room:
            return None
        none = np.zeros((0, *self.path.shape[2:]))
        first = Path(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros(0, dtype=bool), none)
        return Path.joined([first, *self.taken])
