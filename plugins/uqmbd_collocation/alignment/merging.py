"""Merging of events with equal phases that all realisations pass between the same events."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uqmbd.typing import Array
from uqmbd_collocation.alignment.markers import PER_TURN, TURN

__all__ = ["Merged", "merged"]


NEAR = 0.1
"""Smallest distance of a phase from an event in all realisations, relative to the distance between phases."""


@dataclass(frozen=True, eq=False)
class Merged:
    """Markers of an element: ends of its segments between events, and phases in each segment."""

    phases: tuple[Array, ...]  # marker phases of each segment between events, rad, increasing; may be empty
    dropped: int  # number of phases that are omitted: in different segments, or too near to an event
    ending: bool = False  # whether the last segment ends at the last of its phases instead of an event

    @property
    def kept(self) -> int:
        """Number of phases that are markers."""
        return sum(map(len, self.phases))

    def labels(self, events: tuple[str, ...]) -> tuple[str, ...]:
        """Return the event at the end of each segment, from the sequence of events; empty for a phase."""
        found = list[str]()
        for phases, event in zip(self.phases, events, strict=True):
            found += [*("",) * len(phases), event]
        return tuple(found[:-1] if self.ending else found)

    def farther(self, late: float, pace: float) -> Merged:
        """Return the markers of a motion that is `late` s longer, in segments of `pace` s; at most twice as many."""
        *others, last = self.phases
        more = min(int(np.ceil(late / max(pace, 1e-300))) + 1, self.kept)
        behind = last[-1] + (1 + np.arange(more)) * TURN / PER_TURN
        return replace(self, phases=(*others, np.append(last, behind)))


def merged(edges: Array, reached: float = np.inf) -> Merged:
    """Merge phases at multiples of a part of a turn with events at the increasing phases `edges` (K, S + 1) in rad.

    A phase is a marker if it is in the same segment between events in all realisations. Otherwise the phase is omitted
    in all realisations, so that all have the same sequence of markers. If no event ends the last segment, the segment
    ends at the phase `reached` in rad, which all realisations reach.
    """
    step = TURN / PER_TURN
    ends = edges.copy()
    ending = bool(np.isfinite(reached) and ends[:, -2].max() < reached - NEAR * step)
    if ending:
        ends[:, -1] = reached + step / 2
    phases = []
    for begin, end in zip(ends[:, :-1].T, ends[:, 1:].T, strict=True):
        first, last = np.ceil(begin.max() / step + NEAR), np.floor(end.min() / step - NEAR)
        phases.append(step * np.arange(first, last + 1))
    passed = np.floor(ends[:, -1].min() / step) - np.ceil(ends[:, 0].max() / step) + 1
    return Merged(tuple(phases), max(int(passed), 0) - sum(map(len, phases)), ending)
