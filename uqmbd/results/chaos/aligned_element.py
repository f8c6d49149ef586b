"""One element of an event-aligned chaos: segments between events, and samples of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from uqmbd.results.statistics import divisor
from uqmbd.typing import Array

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox

__all__ = ["AlignedElement", "SampledElement", "chebyshev"]


@dataclass(frozen=True, eq=False)
class AlignedElement:
    """Where all realisations have the same sequence of events.

    Attributes
    ----------
    box : GermBox
        Part of the germ space.
    events : tuple of str, length S
        What ends each segment; empty: nothing.
    edges : array, shape (P, S + 1)
        Coefficients of the times at which segments begin and end, s.
    segments : array, shape (P, S, O, N)
        Coefficients of the outputs in Chebyshev polynomials of each segment's normalised time.
    """

    box: GermBox
    events: tuple[str, ...]
    edges: Array
    segments: Array


@dataclass(frozen=True)
class SampledElement:
    """Samples in one element: their numbers (K,), basis (K, P), and edges (K, S + 1)."""

    element: AlignedElement
    rows: NDArray[np.intp]
    basis: Array
    edges: Array

    def values(self, output: int, times: Array) -> Array:
        """One output at times (T,), shape (K, T)."""
        local = np.einsum("kp,psn->nks", self.basis, self.element.segments[:, :, output])
        count = self.edges.shape[1] - 1
        segment = np.zeros((len(self.rows), len(times)), dtype=np.intp)
        for edge in self.edges[:, 1:-1].T:
            segment += edge[:, None] <= times
        segment = np.minimum(segment, count - 1)
        begin = np.take_along_axis(self.edges, segment, axis=1)
        length = np.take_along_axis(self.edges, segment + 1, axis=1) - begin
        where = np.clip((times - begin) / divisor(length), 0.0, 1.0)
        return chebyshev([np.take_along_axis(c, segment, axis=1) for c in local], 2 * where - 1)


def chebyshev(coefficients: list[Array], x: Array) -> Array:
    """Sum of Chebyshev polynomials at x, in -1 to 1, by Clenshaw's recurrence; all shapes are alike."""
    one, two = np.zeros_like(coefficients[0]), np.zeros_like(coefficients[0])
    for c in coefficients[:0:-1]:
        one, two = c + 2 * x * one - two, one
    found: Array = coefficients[0] + x * one - two
    return found
