"""Samples as they come: moments of all, responses of the first ones, and a store of all where they are many."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

import uqmbd
from uqmbd.extend import Moments, Violations
from uqmbd.results import SampleStore
from uqmbd.typing import Array

__all__ = ["Gathered", "gather", "reduced"]

SUMS = ("mean", "second", "third", "fourth")
"""Sums that moments consist of, besides their number."""


@dataclass(frozen=True)
class Gathered:
    """Sums over all samples, and the samples that are stored."""

    count: int  # samples that succeeded
    replicates: tuple[Moments, ...]
    """Moments of the successful samples of each replicate, (output, time); None if a single replicate is stored
    entirely."""
    kept: uqmbd.extend.Realisations  # the first samples
    failures: int  # of all samples
    reason: str  # the most frequent reason of failure, or empty
    counters: dict[str, float]
    wall_time: float
    store: SampleStore | None  # all samples, where there are more than `kept` holds and the run has a folder
    violations: tuple[Violations, ...] = ()
    """Counts of each replicate, where requirements are to be answered."""

    @property
    def moments(self) -> Moments:
        """Moments of all successful samples, where those of replicates were gathered."""
        return reduce(Moments.merge, self.replicates)


def gather(
    problem: uqmbd.extend.Problem,
    values: Array,
    sizes: list[int],
    keep: int,
    watch: Callable[[int, Array, NDArray[np.bool_]], None] | None = None,
) -> Gathered:
    """Compute samples in chunks and add them up in order, so that the bits depend on nothing else.

    `values` (sample, input) are replicate after replicate, of the given `sizes`; at most `keep` responses are stored.
    `watch` receives for each chunk the index of its first sample, the responses, and which of them succeeded.
    """
    shape = problem.labels.shape
    edges = (*np.cumsum([0, *sizes[:-1]]).tolist(), sys.maxsize)  # more samples are asked for alike
    whole = len(values) <= keep
    counted = problem.answers_requirements and bool(problem.requirements)
    gathered = _Sums(shape, len(sizes), moments=not whole or len(sizes) > 1, violations=counted)
    room = min(keep, len(values))
    response, status, messages = np.empty((room, *shape)), np.empty(room, dtype=np.int64), list[str]()
    counters: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    failures, censored, first, wall = 0, 0, 0, 0.0
    handed = len(values) if watch is not None else room
    asked = (edges, gathered.moments, counted)
    streamed = None if whole else problem.reduce(values, reduced, asked, keep=handed)
    for part in _reduced_here(problem, values, asked) if streamed is None else streamed:
        last = first + len(part.status)
        gathered.add(part.result)
        if watch is not None:
            watch(first, part.response, part.good)
        if not part.good.all():
            # what is not finite is a failure like any other: it must not enter a sum
            failures += int(np.count_nonzero(~part.good)) - part.censored
            censored += part.censored
            if reason := part.realisations.most_frequent_reason():
                reasons[reason] += part.realisations.failures
        if first < room:
            # into its place: the responses of all samples are not held twice
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
    )


def _reduced_here(
    problem: uqmbd.extend.Problem, values: Array, asked: tuple[Any, ...]
) -> Iterator[uqmbd.extend.Reduced]:
    """Compute samples that are all stored."""
    first = 0
    for part in problem.stream(values):
        about = (part.status, part.messages, part.good, part.response, part.counters, part.wall_time)
        yield uqmbd.extend.Reduced(first, part.values, reduced(part, first, *asked), *about)
        first += len(part.status)


class _Sums:
    """Moments of replicates, and how often requirements are violated, of chunks in their order."""

    def __init__(self, shape: tuple[int, ...], count: int, *, moments: bool, violations: bool) -> None:
        self.moments = moments
        self.replicates = [Moments.of(np.zeros((0, *shape)))] * count if moments else []
        self.violations: list[Violations | None] = [None] * count

    def add(self, result: dict[str, NDArray[Any]]) -> None:
        """Add the result of `reduced` for a chunk."""
        for k, r in enumerate(result["replicate"].tolist()):
            if self.moments:
                one = Moments(int(result["count"][k]), *(result[name][k] for name in SUMS))
                self.replicates[r] = self.replicates[r].merge(one)
            if "by_time" in result:
                more = Violations(result["by_time"][k], int(result["total"][k]), int(result["failed"][k]))
                before = self.violations[r]
                self.violations[r] = more if before is None else before + more


def reduced(
    part: uqmbd.extend.Realisations, first: int, edges: tuple[int, ...], moments: bool, violations: bool
) -> dict[str, NDArray[Any]]:
    """Sum up a chunk of samples in a worker; `first` is the index of its first sample.

    `edges` are the starts of the replicates and the end of the last one, or a larger number. The result holds
    ``replicate`` (R,), those with samples in the chunk; ``count``, ``mean``, ``second``, ``third`` and ``fourth`` (R,
    ...) of `uqmbd.extend.Moments`; ``by_time``, ``total`` and ``failed`` (R, ...) of `uqmbd.extend.Violations`.
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
    return found
