"""Samples as they come: moments of all, responses of the first ones, and a file for all where they are many."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

import uqmbd
from uqmbd.results import Moments, Violations, sample_file
from uqmbd.typing import Array

__all__ = ["Gathered", "gather"]


@dataclass(frozen=True)
class Gathered:
    """What is left of all samples.

    Attributes
    ----------
    count : int
        Samples that succeeded.
    replicates : tuple of uqmbd.results.Moments
        Of each replicate of the design, of the successful samples, shape (output, time).  None where there is one
        replicate and all of it is kept: its statistics are those of the kept samples.
    kept : uqmbd.Realisations
        The first samples.
    failures : int
        Of all samples.
    reason : str
        The most frequent reason of failure, or empty.
    file : str
        Name of the file that holds all samples, or empty.
    """

    count: int
    replicates: tuple[Moments, ...]
    kept: uqmbd.Realisations
    failures: int
    reason: str
    counters: dict[str, float]
    wall_time: float
    file: str
    violations: tuple[Violations, ...] = ()
    """Counts of each replicate, where requirements are to be answered."""

    @property
    def moments(self) -> Moments:
        """Moments of all successful samples, where those of replicates were gathered."""
        return reduce(Moments.merge, self.replicates)


def gather(
    problem: uqmbd.Problem,
    values: Array,
    sizes: list[int],
    keep: int,
    watch: Callable[[int, Array, NDArray[np.bool_]], None] | None = None,
) -> Gathered:
    """Compute samples chunk by chunk and gather them in their order, so that the bits depend on nothing else.

    Parameters
    ----------
    problem : uqmbd.Problem
        What to compute.
    values : array, shape (sample, input)
        The inputs, replicate after replicate.
    sizes : list of int
        Sizes of the replicates.
    keep : int
        Most samples whose responses are kept.
    watch : callable, optional
        Is told of each chunk: index of its first sample, responses, and which of them succeeded.
    """
    shape = problem.labels.shape
    edges = np.cumsum([0, *sizes])
    whole = len(values) <= keep
    replicates = [] if whole and len(sizes) == 1 else [Moments.of(np.zeros((0, *shape))) for _ in sizes]
    room = min(keep, len(values))
    response, status, messages = np.empty((room, *shape)), np.empty(room, dtype=np.int64), list[str]()
    counters: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    failures, censored, first, wall = 0, 0, 0, 0.0
    violations: list[Violations | None] = [None] * len(sizes)
    file = f"{problem.label}-samples.nc" if len(values) > keep and problem.folder else ""
    with ExitStack() as stack:
        store = None
        if file and problem.folder:
            store = stack.enter_context(sample_file(problem.folder / file, len(values), problem.labels))
        for part in problem.stream(values):
            last = first + len(part.status)
            # what is not finite is a failure like any other: it must not enter a sum
            fine = part.good
            failures += int(np.count_nonzero(~fine)) - part.censored
            censored += part.censored
            for r in range(int(np.searchsorted(edges, first, side="right")) - 1, len(sizes)):
                low, high = max(first, edges[r]) - first, min(last, edges[r + 1]) - first
                if low >= high:
                    break
                if replicates:
                    replicates[r] = replicates[r].merge(Moments.of(part.response[low:high][fine[low:high]]))
                if problem.answers_requirements and part.margins is not None:
                    more = Violations.of(part.margins.running[low:high], part.margins.failed[low:high])
                    before = violations[r]
                    violations[r] = more if before is None else before + more
            if watch is not None:
                watch(first, part.response, fine)
            if store is not None:
                store.write(first, part.values, part.response, part.status, part.messages)
            if reason := part.most_frequent_reason():
                reasons[reason] += part.failures
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
    kept = uqmbd.Realisations(values[:room], response, status, tuple(messages), {}, 0.0)
    counted = tuple(one for one in violations if one is not None)
    return Gathered(
        first - failures - censored, tuple(replicates), kept, failures, reason, dict(counters), wall, file, counted
    )
