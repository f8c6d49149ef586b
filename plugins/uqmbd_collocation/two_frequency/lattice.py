"""Spectral lines as combinations of base frequencies, and the combinations that a series needs."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from uqmbd.typing import Array, Index
from uqmbd_collocation.two_frequency.lines import SpectralLines

__all__ = ["Base", "ball", "bases"]


HIGHEST = {1: 24, 2: 8}
"""Largest order |k1| + |k2| of an informative line for a base of one frequency, and of two."""

NEAR = 0.2
"""Largest distance of a line from its combination, in units of the resolution 2 pi / length."""

OFF = 10.0
"""Cost, in orders, of a line at the distance `NEAR`. The cost grows with the square of the distance, so that the closer
one of two similar bases is preferred."""

MISSED = 1000
"""Cost of a line that is not a combination, in orders."""


@dataclass(frozen=True, eq=False)
class Base:
    """Base frequencies whose combinations are the lines."""

    frequencies: Array  # (M,) rad/s, increasing
    lattice: Index  # (C, M) lines that are combinations, the strongest first


def ball(order: int, dimension: int) -> Index:
    """Return nonzero combinations (H, M) up to an order |k1| + ..., and only one of each pair of opposite sign.

    >>> ball(2, 2).tolist()
    [[0, 1], [0, 2], [1, -1], [1, 0], [1, 1], [2, 0]]
    """
    grid = np.stack(np.meshgrid(*[np.arange(-order, order + 1)] * dimension, indexing="ij"), axis=-1)
    rows = grid.reshape(-1, dimension)
    first = np.take_along_axis(rows, (rows != 0).argmax(axis=1)[:, None], axis=1)[:, 0]
    found: Index = rows[(np.abs(rows).sum(axis=1) <= order) & (first > 0)]
    return found


def bases(lines: SpectralLines, resolution: float) -> list[Base]:
    """Return the simplest base of one frequency with all lines as multiples, and the simplest base of two, if any.

    The simplest base has the smallest sum of orders of all lines. Each frequency of a base is a line, half or a third
    of a line, or a sum or difference of two lines. It can also be half of such a sum or difference. A base frequency
    need not be a line: the height of a pendulum has only even combinations. `resolution`: 2 pi / length, rad/s.
    """
    f = lines.frequencies
    pairs = [abs(a - b) for a, b in combinations(f, 2)] + [a + b for a, b in combinations(f, 2)]
    several = np.array([*f, *(f / 2), *(f / 3), *pairs, *(x / 2 for x in pairs)])
    several = _without_repetitions(several[several > resolution], NEAR / 4 * resolution)
    found = []
    for dimension in (1, 2):
        terms = ball(HIGHEST[dimension], dimension)
        order = np.abs(terms).sum(axis=1)
        best: tuple[float, int] | None = None
        groups = np.array(list(combinations(several, dimension)))
        for n in range(len(groups)):
            cost = _costs(f, terms @ groups[n], order, NEAR * resolution).min(axis=1).sum()
            if best is None or cost < best[0]:
                best = float(cost), n
        if best is None or (dimension == 1 and best[0] >= MISSED):
            continue
        frequencies = np.sort(groups[best[1]])
        lattice = _combinations(f, frequencies, terms, NEAR * resolution)
        # a frequency that no line needs is not a frequency of the motion
        if np.linalg.matrix_rank(lattice) == dimension:
            found.append(Base(frequencies, lattice))
    return found


def _costs(lines: Array, values: Array, order: Index, tolerance: float) -> Array:
    """Return costs (L, C) of combinations for each line, from their orders and distances."""
    off = np.abs(lines[:, None] - np.abs(values)) / tolerance
    return np.where(off <= 1, order + OFF * off**2, MISSED)


def _combinations(lines: Array, base: Array, terms: Index, tolerance: float) -> Index:
    """Return the combination (C, M) of least cost for each line that is a combination; omit other lines."""
    cost = _costs(lines, terms @ base, np.abs(terms).sum(axis=1), tolerance)
    chosen = terms[cost.argmin(axis=1)[cost.min(axis=1) < MISSED]]
    _, first = np.unique(chosen, axis=0, return_index=True)
    found: Index = chosen[np.sort(first)]
    return found


def _without_repetitions(values: Array, tolerance: float) -> Array:
    """Return values in their order; omit each value whose distance to an earlier one is within the tolerance."""
    kept: list[float] = []
    for value in values:
        if all(abs(value - other) > tolerance for other in kept):
            kept.append(float(value))
    return np.array(kept)
