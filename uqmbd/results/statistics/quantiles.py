"""Compute exact quantiles and extremes by several passes over samples that do not fit into memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import prod
from typing import Protocol

import numpy as np

from uqmbd.arguments import shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.results.schema import DEFAULT_PROBABILITIES
from uqmbd.results.statistics.brackets import Brackets, Counts, row_blocks
from uqmbd.results.statistics.quantile_intervals import interval_ranks, with_open_ends, within_samples
from uqmbd.typing import Array, Index, Mask

__all__ = [
    "ConsecutiveSamples",
    "bin_of",
    "check_counts",
    "first_brackets",
    "first_rows",
    "interpolated",
    "levels_of",
    "quantiles_of_chunks",
    "ranks_of",
    "too_few",
]


class ConsecutiveSamples(Protocol):
    """Consecutive samples, such as `uqmbd.extend.Realisations` and the chunks of a `uqmbd.results.SampleStore`."""

    @property
    def response(self) -> Array:
        """Responses, shape (K, ...)."""

    @property
    def good(self) -> Mask:
        """Successful samples with finite values, shape (K,)."""


FIRST_SAMPLES = 20_000
"""Number of samples from which the first brackets are computed."""

FIRST_NUMBERS = 8_000_000
"""Maximum number of values (8 bytes each) of these samples."""

DEVIATIONS = 6.0
"""Half-width of a first bracket, in standard deviations of the rank; one of 5e8 brackets does not contain its
quantile."""

BEYOND = 0.5
"""Extension of a bracket at the end of the first samples, as a fraction of their range."""

COUNTERS, MOST_BINS, LEAST_BINS = 4_000_000, 1024, 8
"""Number of counters (8 bytes each) of all brackets, and limits of the number of bins of a bracket."""

GATHERED = 2_000_000
"""Maximum number of values that are collected at once, with 8 bytes each and 8 bytes for their brackets."""

NOT_FINITE = "A sample with status 0 contains NaN or infinity; set a status other than 0."

CHANGED = "The samples changed between two passes. Do not modify them during the computation."

POOR = 4
"""Minimum factor by which linear bins should reduce the number of candidates.

If the reduction is smaller, the next bins count floating-point numbers.
"""


@typechecked
def quantiles_of_chunks(
    chunks: Iterable[ConsecutiveSamples],
    probabilities: Sequence[float] = DEFAULT_PROBABILITIES,
    *,
    independent: bool = True,
) -> dict[str, Array]:
    """Compute the quantiles and extremes of samples that can be iterated repeatedly, exactly, in bounded memory.

    The first samples bracket each quantile. A pass over all samples counts the samples below the brackets and in their
    bins. The next pass collects the samples in the bins that contain a quantile, or counts again if they are too many.

    Parameters
    ----------
    chunks : iterable
        Chunks that can be iterated repeatedly, such as `uqmbd.results.SampleStore.chunks`. Each has a `response` (K,
        ...) and `good` (K,). Every pass must give the same samples. The order of samples has no effect on the result,
        but a further pass may be necessary if the first samples differ from the others.
    probabilities : sequence of float
        Probabilities of the P quantiles, increasing, between 0 and 1.
    independent : bool
        Whether the samples are independent; otherwise they are the points of a design.

    Returns
    -------
    dict of str to numpy.ndarray
        ``quantile``, shape (P, ...), ``smallest`` and ``largest``, shape (...): bitwise equal to `sample_statistics` of
        all successful samples; and ``probability``. For independent samples, the result also contains
        ``quantile_interval``, shape (2, P, ...).

    Raises
    ------
    StudyError
        If fewer than two samples succeeded, or a successful sample is not finite. If the samples change between passes.

    Examples
    --------
    >>> import tempfile
    >>> from uqmbd.results import SampleStore
    >>> from uqmbd.extend import labels, sample_dataset
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
    check_counts(counts)
    below, part = ranks_of(levels, counts.count)
    ends = interval_ranks(counts.count, levels) if independent else np.empty((0, len(levels)), dtype=np.int64)
    ranks = np.stack([below, below + 1, *within_samples(ends, counts.count)])
    # ranks and brackets of the order statistics for the interpolation of quantiles and for the ends of their intervals
    rank = np.repeat(ranks.ravel(), columns)
    where = np.tile(np.arange(len(levels) * columns), len(ranks))
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
    low, high, *others = value.reshape(len(ranks), len(levels), columns)
    found = {
        "quantile": interpolated(low, high, part).reshape(-1, *shape),
        "smallest": counts.smallest.reshape(shape),
        "largest": counts.largest.reshape(shape),
        "probability": levels,
    }
    if independent:
        found["quantile_interval"] = with_open_ends(np.stack(others), ends, counts.count).reshape(2, -1, *shape)
    return found


@dataclass(frozen=True, eq=False)
class _Narrowed:
    """Brackets about single bins of parent brackets, or about all values below or above a parent bracket."""

    brackets: Brackets
    # parent, bin: (M,), index of the parent bracket and of its bin; the bin is -1 for values below the parent, and the
    # number of bins for values above
    parent: Index
    bin: Index
    # before, number: (M,), number of smaller samples, and number of samples in the bracket
    before: Index
    number: Index

    @property
    def starts(self) -> Index:
        """Index of the first value of each bracket among all gathered values."""
        return np.concatenate([[0], self.number.cumsum()[:-1]]) if len(self.number) else self.number

    def chosen(self, which: Index) -> _Narrowed:
        """Return selected brackets, in the same order."""
        rest = (x[which] for x in (self.parent, self.bin, self.before, self.number))
        return _Narrowed(self.brackets.chosen(which), *rest)


def _narrowed(counts: Counts, rank: Index, where: Index) -> tuple[_Narrowed, Index]:
    """Return brackets about the bins that contain order statistics, and the index of the bracket of each statistic.

    `rank`, `where`: rank of each order statistic, and index of its bracket in `counts`.
    """
    brackets, bins = counts.brackets, counts.brackets.bins
    cumulated = counts.inside.cumsum(axis=1)
    position = rank - counts.below[where]
    number = np.where(position < 0, -1, bin_of(cumulated, position, where))
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
    """Sort brackets into groups without repeated columns; return the order and the groups."""
    by_column = np.argsort(column, kind="stable")
    ascending = column[by_column]
    group = np.arange(len(column)) - np.searchsorted(ascending, ascending)
    order = np.lexsort((ascending, group))
    return by_column[order], group[order]


def _counted(chunks: Iterable[ConsecutiveSamples], brackets: Brackets, columns: int) -> Counts:
    counts = Counts(brackets, columns)
    for block in row_blocks(_good_rows(chunks)):
        counts.add(block)
    return counts


def _gathered(chunks: Iterable[ConsecutiveSamples], parents: Brackets, narrowed: _Narrowed) -> Array:
    """Return all values in the brackets, sorted within each bracket, one bracket after the other."""
    if not len(narrowed.number):
        return np.empty(0)
    # fill preallocated arrays: many small arrays between large ones would prevent the reuse of memory
    total = int(narrowed.number.sum())
    owner, values, count = np.empty(total, dtype=np.int64), np.empty(total), 0
    inner = (narrowed.bin >= 0) & (narrowed.bin < parents.bins)
    for block in row_blocks(_good_rows(chunks)):
        for which, x in narrowed.brackets.within(block):
            # a bracket about a bin is wider than the bin by a few last bits, so compare the bins of its values
            keep = ~inner[which]
            keep[~keep] = parents.index(narrowed.parent[which[~keep]], x[~keep]) == narrowed.bin[which[~keep]]
            which, x = which[keep], x[keep]
            if count + len(x) > total:
                raise StudyError(CHANGED)
            owner[count : count + len(x)], values[count : count + len(x)] = which, x
            count += len(x)
    if not np.array_equal(np.bincount(owner[:count], minlength=len(narrowed.number)), narrowed.number):
        raise StudyError(CHANGED)
    return values[np.lexsort((values, owner))]


def _first_samples(chunks: Iterable[ConsecutiveSamples]) -> tuple[Array, tuple[int, ...]]:
    """Return the first successful samples, at least one row, and the shape of a sample."""
    found, shape, count = list[Array](), None, 0
    for chunk in chunks:
        if not hasattr(chunk, "response") or not hasattr(chunk, "good"):
            raise StudyError(f"quantiles_of_chunks: a chunk is {shown(chunk)}; expected consecutive samples.")
        shape = chunk.response.shape[1:]
        rows = chunk.response[chunk.good].reshape(np.count_nonzero(chunk.good), prod(shape))
        most = first_rows(rows.shape[1])
        found.append(rows[: most - count])
        count += len(found[-1])
        if count == most:
            break
    if shape is None or not count:
        raise StudyError(too_few(0))
    return np.concatenate(found), shape


def _good_rows(chunks: Iterable[ConsecutiveSamples]) -> Iterator[Array]:
    for chunk in chunks:
        rows = chunk.response if chunk.good.all() else chunk.response[chunk.good]
        if len(rows):
            yield rows.reshape(len(rows), prod(rows.shape[1:]))


def first_rows(columns: int) -> int:
    """Return the number of samples for the first brackets."""
    return max(1, min(FIRST_SAMPLES, FIRST_NUMBERS // max(1, columns)))


def too_few(count: int) -> str:
    """Return the message for too few samples."""
    return f"Statistics need at least two successful samples; the number is {count}."


def check_counts(counts: Counts) -> None:
    """Raise StudyError if there are too few samples, or values that are not finite."""
    if counts.count < 2:
        raise StudyError(too_few(counts.count))
    # minima and maxima propagate NaN
    if not (np.isfinite(counts.smallest).all() and np.isfinite(counts.largest).all()):
        raise StudyError(NOT_FINITE)


def first_brackets(first: Array, levels: Array) -> Brackets:
    """Return a bracket about each quantile from the first samples, shape (S, C), S at least 1.

    The brackets of all columns for the first level come first.
    """
    count, columns = first.shape
    reach = DEVIATIONS * np.sqrt(count * levels * (1 - levels)) + 1
    ranks = np.array([np.floor(levels * (count - 1) - reach), np.ceil(levels * (count - 1) + reach)])
    places = np.clip(ranks, 0, count - 1).astype(np.int64)
    # search range beyond the first samples, if these are too few
    beyond = np.array([ranks[0] < 0, ranks[1] > count - 1]) * np.array([[-BEYOND], [BEYOND]])
    ends = np.empty((2, len(levels), columns))
    most = np.finfo(float).max
    for start in range(0, columns, width := max(1, 1_000_000 // count)):
        part = np.sort(first[:, start : start + width].T, axis=1)
        with np.errstate(over="ignore", invalid="ignore"):
            further = beyond[..., None] * np.minimum(part[:, -1] - part[:, 0], most)
            ends[:, :, start : start + width] = np.clip(part.T[places] + further, -most, most)
    number = len(levels) * columns
    column, level = np.tile(np.arange(columns), len(levels)), np.repeat(np.arange(len(levels)), columns)
    return Brackets(column, level, ends[0].ravel(), ends[1].ravel(), np.zeros(number, dtype=bool), bins_of(number))


def bins_of(brackets: int) -> int:
    """Return the number of bins of a bracket."""
    return int(np.clip(COUNTERS // max(brackets, 1), LEAST_BINS, MOST_BINS))


def bin_of(cumulated: Index, position: Index, where: Index) -> Index:
    """Return the bin that contains the sample at each `position` among the sorted samples of a bracket.

    `cumulated` (M, bins): cumulative counts of the bins; `where`: index of the bracket of each position. The result is
    the number of bins if no bin contains the position.
    """
    bins = cumulated.shape[1]
    # offsets make the concatenated rows ascending, so that one search finds all positions
    height = int(cumulated[:, -1].max(initial=0)) + 1
    rows = (cumulated + height * np.arange(len(cumulated))[:, None]).ravel()
    target = np.clip(position, 0, height - 1) + height * where
    found: Index = np.clip(np.searchsorted(rows, target, side="right") - bins * where, 0, bins)
    return found


def levels_of(probabilities: Sequence[float]) -> Array:
    """Return probabilities as an array, or raise a StudyError if they are invalid."""
    levels = np.array(probabilities, dtype=float)
    if levels.ndim != 1 or np.any(levels < 0) or np.any(levels > 1) or np.any(np.diff(levels) <= 0) or not levels.size:
        raise StudyError(f"The probabilities are {list(probabilities)}; expected increasing numbers between 0 and 1.")
    return levels


def ranks_of(levels: Array, count: int) -> tuple[Index, Array]:
    """Return the lower of the two ranks that enclose each quantile, and the interpolation fraction to the upper one."""
    position = levels * (count - 1)
    below = np.minimum(position.astype(np.int64), count - 2)
    return below, position - below


def interpolated(low: Array, high: Array, part: Array) -> Array:
    """Interpolate between two values, shape (P, ...), from the nearer end, so that both ends are exact."""
    part = part.reshape(-1, *[1] * (low.ndim - 1))
    step = high - low
    return np.where(part < 0.5, low + part * step, high - (1 - part) * step)
