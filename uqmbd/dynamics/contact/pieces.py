"""What an event-driven integration yields: events, and the motions between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.dynamics.contact.lasting import Mode
from uqmbd.dynamics.integration import Curve
from uqmbd.typing import Array

__all__ = ["EventRecord", "MotionPiece"]


@dataclass(frozen=True)
class EventRecord:
    """An event of a realisation: when it was, which event of the model, and what happened."""

    time: float
    event: int
    label: str


@dataclass(frozen=True)
class MotionPiece:
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
