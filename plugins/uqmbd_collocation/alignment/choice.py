"""Choice of the alignment of an output at each time: near the smallest error, with few changes."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import uqmbd
from uqmbd.typing import Array, Mask

__all__ = ["Runs", "chosen_over_time", "runs_in_words", "taken_values"]

NEAR, REST = 1.25, 5e-4
"""A family is a candidate at a time if its error is at most `NEAR` times the smallest, plus `REST` of the largest
standard deviation. Few verification realisations cannot resolve smaller differences of errors."""

EQUAL = 1e-6
"""Errors below this multiple of the largest standard deviation of an output count as equal."""

Runs = Sequence[tuple[str, int, int]]
"""Families of an output in order of time, each with the index of its first time and the index after its last time."""


def chosen_over_time(
    given: uqmbd.extend.Verification,
    chaoses: Mapping[str, Any],
    errors: Mapping[str, Array],
    over: Mapping[Any, Array],
    output: int,
    scale: float,
) -> Runs:
    """Choose the family of each output at each time, with an error near the smallest and as few changes as possible.

    `errors` (O, T): errors at the verification realisations; `over` (O,): errors over all times, relative to `scale`,
    the largest standard deviation. An output changes its family at a time at which both families differ least at the
    verification realisations.
    """
    own = np.array([errors[name][output] for name in chaoses])
    least = own.min(axis=0)
    near = (own <= NEAR * least + REST * scale) | ~np.isfinite(least)
    # a single verification realisation is no reason to reject the family with the smallest error over all times
    least_of_all = int(np.argmin([max(float(over[name][output]), EQUAL) for name in chaoses]))
    near[least_of_all] |= _near_without_worst(given, chaoses, least_of_all, output, scale)
    always = [name for name, row in zip(chaoses, near, strict=True) if row.all()]
    if always:
        best = min(always, key=lambda name: max(float(over[name][output]), EQUAL))
        return [(best, 0, own.shape[1])]
    names, count = list(chaoses), own.shape[1]
    runs: list[tuple[int, int, int]] = []  # family, index of its first time, and index after its last time
    while not runs or runs[-1][2] < count:
        begin = runs[-1][2] if runs else 0
        # select the family that stays near the smallest error for longest; if several do, the one with the smallest
        # error
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


def _near_without_worst(
    given: uqmbd.extend.Verification, chaoses: Mapping[str, Any], best: int, output: int, scale: float
) -> Mask:
    """Return the times (T,), as a mask, at which a family is near the smallest error without its worst realisation.

    The worst verification realisation has the largest excess of the squared error over that of the other family.
    """
    points, right = given.points, given.response[:, output]
    values = [
        one.selected([output], range(right.shape[-1])).evaluate_germs(points.germs)[:, 0] for one in chaoses.values()
    ]
    squares = np.square(np.array(values) - right) * (points.weights / points.weights.sum())[:, None]
    found = np.ones(right.shape[-1], dtype=bool)
    for k, other in enumerate(squares):
        if k != best:
            excess = squares[best] - (NEAR**2) * other
            rest = excess.sum(axis=0) - excess.max(axis=0)
            # a family whose error is not finite is not better
            found &= ~np.isfinite(other).all(axis=0) | (rest <= (REST * scale) ** 2)
    return np.asarray(found & np.isfinite(squares[best]).all(axis=0))


def _difference(
    given: uqmbd.extend.Verification,
    chaoses: Mapping[str, Any],
    one: str,
    other: str,
    output: int,
    first: int,
    last: int,
) -> Array:
    """Return the root mean square difference (T,) of two families at verification realisations, for selected times."""
    times = range(first, min(last + 1, given.response.shape[-1]))
    values = [chaoses[name].selected([output], times).evaluate_germs(given.points.germs)[:, 0] for name in (one, other)]
    found = np.sqrt(np.mean((values[0] - values[1]) ** 2, axis=0))
    return np.where(np.isfinite(found), found, np.inf)


def taken_values(taken: Sequence[Runs], values: Mapping[str, Array]) -> Array:
    """Return values (O, T) of the selected families of outputs, from the values of all families."""
    found = np.empty((len(taken), next(iter(values.values())).shape[1]))
    for k, runs in enumerate(taken):
        for name, first, last in runs:
            found[k, first:last] = values[name][k, first:last]
    return found


def runs_in_words(runs: Runs, times: Array) -> str:
    """Return a text with the families of an output; each family after the first has its start time."""
    return ", ".join(f"{name} from {times[first]:.6g} s" if first else name for name, first, _ in runs)
