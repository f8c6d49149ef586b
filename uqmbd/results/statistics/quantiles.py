"""Quantiles and extremes of more samples than are held at once, exactly, by passes over them."""

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
    """Consecutive samples, as `uqmbd.extend.Realisations` and the chunks of a `uqmbd.results.SampleStore` are."""

    @property
    def response(self) -> Array:
        """Responses, shape (K, ...)."""

    @property
    def good(self) -> Mask:
        """Successful samples with finite values, shape (K,)."""


FIRST_SAMPLES = 20_000
"""Samples from which the first brackets come."""

FIRST_NUMBERS = 8_000_000
"""Numbers (8 bytes each) of these at most."""

DEVIATIONS = 6.0
"""Half the width of a first bracket, in standard deviations of the rank: one in 5e8 misses its quantile."""

BEYOND = 0.5
"""Share of the range of the first samples by which a bracket at their end is extended."""

COUNTERS, MOST_BINS, LEAST_BINS = 4_000_000, 1024, 8
"""Counters (8 bytes each) of all brackets, and bins of each."""

GATHERED = 2_000_000
"""Most values that are gathered at once, with 8 bytes for each and as many for their brackets."""

NOT_FINITE = "A sample that counts as successful holds a NaN or an infinity; give it a status other than 0."

CHANGED = "Samples are others than on the pass before: something has written into them."

POOR = 4
"""If bins reduce the number of candidates by a smaller factor, the next ones are bins of floating-point numbers."""


@typechecked
def quantiles_of_chunks(
    chunks: Iterable[ConsecutiveSamples], probabilities: Sequence[float] = DEFAULT_PROBABILITIES
) -> dict[str, Array]:
    """Compute the quantiles and extremes of samples that can be iterated repeatedly, exactly, in bounded memory.

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
    """Brackets about a bin of other brackets, or about all values below or above them."""

    brackets: Brackets
    # parent, bin: (M,), of which bracket, and which of its bins: -1 for what is below, the number of bins for what is
    # above
    parent: Index
    bin: Index
    # before, number: (M,), samples that are smaller, and samples that are in it
    before: Index
    number: Index

    @property
    def starts(self) -> Index:
        """First value of each bracket among all gathered ones."""
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
    number = np.where(wanted < 0, -1, bin_of(cumulated, wanted, where))
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


def _counted(chunks: Iterable[ConsecutiveSamples], brackets: Brackets, columns: int) -> Counts:
    counts = Counts(brackets, columns)
    for block in row_blocks(_good_rows(chunks)):
        counts.add(block)
    return counts


def _gathered(chunks: Iterable[ConsecutiveSamples], parents: Brackets, narrowed: _Narrowed) -> Array:
    """Return all values in brackets, sorted in each, bracket after bracket."""
    if not len(narrowed.number):
        return np.empty(0)
    # in their places at once: many small arrays between large ones would keep memory from being used again
    total = int(narrowed.number.sum())
    owner, values, count = np.empty(total, dtype=np.int64), np.empty(total), 0
    inner = (narrowed.bin >= 0) & (narrowed.bin < parents.bins)
    for block in row_blocks(_good_rows(chunks)):
        for which, x in narrowed.brackets.within(block):
            # brackets of bins are wider by some last bits
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
    """Return the first samples that succeeded, at least one row, and the shape of a sample."""
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
    """Return how many samples the first brackets come from."""
    return max(1, min(FIRST_SAMPLES, FIRST_NUMBERS // max(1, columns)))


def too_few(count: int) -> str:
    """Return a message that there are too few samples."""
    return f"Statistics need at least two successful samples; there are {count}."


def check_counts(counts: Counts) -> None:
    """Raise if there are too few samples, or values that are not finite."""
    if counts.count < 2:
        raise StudyError(too_few(counts.count))
    # minima and maxima pass on what is not a number
    if not (np.isfinite(counts.smallest).all() and np.isfinite(counts.largest).all()):
        raise StudyError(NOT_FINITE)


def first_brackets(first: Array, levels: Array) -> Brackets:
    """Return a bracket about each quantile, level after level, from the first samples, shape (S, C), S at least 1."""
    count, columns = first.shape
    reach = DEVIATIONS * np.sqrt(count * levels * (1 - levels)) + 1
    ranks = np.array([np.floor(levels * (count - 1) - reach), np.ceil(levels * (count - 1) + reach)])
    places = np.clip(ranks, 0, count - 1).astype(np.int64)
    # how far beyond the first samples others are looked for, where these are too few to tell
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
    """Return how many bins brackets have."""
    return int(np.clip(COUNTERS // max(brackets, 1), LEAST_BINS, MOST_BINS))


def bin_of(cumulated: Index, wanted: Index, where: Index) -> Index:
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
