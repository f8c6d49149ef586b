"""Choice of the alignment of an output at each time: near the least error, with few changes."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import uqmbd
from uqmbd.typing import Array

__all__ = ["Runs", "chosen_over_time", "runs_in_words", "taken_values"]

NEAR, REST = 1.25, 9e-4
"""A family is a candidate at a time if its error is at most `NEAR` times the least, plus `REST` of the largest standard
deviation: errors from few verification realisations that differ by less are not distinguished."""

EQUAL = 1e-6
"""Error, over the largest standard deviation of an output, below which none is better than another."""

Runs = Sequence[tuple[str, int, int]]
"""Families that an output takes, in the order of time, each with the numbers of its first time and of that behind."""


def chosen_over_time(
    given: uqmbd.extend.Verification,
    chaoses: Mapping[str, Any],
    errors: Mapping[str, Array],
    over: Mapping[Any, Array],
    output: int,
    scale: float,
) -> Runs:
    """Choose families of an output over time: near the least error at every time, with as few changes as that permits.

    `errors` (O, T) at the verification realisations; `over` (O,): over time, relative to `scale`, the largest standard
    deviation. A change is where both families differ least at the verification realisations.
    """
    own = np.array([errors[name][output] for name in chaoses])
    least = own.min(axis=0)
    near = (own <= NEAR * least + REST * scale) | ~np.isfinite(least)
    always = [name for name, row in zip(chaoses, near, strict=True) if row.all()]
    if always:
        best = min(always, key=lambda name: max(float(over[name][output]), EQUAL))
        return [(best, 0, own.shape[1])]
    names, count = list(chaoses), own.shape[1]
    runs: list[tuple[int, int, int]] = []  # a family, its first time, and that behind its last
    while not runs or runs[-1][2] < count:
        begin = runs[-1][2] if runs else 0
        # the family that is near the least error for longest; of several that with the least error
        ends = [begin + int(np.argmin(np.append(row[begin:], False))) for row in near]
        k = max(range(len(names)), key=lambda n: (ends[n], -float(np.sum(own[n, begin : ends[n]] ** 2))))
        runs.append((k, begin, ends[k]))
    found: list[tuple[str, int, int]] = []
    first = 0
    for (k, _, end), (after, _, _) in itertools.pairwise([*runs, (-1, count, count)]):
        change = end
        if after >= 0:
            earliest = max(first + 1, end - int(np.argmin(np.append(near[after, :end][::-1], False))))
            change = earliest + int(
                np.argmin(_difference(given, chaoses, names[k], names[after], output, earliest, end))
            )
        found.append((names[k], first, change))
        first = change
    return found


def _difference(
    given: uqmbd.extend.Verification,
    chaoses: Mapping[str, Any],
    one: str,
    other: str,
    output: int,
    first: int,
    last: int,
) -> Array:
    """Return the root mean square difference (T,) of two families at the verification realisations, over some times."""
    times = range(first, min(last + 1, given.response.shape[-1]))
    values = [chaoses[name].selected([output], times).evaluate_germs(given.points.germs)[:, 0] for name in (one, other)]
    found = np.sqrt(np.mean((values[0] - values[1]) ** 2, axis=0))
    return np.where(np.isfinite(found), found, np.inf)


def taken_values(taken: Sequence[Runs], values: Mapping[str, Array]) -> Array:
    """Return values (O, T) of the families that outputs take, from those of all families."""
    found = np.empty((len(taken), next(iter(values.values())).shape[1]))
    for k, runs in enumerate(taken):
        for name, first, last in runs:
            found[k, first:last] = values[name][k, first:last]
    return found


def runs_in_words(runs: Runs, times: Array) -> str:
    """Name the families of an output, each but the first with its first time."""
    return ", ".join(f"{name} from {times[first]:.6g} s" if first else name for name, first, _ in runs)
