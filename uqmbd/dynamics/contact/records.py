"""Records of events of realisations, and their times."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uqmbd.compiled import Encounters, Happening
from uqmbd.dynamics.equations import Model
from uqmbd.mechanism import event_name
from uqmbd.typing import Array, Index

__all__ = ["Records", "named_times"]


CHANGES = {Happening.STICK: "stick", Happening.SLIP: "slip", Happening.REST: "rest", Happening.LIFT_OFF: "lift-off"}
"""Labels of changes of contacts."""


class Records:
    """Events of M realisations."""

    def __init__(self, model: Model, encounters: Encounters) -> None:
        self.model, self.encounters = model, encounters
        labels = [*(label for _, label, _ in model.events), *CHANGES.values()]
        self.labels = list(dict.fromkeys(labels))
        own = [self.labels.index(label) for _, label, _ in model.events]
        # (happening, event): number of the label
        changes = [[self.labels.index(label)] * len(own) for label in CHANGES.values()]
        self._label = np.array([own, *changes], dtype=np.int64).reshape(1 + len(CHANGES), len(own))
        self._parts: list[tuple[Index, Array, Index, Index]] = []

    def add(self, member: int, time: float, event: int, label: str) -> None:
        """Record one event of a contact."""
        where = np.array([member]), np.array([time]), np.array([event]), np.array([self.labels.index(label)])
        self._parts.append(where)
        self.encounters.total[member] += 1

    def __len__(self) -> int:
        """Return the number of events of all realisations."""
        return sum(len(members) for members, *_ in self._parts)

    def take(self) -> None:
        """Take the events that the driver has recorded."""
        e = self.encounters
        rows = np.flatnonzero(e.noted)
        if not len(rows):
            return
        used = np.arange(e.room) < e.noted[rows, None]
        members = np.broadcast_to(rows[:, None], used.shape)[used]
        events = e.mark[rows][used]
        self._parts.append((members, e.mark_times[rows][used], events, self._label[e.mark_labels[rows][used], events]))
        e.noted[rows] = 0

    def sorted(self) -> tuple[Index, Array, Index, Index]:
        """Return members, times, events, labels, sorted by member and time; ties keep the recorded order."""
        if not self._parts:
            none = np.zeros(0, dtype=np.int64)
            return none, np.zeros(0), none, none
        members, times, events, labels = (np.concatenate(x) for x in zip(*self._parts, strict=True))
        order = np.lexsort((np.arange(len(times)), times, members))
        return members[order], times[order], events[order], labels[order]

    def of(self, member: int) -> list[tuple[float, int, str]]:
        """Return the time in s, the event and the label of all events of one realisation."""
        members, times, events, labels = self.sorted()
        mine = members == member
        return [
            (t, k, self.labels[label])
            for t, k, label in zip(times[mine].tolist(), events[mine].tolist(), labels[mine].tolist(), strict=True)
        ]

    def times(self, owners: Index, count: int) -> dict[str, Array]:
        """Return event times by name for `count` realisations; `owners` (M,) are numbers of recorded realisations."""
        members, times, events, labels = self.sorted()
        components = list(dict.fromkeys(component for component, *_ in self.model.events))
        component = np.array([components.index(name) for name, *_ in self.model.events], dtype=np.int64)
        kinds = component[events] * len(self.labels) + labels
        names = [(name, label) for name in components for label in self.labels]
        return named_times(owners[members], times, kinds, names, count)


def named_times(
    members: Index, times: Array, kinds: Index, names: Sequence[tuple[str, str]], count: int
) -> dict[str, Array]:
    """Return the times (count,) of events in s, by name; NaN for realisations without the event.

    The arrays (N,) contain realisation, time and kind of each event, in the order of time within a realisation;
    `names` are the component and label of each kind.
    """
    found: dict[str, Array] = {}
    if not len(times):
        return found
    order = np.lexsort((np.arange(len(times)), members, kinds))
    members, times, kinds = members[order], times[order], kinds[order]
    new = np.ones(len(times), dtype=bool)
    new[1:] = (members[1:] != members[:-1]) | (kinds[1:] != kinds[:-1])
    starts = np.flatnonzero(new)
    number = np.arange(len(times)) - np.repeat(starts, np.diff([*starts, len(times)])) + 1
    order = np.lexsort((members, number, kinds))
    members, times, kinds, number = members[order], times[order], kinds[order], number[order]
    edges = np.flatnonzero((np.diff(kinds, prepend=-1) != 0) | (np.diff(number, prepend=-1) != 0)).tolist()
    for first, last in zip(edges, [*edges[1:], len(times)], strict=True):
        component, label = names[kinds[first]]
        name = event_name(component, label, int(number[first]))
        found[name] = np.full(count, np.nan)
        found[name][members[first:last]] = times[first:last]
    return found
