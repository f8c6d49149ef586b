"""Realisations that are followed from event to event."""

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
from uqmbd_collocation.alignment.impossible import Impossible
from uqmbd_collocation.alignment.markers import MarkedRealisations, MarkerRule

__all__ = ["EventTrajectories"]


POINTS = 65
"""Chebyshev points of a segment."""

MOST_SEGMENTS = 64
"""Segments of a realisation beyond which a motion is not followed: bounces that die down have no end."""

LONGEST = 8.0
"""Longest last segment of a motion, over the output times."""

SLACK = 1e-9
"""Part of the output times by which a last segment may miss its end: rounding."""

MARGIN = 0.1
"""Part of the output times by which last segments, which no event ends, go on behind the last event of all."""


@dataclass
class EventTrajectories:
    """Realisations from event to event, each computed once.

    Last segments, which no event ends, last until `longer` times the range of the output times. In all realisations
    they end at the same time after the last event of all. Otherwise their end would not be a smooth function of the
    inputs: the last output time where the last event is before it, and a separate time where it is not.
    """

    problem: uqmbd.extend.Problem
    least: int = 1  # segments of each realisation
    longer: float = 1.0
    spent: int = 0  # realisations so far
    counters: Counter[str] = field(default_factory=Counter)
    _known: dict[bytes, uqmbd.extend.History] = field(default_factory=dict)
    _verified: dict[bytes, uqmbd.extend.History] = field(default_factory=dict)

    points: ClassVar[int] = POINTS
    failures: ClassVar[int] = 0
    """A realisation that fails ends the method."""
    what: ClassVar[str] = "events"
    landmarks: ClassVar[str] = "event times"

    def __post_init__(self) -> None:
        """Refuse a mechanism without events."""
        if not self.problem.model.events:
            raise Impossible(
                self.problem.label,
                "alignment='events' needs a mechanism with events, as the impacts of uqmbd_contact; mechanism "
                f"{self.problem.mechanism!r} has none",
                "Leave alignment out.",
            )

    def elsewhere(self, sequence: tuple[str, ...], seen: Array) -> Mask:
        """Return realisations (K, output, T) whose outputs alone show another sequence: none."""
        return np.zeros(len(seen), dtype=bool)

    def attributes(self, sequences: Iterable[tuple[str, ...]]) -> dict[str, Any]:
        """Return further attributes of the alignment for the results."""
        return {}

    def prepare(self, values: Array) -> None:
        """Prepare realisations at inputs (K, d): nothing is needed."""

    def sequences(self, values: Array) -> list[tuple[str, ...]]:
        """Return the events that end the segments of realisations at inputs (K, d).

        Each has as many segments as any has until the last time. Raise IntegrationError if a realisation fails.
        """
        return [history.labels[: self.least] for history in self.histories(values)]

    def cutting(
        self, space: uqmbd.extend.GermSpace, germs: Array, spread: Array, sequence: tuple[str, ...]
    ) -> MarkerRule:
        """Return how realisations of an element are cut."""
        return self._cutting(space.to_inputs(germs), sequence)

    def _cutting(self, values: Array, sequence: tuple[str, ...]) -> MarkerRule:
        """Return how realisations are cut, and how to cut them behind more events: those of nodes at inputs (K, d)."""

        def farther(late: float, pace: float) -> MarkerRule | None:
            more = min(int(np.ceil(late / max(pace, 1e-300))) + 1, len(sequence), MOST_SEGMENTS - len(sequence))
            try:
                known = [h.labels for h in self.histories(values, len(sequence) + more)] if more > 0 else []
            except uqmbd.IntegrationError:  # behind the last output time
                return None
            same = {labels[: len(sequence) + more] for labels in known if labels[: len(sequence)] == sequence}
            # as far as the same events follow in all nodes
            common = tuple(each[0] for each in takewhile(lambda each: len(set(each)) == 1, zip(*same, strict=False)))
            return self._cutting(values, common) if len(common) > len(sequence) else None

        return MarkerRule(lambda values: self.cut(values, sequence), sequence, "events", farther)

    def cut(self, values: Array, sequence: tuple[str, ...]) -> tuple[MarkedRealisations, uqmbd.extend.Realisations]:
        """Return realisations in segments; those with another sequence do not belong to this element."""
        histories = self.histories(values, len(sequence))
        same = np.array([h.labels[: len(sequence)] == sequence for h in histories])
        count, outputs = len(sequence), self.problem.labels.shape[0]
        edges = np.full((len(values), count + 1), np.nan)
        response = np.full((len(values), count, outputs, POINTS), np.nan)
        for k in np.flatnonzero(same):
            edges[k], response[k] = histories[k].edges[: count + 1], histories[k].response[:count, :outputs]
        told = uqmbd.extend.Realisations(
            values,
            response.reshape(len(values), outputs, -1),
            np.where(same, int(Status.OK), int(Status.INTEGRATION_FAILED)),
            tuple("" if ok else "its events come in another order" for ok in same),
            {},
            0.0,
        )
        return MarkedRealisations(edges, response), told

    def histories(self, values: Array, count: int = 1) -> list[uqmbd.extend.History]:
        """Follow realisations at inputs (K, d), with the observed quantities behind the outputs; see `sequences`.

        Each has at least a number of segments, unless no event follows.
        """
        keys = [row.tobytes() for row in np.ascontiguousarray(values, dtype=float)]
        while True:
            missing = [k for k, key in enumerate(keys) if not self._enough(self._known.get(key), count)]
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
                    f"{self.problem.label}: a realisation has {wanted - 1} segments between events until the last "
                    f"output time, more than {MOST_SEGMENTS}: bounces die down. End before that, or use elements."
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
        """Return times (K, S) at which segments end in verification realisations at inputs (K, d), s.

        NaN where another event ends one, or the realisation fails. They change nothing that is known of nodes.
        """
        keys = [row.tobytes() for row in np.ascontiguousarray(values, dtype=float)]
        missing = [k for k, key in enumerate(keys) if key not in self._verified and key not in self._known]
        if missing:
            known = self.problem.watching().histories(values[missing], 2, len(sequence), self.longer)
            self.spent += len(missing)
            self._verified.update((keys[k], history) for k, history in zip(missing, known, strict=True))
        found = np.full((len(keys), len(sequence)), np.nan)
        for row, key in zip(found, keys, strict=True):
            history = self._verified.get(key) or self._known[key]
            pairs = list(zip(history.labels, sequence, strict=False))
            count = next((k for k, (own, other) in enumerate(pairs) if own != other), len(pairs))
            row[:count] = history.edges[1 : count + 1]
        return found

    @property
    def _end(self) -> float:
        """Moment at which last segments end that no event ends, s."""
        begin, end = self.problem.times[[0, -1]]
        return float(begin + self.longer * (end - begin)) if self.longer > 1 else float(end)

    def _enough(self, history: uqmbd.extend.History | None, count: int) -> bool:
        if history is None:
            return False
        if not history.final:
            return len(history.labels) >= max(self.least, count)
        return bool(history.edges[-1] >= self._end - SLACK * np.ptp(self.problem.times))
