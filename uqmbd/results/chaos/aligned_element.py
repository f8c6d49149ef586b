"""One element of an aligned chaos: segments between landmarks, and samples of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from uqmbd.compiled import segment_table, segment_values
from uqmbd.typing import Array

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox

__all__ = ["AlignedElement", "Landmarks", "SampledElement"]


Landmarks = Literal["events", "phase", "time"]


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

    @cached_property
    def table(self) -> Array:
        """The coefficients as they are evaluated, shape (S, O, P, M)."""
        return segment_table(self.segments)


@dataclass(frozen=True)
class SampledElement:
    """Samples in one element: their numbers (K,), basis (K, P), and edges (K, S + 1)."""

    element: AlignedElement
    rows: NDArray[np.intp]
    basis: Array
    edges: Array

    def values(self, outputs: slice, times: Array) -> Array:
        """Evaluate some outputs at increasing times (T,), shape (K, C, T); NaN behind the last edge of a sample."""
        return segment_values(self.element.table[:, outputs], self.edges, self.basis, times)
