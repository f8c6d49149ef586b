"""Markers, at which realisations are compared instead of at equal times: events, and equal phases of a clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import uqmbd
from uqmbd.extend import AlignedElement, Markers
from uqmbd.typing import Array

__all__ = [
    "PER_TURN",
    "STANDING",
    "TURN",
    "Cut",
    "MarkerRule",
    "MarkedRealisations",
    "Marks",
    "everywhere",
    "marks_behind",
    "phase_markers",
    "time_markers",
]


TURN = 2 * np.pi

PER_TURN = 4
"""Number of markers of a turn."""

STANDING = 8
"""Number of output times in a segment in which the clock stands still."""


@dataclass(frozen=True, eq=False)
class Marks:
    """Markers of the realisations of an element."""

    phases: Array  # (S,) phases of the markers after the start, rad, increasing
    tail: float = 0.0  # time span after the last phase, compared at equal times, s; positive if the clock comes to rest
    parts: int = 0  # number of segments of the tail

    @property
    def count(self) -> int:
        """Number of segments."""
        return len(self.phases) + self.parts

    def farther(self, late: float, pace: float) -> Marks:
        """Return the markers of a motion that is `late` s longer, in segments of `pace` s; at most twice as many."""
        if self.parts:
            return replace(self, tail=self.tail + late)
        more = min(int(np.ceil(late / max(pace, 1e-300))) + 1, len(self.phases))
        return replace(self, phases=np.append(self.phases, self.phases[-1] + (1 + np.arange(more)) * TURN / PER_TURN))


@dataclass(frozen=True, eq=False)
class MarkedRealisations:
    """Realisations from marker to marker."""

    edges: Array  # (K, S + 1) times of the markers, s; NaN if a realisation does not reach the marker
    response: Array  # (K, S, O, N) outputs at `uqmbd.extend.AlignedElement.points` of each segment


Cut = Callable[[Array], tuple[MarkedRealisations, uqmbd.extend.Realisations]]
"""Function of inputs (K, d) that returns realisations from marker to marker, and their status."""


@dataclass(frozen=True)
class MarkerRule:
    """Rule by which realisations of an element are divided at markers."""

    cut: Cut  # function that computes realisations from marker to marker
    labels: tuple[str, ...]  # event that ends each of S segments; an empty text if none does
    landmarks: Markers
    farther: Callable[[float, float], MarkerRule | None] | None = None
    """Function of two durations in s: an additional duration of the realisations, and the mean duration of a segment.
    The function returns the rule for the longer realisations, or None if they have no further common markers."""


def phase_markers(
    found: uqmbd.extend.Dense, phases: uqmbd.extend.Phases, marks: Marks, outputs: int, points: int
) -> MarkedRealisations:
    """Divide realisations at the phases of `marks`, and after the last phase at equal steps of time.

    The times of `found` resolve the motion, and the first `outputs` rows of `found` are outputs of the study.
    """
    where = AlignedElement.points(points)
    edges = np.empty((len(phases.values), marks.count + 1))
    response = np.empty((len(edges), marks.count, outputs, points))
    behind = marks.tail * np.arange(1, marks.parts + 1) / max(marks.parts, 1)
    for k in range(len(edges)):
        passed = phases.passed(k, marks.phases)
        edges[k] = np.concatenate([found.times[:1], passed, passed[-1:] + behind])
        moments = edges[k, :-1, None] + where * np.diff(edges[k])[:, None]
        values = found.spline(k)(moments.ravel(), extrapolate=False)[:, :outputs]
        response[k] = values.reshape(marks.count, points, outputs).transpose(0, 2, 1)
    return MarkedRealisations(edges, response)


def time_markers(found: uqmbd.extend.Dense, edges: Array, outputs: int, points: int) -> MarkedRealisations:
    """Divide successful realisations at the same times (S + 1,), s; see `phase_markers`."""
    moments = edges[:-1, None] + AlignedElement.points(points) * np.diff(edges)[:, None]
    response = np.empty((len(found.values), len(edges) - 1, outputs, points))
    for k in range(len(response)):
        values = found.spline(k)(moments.ravel())[:, :outputs]
        response[k] = values.reshape(len(edges) - 1, points, outputs).transpose(0, 2, 1)
    return MarkedRealisations(np.tile(edges, (len(response), 1)), response)


def marks_behind(starts: Array, last: float) -> Array:
    """Return marker phases (S,), rad: multiples of a part of a turn, after all start phases (K,).

    They end at the first multiple at or after the phase `last`, rad.
    """
    step = TURN / PER_TURN
    first = np.floor(starts.max() / step + 0.5) + 1
    return np.asarray(np.arange(first, np.ceil(last / step) + 1) * step)


def everywhere(space: uqmbd.extend.GermSpace, germs: Array, spread: Array, known: Array) -> Array:
    """Return values `known` (K, Q) at germs (K, d), and then values at `spread` (M, d), shape (K + M, Q) together.

    The values at `spread` are those of a polynomial that is fitted to `known`. Its order is 2, or 1 if there are fewer
    than two germs for each term.
    """
    terms = uqmbd.extend.index_set(space.dimension, 2)
    terms = terms if len(germs) >= 2 * len(terms) else terms[terms.sum(axis=1) <= 1]
    fit = np.linalg.lstsq(space.evaluate(germs, terms), known, rcond=1e-10)[0]
    return np.concatenate([known, space.evaluate(spread, terms) @ fit])
