"""Sums of harmonics with few base frequencies, evaluated for samples at given times.

In NumPy, with products of harmonics at few times, the evaluation takes five times as long. The compiled loop uses the
even and odd parts about a time for two times, and makes no copies.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uqmbd.compiled.driver import address, aligned, load_driver
from uqmbd.typing import Array, Index

__all__ = ["sum_harmonics"]


CACHE = 192
"""Number of harmonics, at all distances in a block, that fit in the first cache (eight samples, 128 bytes each)."""

ROOM = 1 << 16
"""Number of harmonics of samples at all blocks (16 bytes each) that are computed at once."""

EVEN = 1e-9
"""Largest difference between time steps, relative to the last time, for which times count as uniform."""


def sum_harmonics(
    frequencies: Array,
    lattice: Index,
    constants: Array,
    drifts: Array,
    waves: NDArray[np.complex128],
    times: Array,
    found: Array,
    rows: Index,
) -> None:
    """Evaluate sums of harmonics, a constant and a drift, of C outputs of K samples at ascending times (T,), s.

    Base frequencies are (K, M), rad/s; `lattice` (H, M) contains their multiples in each harmonic. `constants` and
    `drifts` are (K, C); `waves` (K, C, H) are a - i b for a cos + b sin. Results are written to rows `rows` (K,) of
    `found` (R, C, T). Uniform times require few evaluations of sine and cosine.
    """
    samples, bases = frequencies.shape
    outputs, harmonics, count = waves.shape[1], len(lattice), len(times)
    if found.shape[1:] != (outputs, count) or not found.flags.c_contiguous or found.dtype != float:
        raise ValueError(f"{outputs} outputs at {count} times do not fit into the array of shape {found.shape}")
    if rows.shape != (samples,) or samples and not 0 <= rows.min() <= rows.max() < len(found):
        raise ValueError(f"{samples} samples were given rows {rows.shape} of {len(found)}")
    if lattice.shape[1:] != (bases,) or waves.shape != (samples, outputs, harmonics):
        raise ValueError(f"{samples} samples of {bases} frequencies were given {lattice.shape}, {waves.shape}")
    if constants.shape != (samples, outputs) or drifts.shape != (samples, outputs):
        raise ValueError(f"{outputs} outputs were given constants and drifts {constants.shape}, {drifts.shape}")
    if not found.size or not samples:
        return
    step = float(times[-1] - times[0]) / max(count - 1, 1)
    even = count > 1 and bool(np.abs(times - times[0] - step * np.arange(count)).max() <= EVEN * step)
    half = max(2, min(16, CACHE // max(harmonics, 1) - 1, (count - 1) // 2)) if even else 0
    width = 2 * half + 1
    blocks = -(-count // width)
    padded = np.append(times, np.full(blocks * width - count, times[-1])).astype(float)
    used = np.zeros((outputs, harmonics + 1), dtype=np.int64)
    for output, some in enumerate(np.asarray(waves.any(axis=0))):
        used[output, 0] = some.sum()
        used[output, 1 : 1 + used[output, 0]] = np.flatnonzero(some)
    lattice, rows = (np.ascontiguousarray(x, dtype=np.int64) for x in (lattice, rows))
    highest = int(np.abs(lattice).max(initial=0))
    work = aligned(2 * harmonics * (half + 4 + outputs) + 2 * bases * (highest + 1) + width + 2 * outputs)
    size = max(8, ROOM // (blocks * bases) // 8 * 8)
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
        numbers = (np.ascontiguousarray(x[part]) for x in (waves, constants, drifts))
        arrays = [lattice, used, coarse, fine, *numbers, padded, rows[part], found, work]
        load_driver().wave_values(
            *(len(own), outputs, harmonics, bases, highest, blocks, half, count), *(address(x) for x in arrays)
        )
