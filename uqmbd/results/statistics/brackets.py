"""Bracket order statistics of many columns, and count the samples in the bins of each bracket.

Counts between fixed edges are faster than sketches. For 100,000 samples of 201 columns, KLL sketches of Apache
``datasketches`` (k = 2000) took 58 ns per number, with rank uncertainty 9e-4. The t-digest of ``datasketches`` (k =
1000) took 98 ns per number, with an uncertainty of 4e-3. Sketches draw random numbers, so each process returned
different bits for the same samples. Counts take about 15 ns per number, give the same bits for samples in
any order, and give guaranteed bounds.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.typing import Array, Index, Mask

__all__ = ["Brackets", "Counts"]

BLOCK_NUMBERS = 65_536
"""Number of values (8 bytes each) that are compared at once and fit the cache."""

_MOST_ROWS = 65_535
"""Maximum rows of a block for counters of 16 bits, which take a third of the time of 64 bits."""

_PENDING = 1_000_000
"""Number of bin indices that are collected before they are counted together."""


@dataclass(frozen=True, eq=False)
class Brackets:
    """M closed intervals [low, high] of values, each in one of C columns and divided into equal bins.

    A non-decreasing function maps values to the integer of their bin. This function is of one of two kinds: linear in
    the value, or the number of floating-point numbers from the lower end. The second kind separates any two different
    values.
    """

    column: Index  # (M,)
    group: Index  # (M,): ascending; no two brackets of a group are in the same column
    # low, high: (M,), finite, low <= high
    low: Array
    high: Array
    ordered: Mask  # (M,): whether the bins count floating-point numbers
    bins: int  # number of bins of each bracket

    @cached_property
    def _scale(self) -> Array:
        """Bins per unit; 0 if linear bins are impossible."""
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            scale = self.bins / (self.high - self.low)
        usable = np.isfinite(scale) & (scale > 0) & ~self.ordered
        return np.where(usable, scale, 0.0)

    @cached_property
    def _key(self) -> NDArray[np.uint64]:
        return _key(self.low)

    @cached_property
    def _step(self) -> NDArray[np.uint64]:
        """Number of floating-point numbers in a bin."""
        return (_key(self.high) - self._key) // np.uint64(self.bins) + np.uint64(1)

    def index(self, which: Index, x: Array) -> Index:
        """Return the bins of values within brackets `which`."""
        found = np.empty(len(x), dtype=np.int64)
        linear = self._scale[which] > 0
        every = bool(linear.all())
        of, values = (which, x) if every else (which[linear], x[linear])
        position = np.minimum((values - self.low[of]) * self._scale[of], self.bins - 1)
        if every:
            return position.astype(np.int64)
        found[linear] = position.astype(np.int64)
        of = which[~linear]
        found[~linear] = ((_key(x[~linear]) - self._key[of]) // self._step[of]).astype(np.int64)
        return found

    def edges(self, which: Index, number: Index) -> tuple[Array, Array]:
        """Return closed intervals that contain the bins `number` of brackets `which`, wider by a few last bits."""
        linear = self._scale[which] > 0
        scale = np.where(linear, self._scale[which], 1.0)
        eps = 4.0 * np.finfo(float).eps
        base = self.low[which]
        with np.errstate(over="ignore"):
            low = np.nextafter(base + number / scale * (1 - eps), -np.inf)
            high = np.nextafter(base + (number + 1) / scale * (1 + eps), np.inf)
        step, key = self._step[which], self._key[which]
        first = key + number.astype(np.uint64) * step
        last = np.minimum(first + (step - np.uint64(1)), _key(self.high[which]))
        low, high = np.where(linear, low, _value(first)), np.where(linear, high, _value(last))
        return np.maximum(low, base), np.minimum(high, self.high[which])

    def chosen(self, which: Index) -> Brackets:
        """Return selected brackets, in the same order."""
        ends = self.low[which], self.high[which]
        return Brackets(self.column[which], self.group[which], *ends, self.ordered[which], self.bins)

    def within(self, x: Array, below: Index | None = None) -> list[tuple[Index, Array]]:
        """Find the values of rows (K, C) in brackets, and count the values below each bracket.

        `x` (K, C): finite values, with K at most 65,535; `below` (M,): counters, which are increased. Return indices of
        brackets, and the values in them.
        """
        found = []
        for first, last in self._groups:
            columns = self.column[first:last]
            whole = last - first == x.shape[1]
            part = np.ascontiguousarray(x) if whole else np.take(x, columns, axis=1)
            under = part < self.low[first:last]
            if below is not None:
                below[first:last] += under.sum(axis=0, dtype=np.uint16)
            # `under` values are also <= high, so the exclusive or selects the values in the brackets
            hit = np.flatnonzero((part <= self.high[first:last]) ^ under)
            found.append((first + hit % (last - first), part.ravel()[hit]))
        return found

    @cached_property
    def _groups(self) -> list[tuple[int, int]]:
        """Ranges of bracket indices of the groups; the brackets of a group with all columns are in column order."""
        edges = np.flatnonzero(np.diff(self.group, prepend=-1, append=np.iinfo(np.int64).max))
        return [(int(a), int(b)) for a, b in zip(edges[:-1], edges[1:], strict=True)]


class Counts:
    """Counters of samples below brackets and in their bins, with smallest and largest samples.

    The counts are independent of the order of the samples. `columns`: C; `count`: number of samples so far; `smallest`,
    `largest` (C,): extremes, infinite before the first sample.
    """

    def __init__(self, brackets: Brackets, columns: int) -> None:
        self.brackets = brackets
        self.count = 0
        self.smallest, self.largest = np.full(columns, np.inf), np.full(columns, -np.inf)
        self.below = np.zeros(len(brackets.low), dtype=np.int64)
        self._inside = np.zeros(len(brackets.low) * brackets.bins, dtype=np.int64)
        self._pending: list[Index] = []
        self._waiting = 0

    def add(self, x: Array) -> None:
        """Count finite samples, shape (K, C), with K as for `Brackets.within`."""
        self.count += len(x)
        np.minimum(self.smallest, x.min(axis=0), out=self.smallest)
        np.maximum(self.largest, x.max(axis=0), out=self.largest)
        for which, values in self.brackets.within(x, self.below):
            self._pending.append(which * self.brackets.bins + self.brackets.index(which, values))
            self._waiting += len(which)
        if self._waiting > max(_PENDING, len(self._inside) // 2):
            self._flush()

    @property
    def inside(self) -> Index:
        """Counts in the bins, shape (M, bins)."""
        self._flush()
        return self._inside.reshape(-1, self.brackets.bins)

    def _flush(self) -> None:
        if self._pending:
            self._inside += np.bincount(np.concatenate(self._pending), minlength=len(self._inside))
        self._pending, self._waiting = [], 0


def row_blocks(parts: Iterable[Array]) -> Iterator[Array]:
    """Split or join rows (K, C), in order, to blocks that fit the cache."""
    waiting, count = list[Array](), 0
    for part in parts:
        size = block_rows(part.shape[1])
        if len(part) < size:
            waiting.append(part)
            count += len(part)
            if count < size:
                continue
            part = np.concatenate(waiting)
        elif waiting:
            yield np.concatenate(waiting)
        waiting, count = [], 0
        for k in range(0, len(part), size):
            yield part[k : k + size]
    if waiting:
        yield np.concatenate(waiting)


def block_rows(columns: int) -> int:
    """Return the number of rows of a block."""
    return min(max(1, BLOCK_NUMBERS // max(1, columns)), _MOST_ROWS)


def _key(x: Any) -> NDArray[np.uint64]:
    """Map floating-point numbers to integers in the same order; neighbours have consecutive integers."""
    bits = (np.asarray(x, dtype=float) + 0.0).view(np.uint64)  # minus zero is zero
    sign = np.uint64(1 << 63)
    return np.where(bits & sign, ~bits + np.uint64(1), bits | sign)


def _value(key: NDArray[np.uint64]) -> Array:
    """Map integers from `_key` to floating-point numbers."""
    sign = np.uint64(1 << 63)
    return np.where(key & sign, key & ~sign, ~key + np.uint64(1)).astype(np.uint64).view(np.float64)
