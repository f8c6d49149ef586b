"""Samples of what is expanded from landmark to landmark, evaluated at given times.

In NumPy the same takes ten times as long: a value needs the coefficients of its own segment, gathered one by one.
"""

from __future__ import annotations

from ctypes import byref
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqmbd.compiled.driver import Segments, address, aligned, driver
from uqmbd.typing import Array, Index

__all__ = ["SegmentTable"]


BLOCK = 4
"""Chebyshev polynomials that the driver takes at once, and times."""

ROOM = 136
"""Times of a sample that the driver keeps until it puts them into rows, and four more."""

SLACK = 1e-12
"""Part of the largest time by which a last edge, a sum of terms, may miss a time that it is meant to be."""


@dataclass(frozen=True, eq=False)
class SegmentTable:
    """Coefficients as they are evaluated; see :meth:`of`.

    Attributes
    ----------
    edges : array, shape (S + 1, P)
        Of the times at which segments begin and end.
    used : array of int, shape (S, C)
        How many times four Chebyshev polynomials an output has in a segment.
    counts : array of int, shape (S, C, B)
        How many terms four polynomials have that are not zero: the first ones.
    starts : array of int, shape (S, C)
        Where the coefficients of an output in a segment begin.
    coefficients : array, one axis
        Of four polynomials, term by term; of one four after the other, output by output, segment by segment.
    """

    edges: Array
    used: Index
    counts: Index
    starts: Index
    coefficients: Array

    @classmethod
    def of(cls, edges: Array, segments: Array) -> SegmentTable:
        """Arrange coefficients.

        Parameters
        ----------
        edges : array, shape (P, S + 1)
            Coefficients of P terms of the times at which S segments begin and end.
        segments : array, shape (P, S, C, N)
            The same of C outputs, of N Chebyshev polynomials of a segment's normalised time.
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
        """Return the edges (K, S + 1) of samples from the terms at them (K, P); none is before the one before it."""
        basis = self._basis(basis)
        found = np.empty((len(basis), len(self.edges)))
        work = aligned(basis.shape[1])
        driver().segment_edges(byref(self._driven), len(basis), *map(address, (basis, found, work)))
        return found

    def evaluate(self, basis: Array, times: Array, outputs: slice, found: Array, rows: Index) -> None:
        """Evaluate outputs of samples at times.

        Parameters
        ----------
        basis : array, shape (K, P)
            The terms at the samples.
        times : array, shape (T,)
            Increasing.
        outputs : slice
            Which outputs, one after the other.
        found : array, shape (R, outputs, T)
            Rows of it are written: NaN at times behind the last edge of a sample, but for rounding; the begin stands
            for what is before it.
        rows : array of int, shape (K,)
            A row for each sample.
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
        # times that may be read at once
        padded = np.append(times, np.full(BLOCK, times[-1])).astype(float)
        reach = padded[-1] - padded[0]
        rate = count / reach if reach > 0 else 0.0
        below = np.searchsorted(padded[:count], padded[0] + reach / count * np.arange(count + 1))
        blocks, terms, edges = self.counts.shape[2], basis.shape[1], len(self.edges)
        work = aligned((BLOCK * blocks + ROOM) * width + BLOCK**2 * blocks + terms + 2 * edges)
        driver().segment_values(
            *(byref(self._driven), len(basis), first, last, count, address(basis), address(rows)),
            *(address(padded), address(below), count, rate, SLACK * float(np.abs(times).max())),
            *map(address, (found, work)),
        )

    def _basis(self, basis: Array) -> Array:
        if basis.ndim != 2 or basis.shape[1] != self.edges.shape[1]:
            raise ValueError(f"a table of {self.edges.shape[1]} terms was given a basis {basis.shape}")
        return np.ascontiguousarray(basis, dtype=float)

    @cached_property
    def _driven(self) -> Segments:
        """The table as the driver takes it; it lives no longer than this."""
        sizes = len(self.used), self.used.shape[1], self.edges.shape[1], self.counts.shape[2]
        arrays = self.edges, self.used, self.counts, self.starts, self.coefficients
        return Segments(*sizes, *map(address, arrays))
