"""Samples as they come: moments of all, responses of the first ones, and a file for all where they are many."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import uqmbd
from uqmbd.results import Moments, sample_file
from uqmbd.typing import Array

__all__ = ["Gathered", "gather"]


@dataclass(frozen=True)
class Gathered:
    """What is left of all samples.

    Attributes
    ----------
    moments : uqmbd.results.Moments
        Of all successful samples, shape (output, time).
    replicates : tuple of uqmbd.results.Moments
        Of each replicate of the design.
    kept : uqmbd.Realisations
        The first samples.
    failures : int
        Of all samples.
    reason : str
        The most frequent reason of failure, or empty.
    file : str
        Name of the file that holds all samples, or empty.
    """

    moments: Moments
    replicates: tuple[Moments, ...]
    kept: uqmbd.Realisations
    failures: int
    reason: str
    counters: dict[str, float]
    wall_time: float
    file: str


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
    replicates = [Moments.of(np.zeros((0, *shape))) for _ in sizes]
    kept: list[uqmbd.Realisations] = []
    counters: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    failures, first, wall = 0, 0, 0.0
    file = f"{problem.label}-samples.nc" if len(values) > keep and problem.folder else ""
    with ExitStack() as stack:
        store = None
        if file and problem.folder:
            store = stack.enter_context(sample_file(problem.folder / file, len(values), problem.labels))
        for part in problem.stream(values):
            last = first + len(part.status)
            # what is not finite is a failure like any other: it must not enter a sum
            fine = part.good
            failures += int(np.count_nonzero(~fine))
            for r in range(int(np.searchsorted(edges, first, side="right")) - 1, len(sizes)):
                low, high = max(first, edges[r]) - first, min(last, edges[r + 1]) - first
                if low >= high:
                    break
                replicates[r] = replicates[r].merge(Moments.of(part.response[low:high][fine[low:high]]))
            if watch is not None:
                watch(first, part.response, fine)
            if store is not None:
                store.write(first, part.values, part.response, part.status, part.messages)
            if reason := part.most_frequent_reason():
                reasons[reason] += part.failures
            if first < keep:
                kept.append(part)
            counters.update(part.counters)
            wall += part.wall_time
            first = last
    total = replicates[0]
    for replicate in replicates[1:]:
        total = total.merge(replicate)
    reason = reasons.most_common(1)[0][0] if reasons else ""
    return Gathered(total, tuple(replicates), _joined(kept, keep), failures, reason, dict(counters), wall, file)


def _joined(parts: list[uqmbd.Realisations], keep: int) -> uqmbd.Realisations:
    return uqmbd.Realisations(
        np.concatenate([p.values for p in parts])[:keep],
        np.concatenate([p.response for p in parts])[:keep],
        np.concatenate([p.status for p in parts])[:keep],
        tuple(m for p in parts for m in p.messages)[:keep],
        {},
        0.0,
    )
