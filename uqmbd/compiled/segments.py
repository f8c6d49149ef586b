"""Evaluate samples of segment-wise expansions, between event or phase markers, at given times.

NumPy takes ten times as long, because it gathers the coefficients of the segment separately for each value.
"""

from __future__ import annotations

from ctypes import byref
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqmbd.compiled.driver import SegmentsStruct, address, aligned, load_driver
from uqmbd.typing import Array, Index

__all__ = ["SegmentTable"]


BLOCK = 4
"""Number of Chebyshev polynomials, and of times, that the driver evaluates at once."""

ROOM = 136
"""Size of the buffer of the driver, in times of a sample; it includes four additional times."""

SLACK = 1e-12
"""Allowed rounding error of the last edge, a sum of terms, relative to the largest time."""


@dataclass(frozen=True, eq=False)
class SegmentTable:
    """Coefficients in the order of their evaluation; see :meth:`of`."""

    edges: Array  # (S + 1, P): terms of the begin and end times of segments
    used: Index  # (S, C): groups of four Chebyshev polynomials of an output in a segment
    counts: Index  # (S, C, B): number of leading terms of four polynomials that are not zero
    starts: Index  # (S, C): index of the first coefficient of an output in a segment
    coefficients: Array  # one axis: four polynomials term by term; then by group of four, output and segment

    @classmethod
    def of(cls, edges: Array, segments: Array) -> SegmentTable:
        """Arrange coefficients of P terms: edges (P, S + 1) of S segments, and C outputs (P, S, C, N).

        An output has N Chebyshev polynomials of the normalised time of a segment.
        """
        terms, count, outputs, powers = segments.shape
        if edges.shape != (terms, count + 1):
            raise ValueError(f"segments {segments.shape} were given edges {edges.shape}")
        blocks = -(-powers // BLOCK)
        filled = np.zeros((count, outputs, blocks, terms, BLOCK))
        by_segment = segments.transpose(1, 2, 3, 0)
        for n in range(powers):
            filled[:, :, n // BLOCK, :, n % BLOCK] = by_segment[:, :, n]
        there = (filled != 0).any(axis=4)
        counts = np.where(there.any(axis=3), terms - there[..., ::-1].argmax(axis=3), 0)
        used = np.where(counts.any(axis=2), blocks - (counts[..., ::-1] > 0).argmax(axis=2), 0)
        sizes = BLOCK * counts.sum(axis=2)
        starts = np.cumsum(sizes).reshape(sizes.shape) - sizes
        kept = filled[np.arange(terms) < counts[..., None]]
        return cls(np.ascontiguousarray(edges.T, dtype=float), used, counts, starts, kept.ravel())

    def edges_at(self, basis: Array) -> Array:
        """Return the non-decreasing edges (K, S + 1) of samples from the values of their terms (K, P)."""
        basis = self._basis(basis)
        found = np.empty((len(basis), len(self.edges)))
        work = aligned(basis.shape[1])
        load_driver().segment_edges(byref(self._driven), len(basis), *map(address, (basis, found, work)))
        return found

    def evaluate(self, basis: Array, times: Array, outputs: slice, found: Array, rows: Index) -> None:
        """Evaluate outputs of K samples, with terms `basis` (K, P), at increasing times (T,), s.

        The values are written to rows `rows` (K,) of `found` (R, outputs, T). The values are NaN at times after the
        last edge of a sample, up to rounding; times before the first edge have the value at this edge.
        """
        basis = self._basis(basis)
        rows = np.ascontiguousarray(rows, dtype=np.int64)
        first, last, step = outputs.indices(self.used.shape[1])
        count, width = len(times), last - first
        if step != 1 or found.shape[1:] != (width, count) or not found.flags.c_contiguous or found.dtype != float:
            raise ValueError(f"outputs {outputs} at {count} times were given room {found.shape}")
        if rows.shape != (len(basis),) or len(rows) and not 0 <= rows.min() <= rows.max() < len(found):
            raise ValueError(f"{len(basis)} samples were given rows {rows.shape} of {len(found)}")
        if not found.size:
            return
        # padding, because the driver reads several times at once
        padded = np.append(times, np.full(BLOCK, times[-1])).astype(float)
        reach = padded[-1] - padded[0]
        rate = count / reach if reach > 0 else 0.0
        below = np.searchsorted(padded[:count], padded[0] + reach / count * np.arange(count + 1))
        blocks, terms, edges = self.counts.shape[2], basis.shape[1], len(self.edges)
        work = aligned((BLOCK * blocks + ROOM) * width + BLOCK**2 * blocks + terms + 2 * edges)
        load_driver().segment_values(
            *(byref(self._driven), len(basis), first, last, count, address(basis), address(rows)),
            *(address(padded), address(below), count, rate, SLACK * float(np.abs(times).max())),
            *map(address, (found, work)),
        )

    def _basis(self, basis: Array) -> Array:
        if basis.ndim != 2 or basis.shape[1] != self.edges.shape[1]:
            raise ValueError(f"a table of {self.edges.shape[1]} terms was given a basis {basis.shape}")
        return np.ascontiguousarray(basis, dtype=float)

    @cached_property
    def _driven(self) -> SegmentsStruct:
        """Return the C structure for the driver; it is valid as long as this object."""
        sizes = len(self.used), self.used.shape[1], self.edges.shape[1], self.counts.shape[2]
        arrays = self.edges, self.used, self.counts, self.starts, self.coefficients
        return SegmentsStruct(*sizes, *map(address, arrays))
