"""Realisations that are followed from event to event."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

import uqmbd
from uqmbd.results import Status
from uqmbd.typing import Array, Mask
from uqmbd_collocation.alignment.impossible import Impossible
from uqmbd_collocation.alignment.landmarks import Cutting, Landmarked

__all__ = ["EventPaths"]


POINTS = 65
"""Chebyshev points of a segment."""

MOST_SEGMENTS = 60
"""Segments of a realisation beyond which a motion is not followed: bounces that die down have no end."""


@dataclass
class EventPaths:
    """Realisations from event to event, each once.

    Attributes
    ----------
    problem : uqmbd.Problem
        That of the study.
    least : int
        Segments that each has.
    spent : int
        Realisations so far.
    """

    problem: uqmbd.Problem
    least: int = 1
    spent: int = 0
    counters: Counter[str] = field(default_factory=Counter)
    _known: dict[bytes, uqmbd.History] = field(default_factory=dict)

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
        """Say of which realisations (K, output, T) the outputs alone show that they have another sequence: of none."""
        return np.zeros(len(seen), dtype=bool)

    def attributes(self, sequences: Iterable[tuple[str, ...]]) -> dict[str, Any]:
        """Return what the results say of the alignment besides."""
        return {}

    def prepare(self, values: Array) -> None:
        """Find what is needed besides at inputs (K, d): nothing."""

    def sequences(self, values: Array) -> list[tuple[str, ...]]:
        """Return what ends the segments of realisations at inputs (K, d): as many as any has until the last time.

        Raises
        ------
        uqmbd.IntegrationError
            If one fails.
        """
        return [history.labels[: self.least] for history in self.histories(values)]

    def cutting(self, space: uqmbd.GermSpace, germs: Array, spread: Array, sequence: tuple[str, ...]) -> Cutting:
        """Return how realisations of an element are cut."""
        return Cutting(lambda values: self.cut(values, sequence), sequence, "events")

    def cut(self, values: Array, sequence: tuple[str, ...]) -> tuple[Landmarked, uqmbd.Realisations]:
        """Return realisations in segments; those whose sequence is another one are no part of this element."""
        histories = self.histories(values)
        same = np.array([h.labels[: len(sequence)] == sequence for h in histories])
        count, outputs = len(sequence), self.problem.labels.shape[0]
        edges = np.full((len(values), count + 1), np.nan)
        response = np.full((len(values), count, outputs, POINTS), np.nan)
        for k in np.flatnonzero(same):
            edges[k], response[k] = histories[k].edges[: count + 1], histories[k].response[:count, :outputs]
        told = uqmbd.Realisations(
            values,
            response.reshape(len(values), outputs, -1),
            np.where(same, int(Status.OK), int(Status.INTEGRATION_FAILED)),
            tuple("" if ok else "its events come in another order" for ok in same),
            {},
            0.0,
        )
        return Landmarked(edges, response), told

    def histories(self, values: Array) -> list[uqmbd.History]:
        """Follow realisations at inputs (K, d), with what is watched behind the outputs; see `sequences`."""
        keys = [row.tobytes() for row in np.ascontiguousarray(values, dtype=float)]
        while True:
            missing = [k for k, key in enumerate(keys) if not self._enough(self._known.get(key))]
            if missing:
                self.problem.progress.start(self.problem.label, len(missing))
                found = self.problem.watching().histories(values[missing], POINTS, self.least)
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
            if wanted <= self.least and not missing:
                break
            self.least = max(wanted, self.least)
        return [self._known[key] for key in keys]

    def _enough(self, history: uqmbd.History | None) -> bool:
        return history is not None and (len(history.labels) >= self.least or history.final)
