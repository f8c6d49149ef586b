"""One element of an aligned chaos: segments between landmarks, and samples of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from uqmbd.compiled import SegmentTable
from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox

__all__ = ["AlignedElement", "Landmarks", "SampledElement"]


NOISE = 1e-10
"""Size of a coefficient in time, over the largest one of its output, that is rounding."""

Landmarks = Literal["events", "phase", "time"]
"""What the motions of an element are compared at: their events, equal phases of a clock, or equal times."""


@dataclass(frozen=True, eq=False)
class AlignedElement:
    """Where all realisations have the same sequence of landmarks.

    Attributes
    ----------
    box : GermBox
        Part of the germ space.
    events : tuple of str, length S
        What ends each segment; empty: no event.
    edges : array, shape (P, S + 1)
        Coefficients of the times at which segments begin and end, s.
    segments : array, shape (P, S, O, N)
        Coefficients of the outputs in Chebyshev polynomials of each segment's normalised time.
    landmarks : {"events", "phase", "time"}
        Where segments end: at events, at equal phases of a clock, or at equal times.
    """

    box: GermBox
    events: tuple[str, ...]
    edges: Array
    segments: Array
    landmarks: Landmarks = "events"

    @staticmethod
    def points(count: int) -> Array:
        """Return Chebyshev points of the second kind in a segment's normalised time, from 0 to 1, shape (count,)."""
        found: Array = (1 - np.cos(np.pi * np.arange(count) / (count - 1))) / 2
        return found

    @classmethod
    def through(
        cls, box: GermBox, events: tuple[str, ...], edges: Array, values: Array, landmarks: Landmarks
    ) -> AlignedElement:
        """Make it from coefficients (P, S, O, N) of the outputs at the `points` of each segment.

        Powers of the normalised time whose coefficients are rounding are left out.
        """
        count = values.shape[-1]
        vander = np.polynomial.chebyshev.chebvander(2 * cls.points(count) - 1, count - 1)
        found = values @ np.linalg.inv(vander).T
        size = np.abs(found).max(axis=(0, 1, 3), keepdims=True)
        large = np.flatnonzero((np.abs(found) > NOISE * size).any(axis=(0, 1, 2)))
        return cls(box, events, edges, found[..., : int(large[-1]) + 1 if len(large) else 1], landmarks)

    @cached_property
    def table(self) -> SegmentTable:
        """The coefficients as they are evaluated."""
        return SegmentTable.of(self.edges, self.segments)


@dataclass(frozen=True)
class SampledElement:
    """Samples in one element: their numbers (K,), in any order, and basis (K, P)."""

    element: AlignedElement
    rows: Index
    basis: Array

    @property
    def edges(self) -> Array:
        """Times of landmarks, with begin and end (K, S + 1), s."""
        return self.element.table.edges_at(self.basis)

    def evaluate(self, outputs: slice, times: Array, found: Array) -> None:
        """Evaluate some outputs at increasing times (T,), into rows of (N, C, T); NaN behind a sample's last edge."""
        self.element.table.evaluate(self.basis, times, outputs, found, self.rows)
