"""Compute quantiles, with error bounds, and extremes of samples in a single pass, by counts between edges."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod

import numpy as np

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.results.schema import DEFAULT_PROBABILITIES
from uqmbd.results.statistics.brackets import Counts, block_rows, row_blocks
from uqmbd.results.statistics.quantile_intervals import interval_ranks, with_open_ends, within_samples
from uqmbd.results.statistics.quantiles import (
    bin_of,
    check_counts,
    first_brackets,
    first_rows,
    interpolated,
    levels_of,
    ranks_of,
    too_few,
)
from uqmbd.typing import Array, Index

__all__ = ["CountedQuantiles"]


@typechecked
class CountedQuantiles:
    """Quantiles of samples in a single pass, with guaranteed error bounds.

    The class counts samples between edges, which are chosen from the first 20,000 samples (fewer for many outputs) and
    are dense near each quantile. A quantile is interpolated between the two enclosing edges, and cannot be outside
    them. The bits of the result are independent of the division into chunks, and of the order of samples after the
    first ones.

    Parameters
    ----------
    probabilities : sequence of float
        Probabilities of the P quantiles, increasing, between 0 and 1.
    independent : bool
        Whether the samples are independent; otherwise they are the points of a design.

    Examples
    --------
    >>> x = np.random.default_rng(1).normal(size=(100_000, 1))
    >>> quantiles = CountedQuantiles([0.5])
    >>> for k in range(0, len(x), 10_000):
    ...     quantiles.add(x[k : k + 10_000])
    >>> found = quantiles.statistics()
    >>> bool(np.abs(found["quantile"] - np.median(x)) <= found["quantile_error"]), found["quantile_error"].item() < 1e-3
    (True, True)
    """

    def __init__(self, probabilities: Sequence[float] = DEFAULT_PROBABILITIES, *, independent: bool = True) -> None:
        self._levels = levels_of(probabilities)
        self._independent = independent
        self._shape: tuple[int, ...] = ()
        self._counts: Counts | None = None
        self._waiting: list[Array] = []
        self._rows = 0

    def add(self, samples: Array) -> None:
        """Count successful samples, shape (K, ...)."""
        if not len(samples):
            return
        self._shape = samples.shape[1:]
        columns = prod(self._shape)
        self._waiting.append(samples.reshape(len(samples), columns))
        self._rows += len(samples)
        if self._rows >= (first_rows(columns) if self._counts is None else block_rows(columns)):
            self._flush()

    def _flush(self) -> Counts:
        """Count the collected samples; the first samples also determine the edges."""
        if self._counts is None:
            rows = np.concatenate(self._waiting)
            self._waiting = [rows]
            levels, columns = self._levels, rows.shape[1]
            self._counts = Counts(first_brackets(rows[: first_rows(columns)], levels), columns)
        for block in row_blocks(self._waiting):
            self._counts.add(block)
        self._waiting, self._rows = [], 0
        return self._counts

    def statistics(self) -> dict[str, Array]:
        """Return the quantiles, their error bounds, and the extremes.

        Returns
        -------
        dict of str to numpy.ndarray
            ``quantile`` and ``quantile_error``, shape (P, ...): the quantile from `sample_statistics` of all samples is
            within this error of the returned one. ``smallest`` and ``largest``, shape (...), are exact. For independent
            samples, the result also contains ``quantile_interval``, shape (2, P, ...): edges that enclose the interval
            from `sample_statistics`.

        Raises
        ------
        StudyError
            If there are fewer than two samples, or samples that are not finite.
        """
        if self._counts is None and not self._rows:
            raise StudyError(too_few(0))
        counts = self._flush()
        check_counts(counts)
        below, part = ranks_of(self._levels, counts.count)
        ends = [_about(counts, self._levels, below), _about(counts, self._levels, below + 1)]
        value, low, high = (interpolated(a, b, part) for a, b in zip(*ends, strict=True))
        value = np.maximum.accumulate(value)  # brackets may overlap if there are few first samples
        # the bound also covers rounding of the interpolation
        rounding = np.where(low < high, 4 * np.finfo(float).eps * np.maximum(np.abs(low), np.abs(high)), 0.0)
        error = np.maximum(np.maximum(value - low, high - value), 0.0) + rounding
        found = {
            "quantile": value.reshape(-1, *self._shape),
            "quantile_error": error.reshape(-1, *self._shape),
            "smallest": counts.smallest.reshape(self._shape),
            "largest": counts.largest.reshape(self._shape),
        }
        if self._independent:
            ranks = interval_ranks(counts.count, self._levels)
            first, last = within_samples(ranks, counts.count)
            edges = np.stack([_about(counts, self._levels, first)[1], _about(counts, self._levels, last)[2]])
            found["quantile_interval"] = with_open_ends(edges, ranks, counts.count).reshape(2, -1, *self._shape)
        return found


def _about(counts: Counts, levels: Array, ranks: Index) -> tuple[Array, Array, Array]:
    """Estimate the order statistics (P, C) of given ranks (P,) from counts, with lower and upper bounds."""
    brackets = counts.brackets
    shape = (len(levels), len(counts.smallest))
    smallest, largest = (np.tile(x, len(levels)) for x in (counts.smallest, counts.largest))
    position = np.repeat(ranks, shape[1]) - counts.below
    cumulated = counts.inside.cumsum(axis=1)
    within = cumulated[:, -1]
    cases = [position < 0, position >= within]
    which = np.arange(len(position))
    number = np.minimum(bin_of(cumulated, position, which), brackets.bins - 1)
    low, high = brackets.edges(which, number)
    there = counts.inside[which, number]
    before = cumulated[which, number] - there
    low = np.maximum(np.select(cases, [smallest, brackets.high], low), smallest)
    high = np.minimum(np.select(cases, [brackets.low, largest], high), largest)
    there = np.select(cases, [counts.below, counts.count - counts.below - within], there)
    place = position - np.select(cases, [-counts.below, within], before)
    with np.errstate(over="ignore"):
        value = np.clip(low + (place + 0.5) / there * (high - low), low, high)
    return value.reshape(shape), low.reshape(shape), high.reshape(shape)
