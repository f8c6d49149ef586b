"""Realisations divided at events, and between events at equal phases of an angle that grows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

import uqmbd
from uqmbd.extend import AlignedElement, Markers
from uqmbd.results import Status
from uqmbd.typing import Array, Mask
from uqmbd_collocation.alignment.chebyshev import coefficients, read, resolved
from uqmbd_collocation.alignment.event_trajectories import POINTS as FIRST
from uqmbd_collocation.alignment.event_trajectories import EventTrajectories
from uqmbd_collocation.alignment.impossible import Impossible
from uqmbd_collocation.alignment.markers import PER_TURN, TURN, MarkedRealisations, MarkerRule, everywhere
from uqmbd_collocation.alignment.merging import Merged, merged

__all__ = ["CombinedTrajectories"]


POINTS = 33
"""Number of Chebyshev points of a segment: a quarter of a turn, or longer if phases are omitted."""

MOST_POINTS = 1 + 64 * 2**5
"""Largest number of Chebyshev points between two events."""

LONGEST = 8.0
"""Largest ratio of integration time to output time for realisations whose last segment has no event at its end."""

BISECTIONS = 54
"""Number of bisections; it suffices to find the time of a phase up to rounding errors."""


@dataclass(frozen=True, eq=False)
class _PhaseHistory:
    """History of one realisation, with the phase (S, P) at the points of its segments, rad."""

    history: uqmbd.extend.History
    phase: Array

    @property
    def edges(self) -> Array:
        """Phases (S + 1,) of the start, of events, and of the end, rad."""
        return np.append(self.phase[:, 0], self.phase[-1, -1])

    def grows(self, segments: int) -> bool:
        """Return whether the phase increases in the first segments."""
        return bool((np.diff(self.phase[:segments], axis=1) > 0).all())

    def passes(self, marks: Merged) -> bool:
        """Return whether this realisation passes the marks in the segments that `marks` states for all realisations."""
        edges = self.edges
        return all(not len(own) or (edges[k] < own[0] and own[-1] < edges[k + 1]) for k, own in enumerate(marks.phases))

    def cut(self, marks: Merged, outputs: int) -> tuple[Array, Array]:
        """Return the times (N + 1,) of the markers in s, and the outputs (N, O, points) between markers."""
        where = AlignedElement.points(POINTS)
        edges, parts = [self.history.edges[:1]], []
        for k, own in enumerate(marks.phases):
            begin, end = self.history.edges[k : k + 2]
            at = np.concatenate([[0.0], _passage_times(self.phase[k], own), [1.0]])
            at = at[:-1] if marks.ending and k + 1 == len(marks.phases) else at
            edges.append(begin + (end - begin) * at[1:])
            moments = at[:-1, None] + where * np.diff(at)[:, None]
            parts.append(read(self.history.response[k, :outputs], moments).transpose(1, 0, 2))
        return np.concatenate(edges), np.concatenate(parts)


@dataclass
class CombinedTrajectories:
    """Realisations from marker to marker, with both events and phases as markers.

    Realisations from event to event are divided further at phases. A realisation is integrated again if its points do
    not resolve the motion. It is also integrated again, for longer, if no event ends its last segment and others reach
    a later phase in it.
    """

    problem: uqmbd.extend.Problem
    events: EventTrajectories
    clock: uqmbd.extend.Clock  # an angle
    spent: int = 0  # number of realisations that were integrated again
    counters: Counter[str] = field(default_factory=Counter)
    _fine: int = FIRST
    _longer: float = 1.0
    _known: dict[bytes, uqmbd.extend.History] = field(default_factory=dict)
    _marks: dict[bytes, Merged] = field(default_factory=dict)

    points: ClassVar[int] = POINTS
    failures: ClassVar[int] = 0
    """Number of failures; it is 0, because a failed realisation stops the method."""
    what: ClassVar[str] = "events"
    landmarks: ClassVar[str] = "times of events and of equal phase"

    @classmethod
    def of(
        cls, problem: uqmbd.extend.Problem, events: EventTrajectories | None, clock: uqmbd.extend.Clock | None
    ) -> CombinedTrajectories:
        """Return the combination of the trajectories of events and phases; raise an error if a part is missing."""
        if events is None or clock is None:
            raise Impossible(
                problem.label,
                "the combination of events and phases needs both events and a clock",
                "Use only one of the two families.",
            )
        if not clock.turn:
            why = f"the clock, {clock.words}, is not a growing angle, and events reset its phase"
            raise Impossible(problem.label, why, "Use only one of the two families.")
        return cls(problem, events, clock)

    @property
    def least(self) -> int:
        """Smallest number of segments between events."""
        return self.events.least

    @property
    def longer(self) -> float:
        """Ratio of the end of last segments without an event to the range of output times."""
        return self.events.longer

    def prepare(self, values: Array) -> None:
        """Raise `Impossible` unless the clock grows in all realisations at inputs (K, d)."""
        standing = sum(not motion.grows(len(motion.phase)) for motion in self._motions(values))
        if standing:
            why = f"the clock, {self.clock.words}, stops or reverses in {standing} of {len(values)} realisations"
            raise Impossible(self.problem.label, why, "Use only events or only phases.")

    def elsewhere(self, sequence: tuple[str, ...], seen: Array) -> Mask:
        """Return False for all realisations (K,): outputs `seen` (K, output, T) do not show the sequence of events."""
        return self.events.elsewhere(sequence, seen)

    def attributes(self, sequences: Iterable[tuple[str, ...]]) -> dict[str, Any]:
        """Return additional attributes of the alignment for the results."""
        return {
            "clock": self.clock.name,
            "clock_kind": "angle",
            "phases_between_events": sum(marks.kept for marks in self._marks.values()),
            "phases_dropped": sum(marks.dropped for marks in self._marks.values()),
        }

    def sequences(self, values: Array) -> list[tuple[str, ...]]:
        """Return the events of realisations at inputs (K, d); phases between events are the same in all."""
        return self.events.sequences(values)

    def cutting(
        self, space: uqmbd.extend.GermSpace, germs: Array, spread: Array, sequence: tuple[str, ...]
    ) -> MarkerRule:
        """Return the rule that divides realisations of an element; see `marks`."""
        return self._rule(sequence, self.marks(space, germs, spread, sequence))

    def marks(self, space: uqmbd.extend.GermSpace, germs: Array, spread: Array, sequence: tuple[str, ...]) -> Merged:
        """Return the markers of an element with nodes `germs` (K, d) and a sequence of events.

        A polynomial of order 2 through the nodes gives the phases of events at the points `spread` (N, d), at which the
        chaos is evaluated. At these points, events and marks have the same sequence as at the nodes.
        """
        values, count = space.to_inputs(germs), len(sequence)
        same = np.array([other == sequence for other in self.sequences(values)])
        motions = [motion for motion, own in zip(self._motions(values), same, strict=True) if own]
        edges = everywhere(space, germs[same], spread, np.stack([motion.edges[: count + 1] for motion in motions]))
        reached = np.inf
        if all(motion.history.final and len(motion.history.labels) == count for motion in motions):
            # add one mark after the largest phase at the last output time
            end = float(self.problem.times[-1])
            last = np.array([[_phase_at(motion, count - 1, end)] for motion in motions])
            step = TURN / PER_TURN
            reached = step * (np.ceil(float(everywhere(space, germs[same], spread, last).max()) / step) + 1)
            if not self._extend_to(values[same], count, reached):
                reached = np.inf
        found = merged(edges, reached)
        self._marks[germs.tobytes() + values.tobytes()] = found
        return found

    def _rule(self, sequence: tuple[str, ...], marks: Merged) -> MarkerRule:
        labels = marks.labels(sequence)

        def farther(late: float, pace: float) -> MarkerRule:
            return self._rule(sequence, marks.farther(late, pace))

        kind: Markers = "events" if any(labels) else "phase"
        return MarkerRule(
            lambda values: self.cut(values, sequence, marks), labels, kind, farther if marks.ending else None
        )

    def cut(
        self, values: Array, sequence: tuple[str, ...], marks: Merged
    ) -> tuple[MarkedRealisations, uqmbd.extend.Realisations]:
        """Return realisations in segments; a realisation with another order of markers counts as failed."""
        if marks.ending:
            self._extend_to(values, len(sequence), float(marks.phases[-1][-1]))
        count, outputs = len(marks.labels(sequence)), self.problem.labels.shape[0]
        edges = np.full((len(values), count + 1), np.nan)
        response = np.full((len(values), count, outputs, POINTS), np.nan)
        messages = [""] * len(values)
        for k, motion in enumerate(self._motions(values, self._longer if marks.ending else 1.0)):
            if motion.history.labels[: len(sequence)] != sequence:
                messages[k] = "the sequence of its events differs from the sequence of the element"
            elif not (motion.grows(len(sequence)) and motion.passes(marks)):
                messages[k] = "the sequence of its events and phases differs from the sequence of the element"
            else:
                edges[k], response[k] = motion.cut(marks, outputs)
        status = np.array([int(Status.INTEGRATION_FAILED if text else Status.OK) for text in messages])
        nothing = np.zeros((len(values), 0, 0))
        return MarkedRealisations(edges, response), uqmbd.extend.Realisations(
            values, nothing, status, tuple(messages), {}, 0.0
        )

    def _extend_to(self, values: Array, count: int, phase: float) -> bool:
        """Integrate realisations to a phase if no event ends their last segment; return whether all reach it."""
        while True:
            motions = [
                m for m in self._motions(values, self._longer) if m.history.final and len(m.history.labels) == count
            ]
            lacking = [phase - m.edges[-1] for m in motions if m.edges[-1] <= phase]
            if not lacking or self._longer >= LONGEST:
                return not lacking
            self._longer = min(1.5 * self._longer, LONGEST)

    def _motions(self, values: Array, longer: float = 1.0) -> list[_PhaseHistory]:
        """Return realisations at inputs (K, d) with enough points to resolve their motion."""
        while True:
            found = self._histories(values, longer)
            if self._fine >= MOST_POINTS or all(map(resolved, found)):
                break
            self._fine = 2 * self._fine - 1
        rate = TURN / self.clock.turn
        return [_PhaseHistory(history, rate * history.response[:, self.clock.row]) for history in found]

    def _histories(self, values: Array, longer: float) -> list[uqmbd.extend.History]:
        known = self.events.histories(values)
        longer = max(longer, self.longer)
        if self._fine == FIRST and longer == self.longer:
            return known
        about = f"{self._fine} {longer!r} {self.least} ".encode()
        keys = [about + row.tobytes() for row in np.ascontiguousarray(values, dtype=float)]
        missing = {key: k for k, key in enumerate(keys) if key not in self._known}
        if missing:
            rows = list(missing.values())
            found = self.problem.watching().histories(values[rows], self._fine, self.least, longer)
            self.spent += len(rows)
            for key, history in zip(missing, found, strict=True):
                if history.message:
                    raise uqmbd.IntegrationError(f"{self.problem.label}: a realisation failed: {history.message}")
                self._known[key] = history
        return [self._known[key] for key in keys]


def _phase_at(motion: _PhaseHistory, segment: int, time: float) -> float:
    """Return the phase at a time of a segment, rad."""
    begin, end = motion.history.edges[segment : segment + 2]
    where = np.array((time - begin) / (end - begin) if end > begin else 0.0)
    return float(read(motion.phase[segment : segment + 1], where)[0])


def _passage_times(phase: Array, marks: Array) -> Array:
    """Return the normalised times at which a growing phase (P,) equals marks (N,)."""
    where = AlignedElement.points(len(phase))
    right = np.clip(np.searchsorted(phase, marks), 1, len(phase) - 1)
    low, high, own = where[right - 1], where[right], coefficients(phase)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        below = np.polynomial.chebyshev.chebval(2 * middle - 1, own) < marks
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray((low + high) / 2, dtype=float)
