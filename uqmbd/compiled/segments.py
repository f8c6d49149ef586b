"""Evaluate samples of segment-wise expansions, between event or phase markers, and of harmonics, at given times.

NumPy takes ten times as long for segments, because it gathers the coefficients of the segment separately for each
value. For harmonics, NumPy takes five times as long, even if it computes them as products of harmonics at few times.
The compiled loop computes the values at two times, symmetric about a third one, from the same even and odd parts. It
makes no copies.
"""

from __future__ import annotations

from ctypes import byref
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from uqmbd.compiled.driver import SegmentsStruct, address, aligned, load_driver
from uqmbd.typing import Array, Index

__all__ = ["SegmentTable", "sum_harmonics"]


BLOCK = 4
"""Number of Chebyshev polynomials, and of times, that the driver evaluates at once."""

ROOM = 136
"""Number of times in the driver's buffer for one output of one sample, including four additional times."""

SLACK = 1e-12
"""Allowed rounding error of the last edge, a sum of terms, relative to the largest time."""


@dataclass(frozen=True, eq=False)
class SegmentTable:
    """Coefficients of segment-wise expansions, in the order of their evaluation by the driver."""

    edges: Array  # (S + 1, P): coefficients of the terms of the times at which segments begin and end
    used: Index  # (S, C): number of groups of four Chebyshev polynomials of an output in a segment
    counts: Index  # (S, C, B): number of leading terms that are not zero in a group of four polynomials
    starts: Index  # (S, C): index of the first coefficient of an output in a segment
    coefficients: Array  # one axis, ordered by segment, output, group of four polynomials, term, polynomial

    @classmethod
    def of(cls, edges: Array, segments: Array) -> SegmentTable:
        """Arrange coefficients of P terms: edges (P, S + 1) of S segments, and C outputs (P, S, C, N).

        An output has N Chebyshev polynomials of the normalised time of a segment.
        """
        terms, count, outputs, powers = segments.shape
        if edges.shape != (terms, count + 1):
            raise ValueError(
                f"edges have the shape {edges.shape}; expected {(terms, count + 1)} for segments {segments.shape}"
            )
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
            raise ValueError(
                f"the array for outputs {outputs} at {count} times has the shape {found.shape} and the type "
                f"{found.dtype}; expected a contiguous array of float with the shape (R, {width}, {count}), and a "
                "slice with step 1"
            )
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
            raise ValueError(f"the basis has the shape {basis.shape}; expected {self.edges.shape[1]} terms in each row")
        return np.ascontiguousarray(basis, dtype=float)

    @cached_property
    def _driven(self) -> SegmentsStruct:
        """Return the C structure for the driver; it is valid as long as this object."""
        sizes = len(self.used), self.used.shape[1], self.edges.shape[1], self.counts.shape[2]
        arrays = self.edges, self.used, self.counts, self.starts, self.coefficients
        return SegmentsStruct(*sizes, *map(address, arrays))


CACHE = 192
"""Largest number of harmonics times time offsets in a block: the values of eight samples, 128 bytes, fit in the first
cache."""

HARMONICS = 1 << 16
"""Largest number of values that are computed at once: samples times blocks times base frequencies, 16 bytes each."""

EVEN = 1e-9
"""Largest deviation of times from a uniform grid, relative to its step, for which they count as uniform."""


def sum_harmonics(
    frequencies: Array,
    lattice: Index,
    constants: Array,
    drifts: Array,
    amplitudes: NDArray[np.complex128],
    times: Array,
    found: Array,
    rows: Index,
) -> None:
    """Evaluate sums of harmonics, a constant and a drift, of C outputs of K samples at ascending times (T,), s.

    Base frequencies are (K, M), rad/s; `lattice` (H, M) contains their multiples in each harmonic. `constants` and
    `drifts` are (K, C); `amplitudes` (K, C, H) are a - i b for a cos + b sin. Results are written to rows `rows` (K,)
    of `found` (R, C, T). Uniform times require few evaluations of sine and cosine.
    """
    samples, bases = frequencies.shape
    outputs, harmonics, count = amplitudes.shape[1], len(lattice), len(times)
    if found.shape[1:] != (outputs, count) or not found.flags.c_contiguous or found.dtype != float:
        raise ValueError(f"{outputs} outputs at {count} times do not fit into the array of shape {found.shape}")
    if rows.shape != (samples,) or samples and not 0 <= rows.min() <= rows.max() < len(found):
        raise ValueError(f"{samples} samples were given rows {rows.shape} of {len(found)}")
    if lattice.shape[1:] != (bases,) or amplitudes.shape != (samples, outputs, harmonics):
        raise ValueError(
            f"lattice has the shape {lattice.shape}, and amplitudes have the shape {amplitudes.shape}; expected "
            f"{(harmonics, bases)} and {(samples, outputs, harmonics)}"
        )
    if constants.shape != (samples, outputs) or drifts.shape != (samples, outputs):
        raise ValueError(
            f"constants have the shape {constants.shape}, and drifts have the shape {drifts.shape}; expected "
            f"{(samples, outputs)}"
        )
    if not found.size or not samples:
        return
    step = float(times[-1] - times[0]) / max(count - 1, 1)
    even = count > 1 and bool(np.abs(times - times[0] - step * np.arange(count)).max() <= EVEN * step)
    half = max(2, min(16, CACHE // max(harmonics, 1) - 1, (count - 1) // 2)) if even else 0
    width = 2 * half + 1
    blocks = -(-count // width)
    padded = np.append(times, np.full(blocks * width - count, times[-1])).astype(float)
    used = np.zeros((outputs, harmonics + 1), dtype=np.int64)
    for output, some in enumerate(np.asarray(amplitudes.any(axis=0))):
        used[output, 0] = some.sum()
        used[output, 1 : 1 + used[output, 0]] = np.flatnonzero(some)
    lattice, rows = (np.ascontiguousarray(x, dtype=np.int64) for x in (lattice, rows))
    highest = int(np.abs(lattice).max(initial=0))
    work = aligned(2 * harmonics * (half + 4 + outputs) + 2 * bases * (highest + 1) + width + 2 * outputs)
    size = max(8, HARMONICS // (blocks * bases) // 8 * 8)
    for first in range(0, samples, size):
        part = slice(first, first + size)
        own = frequencies[part, None, :]
        if even:
            coarse = np.repeat(np.exp(1j * (width * step) * own), blocks, axis=1)
            coarse[:, 0] = np.exp(1j * (times[0] + half * step) * own[:, 0])
            np.multiply.accumulate(coarse, axis=1, out=coarse)
            fine = np.exp(1j * (step * np.arange(half + 1))[:, None] * own)
        else:
            coarse, fine = np.exp(1j * padded[:, None] * own), np.ones((len(own), 1, bases), dtype=complex)
        numbers = (np.ascontiguousarray(x[part]) for x in (amplitudes, constants, drifts))
        arrays = [lattice, used, coarse, fine, *numbers, padded, rows[part], found, work]
        load_driver().wave_values(
            *(len(own), outputs, harmonics, bases, highest, blocks, half, count), *(address(x) for x in arrays)
        )
