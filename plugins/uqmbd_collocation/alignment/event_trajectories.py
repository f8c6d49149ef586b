"""Realisations integrated from event to event."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import takewhile
from typing import Any, ClassVar

import numpy as np

import uqmbd
from uqmbd.results import Status
from uqmbd.typing import Array, Mask
from uqmbd_collocation.alignment.chebyshev import read_at_times, resolved
from uqmbd_collocation.alignment.impossible import Impossible
from uqmbd_collocation.alignment.markers import MarkedRealisations, MarkerRule

__all__ = ["EventTrajectories"]


POINTS = 65
"""Number of Chebyshev points of a segment."""

MOST_SEGMENTS = 64
"""Largest number of segments of a realisation; a limit is necessary because decaying bounces have no end."""

LONGEST = 8.0
"""Largest value of `EventTrajectories.longer`, the end of last segments relative to the range of output times."""

SLACK = 1e-9
"""Rounding tolerance for the end of a last segment, relative to the range of output times."""

MARGIN = 0.1
"""Time from the latest event of all realisations to the end of their last segments, relative to the range of output
times; it applies if last segments end after the last output time."""


@dataclass
class EventTrajectories:
    """Realisations from event to event, each computed once.

    No event ends the last segment. The last segments of all realisations end at one time, after the latest event of all
    realisations: `longer` times the range of the output times. If only realisations with a later event ended later, the
    end of the segment would not be a smooth function of the inputs.
    """

    problem: uqmbd.extend.Problem
    least: int = 1  # smallest number of segments of each realisation
    longer: float = 1.0
    spent: int = 0  # number of realisations so far
    counters: Counter[str] = field(default_factory=Counter)
    _known: dict[bytes, uqmbd.extend.History] = field(default_factory=dict)
    _verified: dict[bytes, uqmbd.extend.History] = field(default_factory=dict)

    points: ClassVar[int] = POINTS
    failures: ClassVar[int] = 0
    """Number of failures; it is 0, because a failed realisation stops the method."""
    what: ClassVar[str] = "events"
    landmarks: ClassVar[str] = "event times"

    def __post_init__(self) -> None:
        """Raise `Impossible` for a mechanism without events."""
        if not self.problem.model.events:
            raise Impossible(
                self.problem.label,
                "alignment='events' needs a mechanism with events, such as the impacts of uqmbd_contact, but the "
                f"mechanism {self.problem.mechanism!r} has none",
                "Use alignment=None.",
            )

    def elsewhere(self, sequence: tuple[str, ...], seen: Array) -> Mask:
        """Return False for all realisations (K,): outputs `seen` (K, output, T) do not show the sequence of events."""
        return np.zeros(len(seen), dtype=bool)

    def attributes(self, sequences: Iterable[tuple[str, ...]]) -> dict[str, Any]:
        """Return additional attributes of the alignment for the results."""
        return {}

    def prepare(self, values: Array) -> None:
        """Do nothing: realisations at inputs (K, d) need no preparation."""

    def sequences(self, values: Array) -> list[tuple[str, ...]]:
        """Return the events that end the segments of realisations at inputs (K, d).

        All realisations have the number of segments that the longest sequence needs until the last output time. The
        only exceptions are realisations without further events, which have fewer segments. Raise IntegrationError if a
        realisation fails.
        """
        return [history.labels[: self.least] for history in self.histories(values)]

    def cutting(
        self, space: uqmbd.extend.GermSpace, germs: Array, spread: Array, sequence: tuple[str, ...]
    ) -> MarkerRule:
        """Return the rule that divides realisations of an element into segments."""
        return self._rule(space.to_inputs(germs), sequence)

    def _rule(self, values: Array, sequence: tuple[str, ...]) -> MarkerRule:
        """Return the rule that divides realisations; nodes at inputs (K, d) supply further events for its extension."""

        def farther(late: float, pace: float) -> MarkerRule | None:
            more = min(int(np.ceil(late / max(pace, 1e-300))) + 1, len(sequence), MOST_SEGMENTS - len(sequence))
            try:
                known = [h.labels for h in self.histories(values, len(sequence) + more)] if more > 0 else []
            except uqmbd.IntegrationError:  # failure after the last output time: no extension
                return None
            same = {labels[: len(sequence) + more] for labels in known if labels[: len(sequence)] == sequence}
            # extend only by events that are the same in all nodes
            common = tuple(each[0] for each in takewhile(lambda each: len(set(each)) == 1, zip(*same, strict=False)))
            return self._rule(values, common) if len(common) > len(sequence) else None

        return MarkerRule(lambda values: self.cut(values, sequence), sequence, "events", farther)

    def cut(self, values: Array, sequence: tuple[str, ...]) -> tuple[MarkedRealisations, uqmbd.extend.Realisations]:
        """Return realisations at inputs (K, d), divided into segments.

        A realisation with another sequence of events counts as failed, because it does not belong to the element.
        """
        histories = self.histories(values, len(sequence))
        same = np.array([h.labels[: len(sequence)] == sequence for h in histories])
        count, outputs = len(sequence), self.problem.labels.shape[0]
        edges = np.full((len(values), count + 1), np.nan)
        response = np.full((len(values), count, outputs, POINTS), np.nan)
        for k in np.flatnonzero(same):
            edges[k], response[k] = histories[k].edges[: count + 1], histories[k].response[:count, :outputs]
        realised = uqmbd.extend.Realisations(
            values,
            response.reshape(len(values), outputs, -1),
            np.where(same, int(Status.OK), int(Status.INTEGRATION_FAILED)),
            tuple("" if ok else "the sequence of its events differs from the sequence of the element" for ok in same),
            {},
            0.0,
        )
        return MarkedRealisations(edges, response), realised

    def histories(self, values: Array, count: int = 1) -> list[uqmbd.extend.History]:
        """Integrate realisations at inputs (K, d) from event to event; see `sequences`.

        Responses contain the outputs, then the observed quantities. Each realisation has at least `count` segments,
        unless no further event follows.
        """
        keys = [row.tobytes() for row in np.ascontiguousarray(values, dtype=float)]
        while True:
            missing = [k for k, key in enumerate(keys) if not self._is_long_enough(self._known.get(key), count)]
            if missing:
                self.problem.progress.start(self.problem.label, len(missing))
                about = POINTS, max(self.least, count), self.longer
                found = self.problem.watching().histories(values[missing], *about)
                self.spent += len(missing)
                for k, history in zip(missing, found, strict=True):
                    if history.message:
                        raise uqmbd.IntegrationError(f"{self.problem.label}: a realisation failed: {history.message}")
                    self._known[keys[k]] = history
                    self.problem.progress.advance(self.problem.label, 1)
            wanted = 1 + max((h.inside for h in self._known.values()), default=1)
            if wanted > MOST_SEGMENTS:
                raise uqmbd.StudyError(
                    f"{self.problem.label}: a realisation has {wanted - 1} segments between events up to the last "
                    f"output time, more than {MOST_SEGMENTS}, as in a sequence of decaying bounces. Use an earlier "
                    "last output time, or elements."
                )
            last = max((h.edges[-2] for h in self._known.values() if h.final), default=-np.inf)
            short = last >= self._end and self.longer < LONGEST
            if wanted <= self.least and not missing and not short:
                break
            self.least = max(wanted, self.least)
            if short:
                begin, end = self.problem.times[[0, -1]]
                self.longer = min(float((last - begin) / (end - begin)) + MARGIN, LONGEST)
        return [self._known[key] for key in keys]

    def event_times(self, values: Array, sequence: tuple[str, ...]) -> Array:
        """Return the times (K, S) in s at which segments end in verification realisations at inputs (K, d).

        If another event ends a segment, this time and all later times are NaN. A failed realisation has only NaN.
        These realisations do not change the number or the end of segments at the nodes.
        """
        keys = [row.tobytes() for row in np.ascontiguousarray(values, dtype=float)]
        missing = [
            k
            for k, key in enumerate(keys)
            if self._too_short(self._verified.get(key) or self._known.get(key), len(sequence))
        ]
        if missing:
            self.problem.progress.start(self.problem.label, len(missing))
            known = self.problem.watching().histories(values[missing], 2, len(sequence), self.longer)
            self.problem.progress.advance(self.problem.label, len(missing))
            self.spent += len(missing)
            self._verified.update((keys[k], history) for k, history in zip(missing, known, strict=True))
        found = np.full((len(keys), len(sequence)), np.nan)
        for row, key in zip(found, keys, strict=True):
            history = self._verified.get(key) or self._known[key]
            pairs = list(zip(history.labels, sequence, strict=False))
            count = next((k for k, (own, other) in enumerate(pairs) if own != other), len(pairs))
            row[:count] = history.edges[1 : count + 1]
        return found

    def at_times(self, values: Array, times: Array) -> Array:
        """Return observed quantities (K, O, T) at inputs (K, d); NaN for missing or unresolved realisations."""
        found = np.full((len(values), len(self.problem.watching().labels.outputs), len(times)), np.nan)
        for k, row in enumerate(np.ascontiguousarray(values, dtype=float)):
            history = self._known.get(row.tobytes())
            if history is not None and resolved(history):
                found[k] = read_at_times(history, times)
        return found

    @property
    def _end(self) -> float:
        """Time at which a last segment ends if no event ends it, s."""
        begin, end = self.problem.times[[0, -1]]
        return float(begin + self.longer * (end - begin)) if self.longer > 1 else float(end)

    @staticmethod
    def _too_short(history: uqmbd.extend.History | None, count: int) -> bool:
        """Return whether a motion must be integrated further to have enough segments."""
        return history is None or (not history.final and len(history.labels) < count)

    def _is_long_enough(self, history: uqmbd.extend.History | None, count: int) -> bool:
        if history is None:
            return False
        if not history.final:
            return len(history.labels) >= max(self.least, count)
        return bool(history.edges[-1] >= self._end - SLACK * np.ptp(self.problem.times))
