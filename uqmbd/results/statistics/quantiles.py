"""Quantiles and extremes of more samples than are held at once: by passes over them, or counted while they come."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import prod
from typing import Protocol

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.results.schema import DEFAULT_PROBABILITIES
from uqmbd.results.statistics.brackets import Brackets, Counts, block_rows, row_blocks
from uqmbd.typing import Array, Index, Mask

__all__ = ["Chunk", "CountedQuantiles", "quantiles_of_chunks"]


class Chunk(Protocol):
    """Consecutive samples, as `uqmbd.Realisations` and the chunks of a `uqmbd.results.SampleStore` are."""

    @property
    def response(self) -> Array:
        """Responses, shape (K, ...)."""

    @property
    def good(self) -> Mask:
        """Which succeeded, with values that are finite, shape (K,)."""


FIRST_SAMPLES = 20_000
"""Samples from which the first brackets come."""

FIRST_NUMBERS = 8_000_000
"""Numbers (8 bytes each) of these at most."""

DEVIATIONS = 6.0
"""Half the width of a first bracket, in standard deviations of the rank: one in 5e8 misses its quantile."""

COUNTERS, MOST_BINS, LEAST_BINS = 4_000_000, 1024, 8
"""Counters (8 bytes each) of all brackets, and bins of each."""

GATHERED = 2_000_000
"""Values that are gathered at once, at most, with 8 bytes for each and as many for whose they are."""

NOT_FINITE = "A sample that counts as successful holds a NaN or an infinity; give it a status other than 0."

POOR = 4
"""Where bins divide the number of candidates by less, the next ones are bins of floating-point numbers."""


class CountedQuantiles:
    """Quantiles of samples that come once, with bounds that hold; the same bits in whatever order chunks come.

    Numbers of samples are counted between edges that come from the first samples: fine ones near each quantile.  A
    quantile is interpolated between the two edges about it, and cannot lie beyond them.

    Parameters
    ----------
    first : array, shape (S, ...)
        The first samples, without those that failed; S may be zero, then the bounds are the smallest and the largest
        sample.  They are not counted here: give them to `add` too.
    probabilities : sequence of float
        Increasing, between 0 and 1; P of them.

    Examples
    --------
    >>> x = np.random.default_rng(1).normal(size=(100_000, 1))
    >>> quantiles = CountedQuantiles(x[:20_000], [0.5])
    >>> for k in range(0, len(x), 10_000):
    ...     quantiles.add(x[k : k + 10_000])
    >>> found = quantiles.statistics()
    >>> bool(np.abs(found["quantile"] - np.median(x)) <= found["quantile_error"]), found["quantile_error"].item() < 1e-3
    (True, True)
    """

    def __init__(self, first: Array, probabilities: Sequence[float] = DEFAULT_PROBABILITIES) -> None:
        self._shape = first.shape[1:]
        self._levels = levels_of(probabilities)
        columns = first.reshape(len(first), prod(self._shape)) if len(first) else np.zeros((1, prod(self._shape)))
        self._counts = Counts(first_brackets(columns, self._levels), columns.shape[1])
        self._waiting: list[Array] = []

    def add(self, samples: Array) -> None:
        """Count samples that succeeded, shape (K, ...)."""
        if not len(samples):
            return
        self._waiting.append(samples.reshape(len(samples), prod(self._shape)))
        if sum(map(len, self._waiting)) >= block_rows(prod(self._shape)):
            self._flush()

    def _flush(self) -> None:
        """Count the samples that wait: few at once would take longer."""
        for block in row_blocks(self._waiting):
            self._counts.add(block)
        self._waiting = []

    def statistics(self) -> dict[str, Array]:
        """Return the quantiles, how far they may be off, and the extremes.

        Returns
        -------
        dict of str to numpy.ndarray
            ``quantile`` and ``quantile_error``, shape (P, ...): the quantile of all samples, as `sample_statistics`
            has it, lies within the error; ``smallest`` and ``largest``, shape (...), exact.

        Raises
        ------
        StudyError
            With fewer than two samples, or samples that are not finite.
        """
        self._flush()
        _check(self._counts)
        below, part = ranks_of(self._levels, self._counts.count)
        ends = [self._about(below), self._about(below + 1)]
        value, low, high = (interpolated(a, b, part) for a, b in zip(*ends, strict=True))
        value = np.maximum.accumulate(value)  # brackets may overlap where the first samples are few
        # rounding of the interpolation is no error of the counts, but must not lead out of the bound
        rounding = np.where(low < high, 4 * np.finfo(float).eps * np.maximum(np.abs(low), np.abs(high)), 0.0)
        error = np.maximum(np.maximum(value - low, high - value), 0.0) + rounding
        return {
            "quantile": value.reshape(-1, *self._shape),
            "quantile_error": error.reshape(-1, *self._shape),
            "smallest": self._counts.smallest.reshape(self._shape),
            "largest": self._counts.largest.reshape(self._shape),
        }

    def _about(self, ranks: Index) -> tuple[Array, Array, Array]:
        """Estimate order statistics (P, C), with their bounds."""
        counts, brackets = self._counts, self._counts.brackets
        shape = (len(self._levels), len(counts.smallest))
        smallest, largest = (np.tile(x, len(self._levels)) for x in (counts.smallest, counts.largest))
        wanted = np.repeat(ranks, shape[1]) - counts.below
        cumulated = counts.inside.cumsum(axis=1)
        within = cumulated[:, -1]
        cases = [wanted < 0, wanted >= within]
        which = np.arange(len(wanted))
        number = np.minimum(_bin_of(cumulated, wanted, which), brackets.bins - 1)
        low, high = brackets.edges(which, number)
        there = counts.inside[which, number]
        before = cumulated[which, number] - there
        low = np.maximum(np.select(cases, [smallest, brackets.high], low), smallest)
        high = np.minimum(np.select(cases, [brackets.low, largest], high), largest)
        there = np.select(cases, [counts.below, counts.count - counts.below - within], there)
        place = wanted - np.select(cases, [-counts.below, within], before)
        with np.errstate(over="ignore"):
            value = np.clip(low + (place + 0.5) / there * (high - low), low, high)
        return value.reshape(shape), low.reshape(shape), high.reshape(shape)


def quantiles_of_chunks(
    chunks: Iterable[Chunk], probabilities: Sequence[float] = DEFAULT_PROBABILITIES
) -> dict[str, Array]:
    """Compute the quantiles and extremes of samples that can be gone through again, exactly, in bounded memory.

    The first samples bracket each quantile.  A pass over all counts how many lie below the brackets and in their parts;
    the next one gathers those in the parts that hold a quantile, or counts again where these are too many.

    Parameters
    ----------
    chunks : iterable
        Which can be gone through again, as `uqmbd.results.SampleStore.chunks`: each has a `response` (K, ...) and
        `good` (K,).  The same samples in each pass; their order does not matter, but a pass more may be needed where
        the first ones are not like the others.
    probabilities : sequence of float
        Increasing, between 0 and 1; P of them.

    Returns
    -------
    dict of str to numpy.ndarray
        ``quantile``, shape (P, ...), ``smallest`` and ``largest``, shape (...): the bits of `sample_statistics` of all
        samples that succeeded; and ``probability``.

    Raises
    ------
    StudyError
        If fewer than two samples succeeded, one that did is not finite, or the samples change between the passes.

    Examples
    --------
    >>> import tempfile
    >>> from uqmbd.results import SampleStore, labels, sample_dataset
    >>> x = np.random.default_rng(1).normal(size=(1000, 1, 1))
    >>> samples = sample_dataset(x, np.zeros((1000, 1)), labels(["x"], ["k"], [0.0]))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     store = SampleStore.write(f"{folder}/mc-samples.zarr", samples)
    ...     found = quantiles_of_chunks(store.chunks(), [0.5])
    >>> bool(found["quantile"].item() == np.median(x)), bool(found["largest"].item() == x.max())
    (True, True)
    """
    levels = levels_of(probabilities)
    first, shape = _first_samples(chunks)
    columns = first.shape[1]
    brackets = first_brackets(first, levels)
    del first
    counts = _counted(chunks, brackets, columns)
    _check(counts)
    below, part = ranks_of(levels, counts.count)
    # the pairs of order statistics between which quantiles are interpolated, and the brackets that they are in
    rank = np.repeat(np.concatenate([below, below + 1]), columns)
    where = np.tile(np.arange(len(levels) * columns), 2)
    value, open_ = np.empty(len(rank)), np.arange(len(rank))
    while True:
        narrowed, inverse = _narrowed(counts, rank[open_], where[open_])
        settled = (narrowed.brackets.low == narrowed.brackets.high)[inverse]
        value[open_[settled]] = narrowed.brackets.low[inverse[settled]]
        open_, inverse = open_[~settled], inverse[~settled]
        used, inverse = np.unique(inverse, return_inverse=True)
        narrowed = narrowed.chosen(used)
        if narrowed.number.sum() <= GATHERED:
            values = _gathered(chunks, counts.brackets, narrowed)
            value[open_] = values[narrowed.starts[inverse] + rank[open_] - narrowed.before[inverse]]
            break
        where[open_] = inverse
        counts = _counted(chunks, narrowed.brackets, columns)
    low, high = value.reshape(2, len(levels), columns)
    return {
        "quantile": interpolated(low, high, part).reshape(-1, *shape),
        "smallest": counts.smallest.reshape(shape),
        "largest": counts.largest.reshape(shape),
        "probability": levels,
    }


@dataclass(frozen=True, eq=False)
class _Narrowed:
    """Brackets about what is a bin of other brackets, or all that is below or above of these.

    Attributes
    ----------
    brackets : Brackets
    parent, bin : array of int, shape (M,)
        Of which bracket, and which of its bins: -1 for what is below, the number of bins for what is above.
    before, number : array of int, shape (M,)
        Samples that are smaller, and samples that are in it.
    """

    brackets: Brackets
    parent: Index
    bin: Index
    before: Index
    number: Index

    @property
    def starts(self) -> Index:
        """Where the values of each bracket begin, of all that are gathered."""
        return np.concatenate([[0], self.number.cumsum()[:-1]]) if len(self.number) else self.number

    def chosen(self, which: Index) -> _Narrowed:
        """Return some of them, in the same order."""
        rest = (x[which] for x in (self.parent, self.bin, self.before, self.number))
        return _Narrowed(self.brackets.chosen(which), *rest)


def _narrowed(counts: Counts, rank: Index, where: Index) -> tuple[_Narrowed, Index]:
    """Return brackets about the bins that hold order statistics of brackets `where`, and the one of each statistic."""
    brackets, bins = counts.brackets, counts.brackets.bins
    cumulated = counts.inside.cumsum(axis=1)
    wanted = rank - counts.below[where]
    number = np.where(wanted < 0, -1, _bin_of(cumulated, wanted, where))
    pairs, inverse = np.unique(where * (bins + 2) + number + 1, return_inverse=True)
    parent, number = pairs // (bins + 2), pairs % (bins + 2) - 1
    inner = np.clip(number, 0, bins - 1)
    low, high = brackets.edges(parent, inner)
    column = brackets.column[parent]
    cases = [number < 0, number == bins]
    within, under = cumulated[parent, -1], counts.below[parent]
    there = counts.inside[parent, inner]
    found = np.select(cases, [under, counts.count - under - within], there)
    before = np.select(cases, [0, under + within], under + cumulated[parent, inner] - there)
    low = np.select(cases, [counts.smallest[column], np.nextafter(brackets.high[parent], np.inf)], low)
    high = np.select(cases, [np.nextafter(brackets.low[parent], -np.inf), counts.largest[column]], high)
    poor = (found * POOR > within) | brackets.ordered[parent]
    ordered = poor & (number >= 0) & (number < bins)
    order, group = _grouped(column)
    back = np.empty_like(order)
    back[order] = np.arange(len(order))
    made = Brackets(column[order], group, low[order], high[order], ordered[order], bins_of(len(column)))
    return _Narrowed(made, *(x[order] for x in (parent, number, before, found))), back[inverse]


def _grouped(column: Index) -> tuple[Index, Index]:
    """Return an order of brackets, group after group with no column twice in a group, and the groups."""
    by_column = np.argsort(column, kind="stable")
    ascending = column[by_column]
    group = np.arange(len(column)) - np.searchsorted(ascending, ascending)
    order = np.lexsort((ascending, group))
    return by_column[order], group[order]


def _counted(chunks: Iterable[Chunk], brackets: Brackets, columns: int) -> Counts:
    counts = Counts(brackets, columns)
    for block in row_blocks(_good_rows(chunks)):
        counts.add(block)
    return counts


def _gathered(chunks: Iterable[Chunk], parents: Brackets, narrowed: _Narrowed) -> Array:
    """Return all values in brackets, sorted in each, bracket after bracket."""
    if not len(narrowed.number):
        return np.empty(0)
    owners, values = [np.empty(0, dtype=np.int64)], [np.empty(0)]
    inner = (narrowed.bin >= 0) & (narrowed.bin < parents.bins)
    for block in row_blocks(_good_rows(chunks)):
        for which, x in narrowed.brackets.within(block):
            # brackets of bins are wider by some last bits
            keep = ~inner[which]
            keep[~keep] = parents.index(narrowed.parent[which[~keep]], x[~keep]) == narrowed.bin[which[~keep]]
            owners.append(which[keep])
            values.append(x[keep])
    owner, x = np.concatenate(owners), np.concatenate(values)
    if not np.array_equal(np.bincount(owner, minlength=len(narrowed.number)), narrowed.number):
        raise StudyError("Samples are others than on the pass before: something has written into them.")
    return x[np.lexsort((x, owner))]


def _first_samples(chunks: Iterable[Chunk]) -> tuple[Array, tuple[int, ...]]:
    """Return the first samples that succeeded, at least one row, and the shape of a sample."""
    found, shape, count = list[Array](), None, 0
    for chunk in chunks:
        shape = chunk.response.shape[1:]
        rows = chunk.response[chunk.good].reshape(np.count_nonzero(chunk.good), prod(shape))
        most = min(FIRST_SAMPLES, FIRST_NUMBERS // max(1, rows.shape[1])) - count
        found.append(rows[: max(most, 1 - count)])
        count += len(found[-1])
        if count >= 1 and len(rows) >= most:
            break
    if shape is None or not count:
        raise StudyError("Statistics need at least two successful samples; there are 0.")
    return np.concatenate(found), shape


def _good_rows(chunks: Iterable[Chunk]) -> Iterator[Array]:
    for chunk in chunks:
        rows = chunk.response if chunk.good.all() else chunk.response[chunk.good]
        if len(rows):
            yield rows.reshape(len(rows), prod(rows.shape[1:]))


def _check(counts: Counts) -> None:
    """Raise where there are too few samples, or what is not finite."""
    if counts.count < 2:
        raise StudyError(f"Statistics need at least two successful samples; there are {counts.count}.")
    # minima and maxima pass on what is not a number
    if not (np.isfinite(counts.smallest).all() and np.isfinite(counts.largest).all()):
        raise StudyError(NOT_FINITE)


def first_brackets(first: Array, levels: Array) -> Brackets:
    """Return a bracket about each quantile, level after level, from the first samples, shape (S, C), S at least 1."""
    count, columns = first.shape
    # where they are, so that ranks of all samples are some deviations away from the ends
    reach = DEVIATIONS * np.sqrt(count * levels * (1 - levels)) + 1
    low = np.maximum(np.floor(levels * (count - 1) - reach), 0).astype(np.int64)
    high = np.minimum(np.ceil(levels * (count - 1) + reach), count - 1).astype(np.int64)
    ends = np.empty((2, len(levels), columns))
    for start in range(0, columns, width := max(1, 1_000_000 // count)):
        part = np.sort(first[:, start : start + width].T, axis=1)
        ends[0, :, start : start + width], ends[1, :, start : start + width] = part[:, low].T, part[:, high].T
    number = len(levels) * columns
    column, level = np.tile(np.arange(columns), len(levels)), np.repeat(np.arange(len(levels)), columns)
    return Brackets(column, level, ends[0].ravel(), ends[1].ravel(), np.zeros(number, dtype=bool), bins_of(number))


def bins_of(brackets: int) -> int:
    """Return how many bins brackets have."""
    return int(np.clip(COUNTERS // max(brackets, 1), LEAST_BINS, MOST_BINS))


def _bin_of(cumulated: Index, wanted: Index, where: Index) -> Index:
    """Return the bins that hold order statistics `wanted` of brackets `where`: the number of bins if none does."""
    bins = cumulated.shape[1]
    # the rows, one above the other, ascend
    height = int(cumulated[:, -1].max(initial=0)) + 1
    rows = (cumulated + height * np.arange(len(cumulated))[:, None]).ravel()
    target = np.clip(wanted, 0, height - 1) + height * where
    found: Index = np.clip(np.searchsorted(rows, target, side="right") - bins * where, 0, bins)
    return found


def levels_of(probabilities: Sequence[float]) -> Array:
    """Return probabilities, or raise a StudyError where they cannot be used."""
    levels = np.array(probabilities, dtype=float)
    if levels.ndim != 1 or np.any(levels < 0) or np.any(levels > 1) or np.any(np.diff(levels) <= 0) or not levels.size:
        raise StudyError(f"Probabilities must increase between 0 and 1; {list(probabilities)} was given.")
    return levels


def ranks_of(levels: Array, count: int) -> tuple[Index, Array]:
    """Return the lower ranks of the pairs between which quantiles lie, and the part of the way to the next."""
    position = levels * (count - 1)
    below = np.minimum(position.astype(np.int64), count - 2)
    return below, position - below


def interpolated(low: Array, high: Array, part: Array) -> Array:
    """Return values between two, shape (P, ...), from the nearer end, so that the ends are met exactly."""
    part = part.reshape(-1, *[1] * (low.ndim - 1))
    step = high - low
    return np.where(part < 0.5, low + part * step, high - (1 - part) * step)
