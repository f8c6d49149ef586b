"""Sampling in replicates of a design, with moments of all samples, and responses of the first samples."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import uqmbd
from uqmbd.extend import Moments, Violations
from uqmbd.results import SampleStore
from uqmbd.typing import Array, Index, Mask

__all__ = [
    "Gathered",
    "WorstRealisations",
    "allowed_pairs",
    "allowed_samples",
    "chunk_sums",
    "gather",
    "paired_samples",
    "replicate_sizes",
    "uniform_samples",
    "violations_dataset",
]


def replicate_sizes(design: str, samples: int, replicates: int) -> list[int]:
    """Return the sizes of the replicates of a sampling design; a design of independent points has one replicate.

    Raise StudyError for an unknown design, too few samples, or sizes for which the design is not balanced.
    """
    found = uqmbd.extend.sampling_design(design, "MonteCarlo: sampling")
    if found.independent:
        return [samples]
    if samples < 2 * replicates:
        raise uqmbd.StudyError(
            f"MonteCarlo: {samples} samples are too few for {replicates} replicates of the design {design!r}; use at "
            f"least {2 * replicates} samples, or fewer replicates."
        )
    if found.base > 1:
        power = found.base
        while power * found.base * replicates <= samples:
            power *= found.base
        if power * replicates != samples:
            below = replicates * power
            raise uqmbd.StudyError(
                f"MonteCarlo: the design {design!r} in {replicates} replicates needs {replicates} times a power of "
                f"{'two' if found.base == 2 else found.base} samples, but samples is {samples}. Use {below} or "
                f"{found.base * below}."
            )
    return [len(part) for part in np.array_split(np.arange(samples), replicates)]


def allowed_samples(design: str, samples: int, replicates: int) -> int:
    """Return the largest number of samples up to `samples` that the design allows in replicates.

    If all allowed numbers are larger, return the smallest one.

    >>> allowed_samples("sobol", 1500, 16), allowed_samples("latin-hypercube", 1500, 16)
    (1024, 1500)
    """
    found = uqmbd.extend.sampling_design(design, "MonteCarlo: sampling")
    if found.independent:
        return max(samples, 2)
    if found.base < 2:
        return max(samples, 2 * replicates)
    power = found.base
    while power * found.base * replicates <= samples:
        power *= found.base
    return power * replicates


def allowed_pairs(design: str, samples: int, replicates: int) -> int:
    """Return the largest number of samples up to `samples` that are pairs of a design in equal replicates.

    >>> allowed_pairs("random", 1501, 16), allowed_pairs("sobol", 1501, 16), allowed_pairs("halton", 1501, 16)
    (1500, 1024, 1472)
    """
    if uqmbd.extend.sampling_design(design, "MonteCarlo: sampling").independent:
        return max(samples // 2 * 2, 4)
    return 2 * (allowed_samples(design, samples // 2, replicates) // replicates * replicates)


def paired_samples(design: str, samples: int, replicates: int, dimension: int, seed: int) -> tuple[Array, Index, Index]:
    """Return pairs of samples: the two halves of the coordinates of design points in twice as many dimensions.

    Return uniform numbers (samples, dimension) in the open interval, and the indices (samples / 2,) of first and second
    halves. Each replicate contains the first halves of its pairs, then the second halves. For independent points, these
    are the first and the second half of the samples. `samples` must be a number that `allowed_pairs` returns. The same
    seed gives the same bits.
    """
    count = samples // 2
    if uqmbd.extend.sampling_design(design).independent:
        return uniform_samples(design, [samples], dimension, seed), np.arange(count), count + np.arange(count)
    sizes = replicate_sizes(design, count, replicates)
    points = uniform_samples(design, sizes, 2 * dimension, seed)
    places = np.arange(samples).reshape(replicates, 2, count // replicates)
    first, second = places[:, 0].ravel(), places[:, 1].ravel()
    uniform = np.empty((samples, dimension))
    uniform[first], uniform[second] = points[:, :dimension], points[:, dimension:]
    return uniform, first, second


def uniform_samples(design: str, sizes: list[int], dimension: int, seed: int) -> Array:
    """Return uniform numbers in the open interval, shape (sum of sizes, dimension).

    The rows are independent replicates of the design, one after another. The same seed gives the same bits.
    """
    found = uqmbd.extend.sampling_design(design)
    streams = np.random.SeedSequence(seed).spawn(len(sizes))
    return np.concatenate([found.points(dimension, n, one) for n, one in zip(sizes, streams, strict=True)])


SUMS = ("mean", "second", "third", "fourth")
"""Sums from which moments are computed, in addition to the number of samples."""


@dataclass(frozen=True)
class WorstRealisations:
    """Successful realisations with the smallest margin of each requirement; a margin of infinity if there is none."""

    margins: Array  # (requirement,), in the units of the requirement
    inputs: Array  # (requirement, input)
    frames: Index  # (requirement,), the index of the first output time at or after the smallest margin

    @classmethod
    def of(cls, running: Array, failed: Mask, values: Array) -> WorstRealisations:
        """Return the worst realisations from running margins (K, requirement, T) and inputs (K, input).

        >>> running = np.array([[[1.0, 0.5, 0.5]], [[2.0, -1.0, -1.0]], [[-9.0, -9.0, -9.0]]])
        >>> found = WorstRealisations.of(running, np.array([False, False, True]), np.array([[1.0], [2.0], [3.0]]))
        >>> found.margins.tolist(), found.inputs.tolist(), found.frames.tolist()
        ([-1.0], [[2.0]], [1])
        """
        ends = np.where(failed[:, None] | np.isnan(running[:, :, -1]), np.inf, running[:, :, -1])
        rows, columns = ends.argmin(axis=0), np.arange(ends.shape[1])
        frames = (running[rows, columns] <= ends[rows, columns][:, None]).argmax(axis=1)
        return cls(ends[rows, columns], values[rows], frames)

    def or_worse(self, other: WorstRealisations) -> WorstRealisations:
        """Return the realisations with the smaller margins; equal margins keep the first realisation."""
        less = other.margins < self.margins
        return WorstRealisations(
            np.where(less, other.margins, self.margins),
            np.where(less[:, None], other.inputs, self.inputs),
            np.where(less, other.frames, self.frames),
        )


@dataclass(frozen=True)
class Gathered:
    """Sums over all samples, and the stored samples."""

    count: int  # number of successful samples
    replicates: tuple[Moments, ...]
    """Moments of the successful samples of each replicate, (output, time); None for a single replicate that is stored
    entirely."""
    kept: uqmbd.extend.Realisations  # the first samples
    failures: int  # number of failures among all samples
    reason: str  # most frequent reason of failure; an empty text if none failed
    counters: dict[str, float]
    wall_time: float
    store: SampleStore | None  # all samples, if `kept` does not contain all and the run has a folder
    violations: tuple[Violations, ...] = ()
    """Counts of violations in each replicate, if requirements are evaluated."""
    worst: WorstRealisations | None = None
    """Realisations with the smallest margins, if requirements are evaluated."""

    @property
    def moments(self) -> Moments:
        """Moments of all successful samples, if replicates have moments."""
        return reduce(Moments.merge, self.replicates)


def gather(
    problem: uqmbd.extend.Problem,
    values: Array,
    sizes: list[int],
    keep: int,
    watch: Callable[[int, Array, NDArray[np.bool_]], None] | None = None,
) -> Gathered:
    """Compute samples in chunks and sum them in order, so that the bits depend only on the samples.

    `values` (sample, input): inputs, replicate after replicate, of the given `sizes`; at most `keep` responses are
    stored. `watch`: function that receives, for each chunk, the index of its first sample, the responses, and the mask
    of successful samples.
    """
    shape = problem.labels.shape
    edges = (*np.cumsum([0, *sizes[:-1]]).tolist(), sys.maxsize)  # equal for a run that is extended by more samples
    whole = len(values) <= keep
    counted = problem.answers_requirements and bool(problem.requirements)
    gathered = _Sums(shape, len(sizes), moments=not whole or len(sizes) > 1, violations=counted)
    room = min(keep, len(values))
    response, status, messages = np.empty((room, *shape)), np.empty(room, dtype=np.int64), list[str]()
    counters: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    failures, censored, first, wall = 0, 0, 0, 0.0
    handed = len(values) if watch is not None else room
    request = (edges, gathered.moments, counted)
    streamed = None if whole else problem.reduce(values, chunk_sums, request, keep=handed)
    for part in _stored_entirely(problem, values, request) if streamed is None else streamed:
        last = first + len(part.status)
        gathered.add(part.result)
        if watch is not None:
            watch(first, part.response, part.good)
        if not part.good.all():
            # an output that is not finite counts as a failure, because it must not enter a sum
            failures += int(np.count_nonzero(~part.good)) - part.censored
            censored += part.censored
            if reason := part.realisations.most_frequent_reason():
                reasons[reason] += part.realisations.failures
        if first < room:
            # write directly to the result, so that the responses of all samples are in memory only once
            taken = min(last, room) - first
            response[first : first + taken] = part.response[:taken]
            status[first : first + taken] = part.status[:taken]
            messages += part.messages[:taken]
        counters.update(part.counters)
        wall += part.wall_time
        first = last
    reason = reasons.most_common(1)[0][0] if reasons else ""
    kept = uqmbd.extend.Realisations(values[:room], response, status, tuple(messages), {}, 0.0)
    return Gathered(
        first - failures - censored,
        tuple(gathered.replicates),
        kept,
        failures,
        reason,
        dict(counters),
        wall,
        None if streamed is None else streamed.store,
        tuple(one for one in gathered.violations if one is not None),
        gathered.worst,
    )


def _stored_entirely(
    problem: uqmbd.extend.Problem, values: Array, request: tuple[Any, ...]
) -> Iterator[uqmbd.extend.Reduced]:
    """Compute samples that are all stored."""
    first = 0
    for part in problem.stream(values):
        about = (part.status, part.messages, part.good, part.response, part.counters, part.wall_time)
        yield uqmbd.extend.Reduced(first, part.values, chunk_sums(part, first, *request), *about)
        first += len(part.status)


class _Sums:
    """Moments of replicates, and numbers of violated requirements, summed over chunks in order."""

    def __init__(self, shape: tuple[int, ...], count: int, *, moments: bool, violations: bool) -> None:
        self.moments = moments
        self.replicates = [Moments.of(np.zeros((0, *shape)))] * count if moments else []
        self.violations: list[Violations | None] = [None] * count
        self.worst: WorstRealisations | None = None

    def add(self, result: dict[str, NDArray[Any]]) -> None:
        """Add the result of `chunk_sums` for a chunk."""
        for k, r in enumerate(result["replicate"].tolist()):
            if self.moments:
                moments = Moments(int(result["count"][k]), *(result[name][k] for name in SUMS))
                self.replicates[r] = self.replicates[r].merge(moments)
            if "by_time" in result:
                more = Violations(result["by_time"][k], int(result["total"][k]), int(result["failed"][k]))
                before = self.violations[r]
                self.violations[r] = more if before is None else before + more
        if "worst_margin" in result:
            one = WorstRealisations(result["worst_margin"], result["worst_inputs"], result["worst_frame"])
            self.worst = one if self.worst is None else self.worst.or_worse(one)


def chunk_sums(
    part: uqmbd.extend.Realisations, first: int, edges: tuple[int, ...], moments: bool, violations: bool
) -> dict[str, NDArray[Any]]:
    """Return the sums over a chunk of samples, in a worker; `first` is the index of its first sample.

    `edges`: index of the first sample of each replicate, then the end of the last replicate or a larger number. The
    result contains ``replicate`` (R,), the replicates with samples in the chunk. Further entries (R, ...) are
    ``count``, ``mean``, ``second``, ``third`` and ``fourth`` of `uqmbd.extend.Moments`, and ``by_time``, ``total`` and
    ``failed`` of `uqmbd.extend.Violations`. The fields of `WorstRealisations` are ``worst_margin``, ``worst_inputs``
    and ``worst_frame``.
    """
    last, fine = first + len(part.status), part.good
    touched = [r for r in range(len(edges) - 1) if max(first, edges[r]) < min(last, edges[r + 1])]
    slices = [slice(max(first, edges[r]) - first, min(last, edges[r + 1]) - first) for r in touched]
    found: dict[str, NDArray[Any]] = {"replicate": np.array(touched)}
    if moments:
        sums = [Moments.of(part.response[rows][fine[rows]]) for rows in slices]
        found["count"] = np.array([one.count for one in sums])
        found |= {name: np.stack([getattr(one, name) for one in sums]) for name in SUMS}
    if violations and part.margins is not None:
        counts = [Violations.of(part.margins.running[rows], part.margins.failed[rows]) for rows in slices]
        found["by_time"] = np.stack([one.by_time for one in counts])
        found["total"] = np.array([one.total for one in counts])
        found["failed"] = np.array([one.failed for one in counts])
        worst = WorstRealisations.of(part.margins.running, part.margins.failed, part.values)
        found |= {"worst_margin": worst.margins, "worst_inputs": worst.inputs, "worst_frame": worst.frames}
    return found


def violations_dataset(found: Gathered, problem: uqmbd.extend.Problem) -> xr.Dataset:
    """Return the dataset ``requirements`` with the realisation with the smallest margin of each requirement.

    The row ``any`` has no margin.
    """
    times = np.asarray(problem.times if problem.over is None else problem.over, dtype=float)
    counted, worst = Violations.dataset(problem.requirements, found.violations, times), found.worst
    if worst is None:
        return counted
    over_time = np.array([one.over_time for one in problem.requirements])
    known = np.isfinite(worst.margins)
    stored = {
        "worst_margin": np.where(known, worst.margins, np.nan),
        "worst_inputs": np.where(known[:, None], worst.inputs, np.nan),
        "worst_time": np.where(known, times[np.where(over_time, worst.frames, -1)], np.nan),
    }
    about = {
        "worst_margin": {"long_name": "smallest margin", "comment": "in the requirement's units"},
        "worst_inputs": {"long_name": "inputs with the smallest margin", "comment": "in the inputs' units"},
        "worst_time": {
            "long_name": "first output time at or after the smallest margin",
            "units": "s",
            "comment": "for requirements that are not over time: the last output time",
        },
    }
    rows = counted.sizes["requirement"] - len(known)
    data = {}
    for name, values in stored.items():
        dims = ("requirement", "input")[: values.ndim]
        padded = np.concatenate([values, np.full((rows, *values.shape[1:]), np.nan)])
        data[name] = (dims, padded, about[name])
    return counted.assign(data).assign_coords(input=[one.name for one in problem.labels.inputs])
