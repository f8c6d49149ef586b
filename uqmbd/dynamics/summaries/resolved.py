"""Resolve expressions along a motion by polynomials on parts of steps, and divide inaccurate parts.

A step of an integrator is long: an output of the states may have a peak or a kink within it. An expression
is therefore evaluated at interpolated states, at eight Chebyshev points of a part of a step. If the part can change the
result, it is divided until the last coefficients of its polynomial are small. The parts of all realisations are
evaluated together; each is divided by its own errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqmbd.compiled import PLACES, SERIES, FittedPolynomials, Need, PartTable, StepHistory
from uqmbd.dynamics.equations import OutputMap
from uqmbd.dynamics.summaries.motion import SteppedMotion
from uqmbd.typing import Array, Index

__all__ = ["SHARE", "StepParts", "TimedOutputs", "part_table", "resolve_outputs", "values_at"]


SHARE = 0.02
"""Allowed error of a polynomial, relative to the tolerance of the integration; at least `ROUNDING`."""

ROUNDING = 2e-12
"""Least allowed error of a polynomial, relative to the largest value."""

SHY = 1e-6
"""Distance of a division before the time from which an output is not finite and real, relative to the part."""

SURPRISE = 0.3
"""Share of the last four coefficients of a polynomial by which values between its points may deviate. Smooth outputs
stay below, and a peak at only one point exceeds it."""

ROUGH = 6
"""Number of divisions after which a part may be accepted without further improvement, as in ``parts.c``."""

FINEST = 1 / 4096
"""Share of the whole time within which an output of time alone is sampled at eight points: the steps of an integrator
do not show its rate."""

LONGEST = 1 / 64
"""Longest part, relative to the whole time, so that its points detect short changes of an output."""


SLOW = 4 / LONGEST
"""Rate times whole time up to which an output of time alone is not sampled. No part then exceeds four radians, which
the coefficients of its polynomial resolve."""

VALUES_AT_ONCE = 1 << 18
"""Number of values in one evaluation, which limits the memory."""


@dataclass(frozen=True)
class TimedOutputs:
    """Outputs of time and inputs alone, whose rate of change does not depend on the state."""

    outputs: OutputMap
    rates: OutputMap | None  # bounds on rates of change, rad/s, from inputs only; None: unknown


def values_at(coefficients: Array, places: Array) -> Array:
    """Return values (E,) of Chebyshev series (E, 8) at places (E,), by Clenshaw's recurrence."""
    one, two = np.zeros(len(places)), np.zeros(len(places))
    for k in range(coefficients.shape[1] - 1, 0, -1):
        one, two = coefficients[:, k] + 2 * places * one - two, one
    return np.asarray(coefficients[:, 0] + places * one - two)


@dataclass(frozen=True)
class StepParts:
    """Parts of the steps of a motion, in order, with values of outputs."""

    table: PartTable  # data of the parts; the same table is used for later parts

    @cached_property
    def order(self) -> Index:
        """Numbers of the parts in the table, shape (E,)."""
        return self.table.order

    @cached_property
    def owner(self) -> Index:
        """Realisation of each part, shape (E,), ascending."""
        return self.table.course.owner[self.table.step[self.order]]

    @cached_property
    def deep(self) -> Index:
        """Numbers of parts after many divisions, which may have been accepted unresolved."""
        return np.flatnonzero(self.table.depth[self.order] > ROUGH)

    @cached_property
    def unknown(self) -> Index:
        """Numbers of the parts in which any output is not finite."""
        wrong = np.asarray(np.isnan(self.table.highest[: self.table.count]).any(axis=1))
        return np.flatnonzero(wrong[self.order]) if wrong.any() else np.zeros(0, dtype=np.int64)

    @cached_property
    def begin(self) -> Array:
        """Begin of each part, s."""
        return self.table.begin[self.order]

    @cached_property
    def end(self) -> Array:
        """End of each part, s."""
        return self.table.end[self.order]

    @cached_property
    def first(self) -> Index:
        """First part of each realisation with parts, shape (R,)."""
        return np.flatnonzero(np.diff(self.owner, prepend=-1))

    @cached_property
    def number(self) -> Index:
        """Index of the realisation of each part, among realisations with parts, shape (E,)."""
        return np.cumsum(np.diff(self.owner, prepend=self.owner[:1]) != 0)

    def of(self, name: str, column: int, which: Index | slice = slice(None)) -> Array:
        """Return data of one output in the selected parts, by its name in the table."""
        found: Array = getattr(self.table, name)[self.order[which], column]
        return found

    def fitted(self, column: int) -> FittedPolynomials:
        """Return the polynomials of one output."""
        table = self.table
        return FittedPolynomials(column, self.order, table.begin, table.end, table.values, table.coefficients)

    def time(self, which: Index, places: Array) -> Array:
        """Return the times in s of places from -1 to 1 in the selected parts."""
        return self.begin[which] + 0.5 * (1 + places) * (self.end[which] - self.begin[which])


def part_table(outputs: OutputMap, rtol: float, needs: Sequence[Need]) -> PartTable:
    """Return a table for resolved parts of outputs, with the relative tolerance of the integration."""
    return PartTable(len(outputs.names), needs, max(SHARE * rtol, ROUNDING))


def resolve_outputs(
    motion: SteppedMotion,
    outputs: OutputMap,
    table: PartTable,
    timed: TimedOutputs | None = None,
    since: Array | None = None,
) -> StepParts:
    """Resolve outputs along a motion as far as required; the previous content of the table is lost.

    `timed` are the outputs of time and inputs only.  From the times `since` (R,) in s on, an output is not finite and
    real (infinite: never). Parts begin at these times, because values that are not finite are not divided.
    """
    begun = _initial_parts(motion.course)
    if timed is not None:
        begun = _divide_timed(motion, timed, *begun, table.share)
    if since is not None and (since < np.inf).any():
        begun = _cut(motion.course, *begun, since)
    table.begin_with(motion.course, *begun)
    with np.errstate(invalid="ignore"):
        while table.refine(motion.observed(outputs, *table.new)):
            pass
    return StepParts(table)


def _initial_parts(course: StepHistory) -> tuple[Index, Array, Array]:
    """Divide long steps evenly; return the step, begin and end of each part."""
    length, turns = course.end - course.begin, np.flatnonzero(np.diff(course.owner, prepend=-1))
    whole = np.add.reduceat(length, turns)[np.cumsum(np.diff(course.owner, prepend=course.owner[:1]) != 0)]
    share = length / np.where(whole > 0, whole, 1.0)
    # persistent contacts are interpolated over whole steps
    counts = np.where(course.kept, 1, np.maximum(1, np.ceil(share / LONGEST - 1e-9))).astype(np.int64)
    extent = course.last - course.begin
    reached = np.where(extent > 0, length / np.where(extent > 0, extent, 1.0), 1.0)
    step = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(len(step)) - np.repeat(np.cumsum(counts) - counts, counts)
    reach, of = reached[step], counts[step]
    return step, reach * number / of, np.where(number + 1 == of, reach, reach * (number + 1) / of)


def _divide_timed(
    motion: SteppedMotion, timed: TimedOutputs, step: Index, low: Array, high: Array, share: float
) -> tuple[Index, Array, Array]:
    """Divide parts in which outputs of time alone deviate from their polynomials: step, begin, end."""
    course = motion.course
    owner = course.owner[step]
    turns = np.append(np.flatnonzero(np.diff(owner, prepend=-1)), len(owner))
    fast = np.ones(len(turns) - 1, dtype=bool)
    if timed.rates is not None:
        first = turns[:-1]
        rates = motion.observed(timed.rates, step[first], low[first], high[first])[:, :, 0].max(axis=1)
        whole = np.add.reduceat((high - low) * (course.last - course.begin)[step], first)
        fast = ~(rates * whole <= SLOW)
    at_once = max(1, int(VALUES_AT_ONCE * FINEST) // (len(PLACES) * len(timed.outputs.names)))
    found, which = [], np.flatnonzero(fast)
    for k in range(0, len(which), at_once):
        some = which[k : k + at_once]
        chosen = np.concatenate([np.arange(turns[r], turns[r + 1]) for r in some])
        found.append(_divided(motion, timed.outputs, step[chosen], low[chosen], high[chosen], share))
    left = np.repeat(~fast, np.diff(turns))
    found.append((step[left], low[left], high[left]))
    step, low, high = (np.concatenate(each) for each in zip(*found, strict=True))
    order = np.argsort(course.owner[step], kind="stable")
    return step[order], low[order], high[order]


def _divided(
    motion: SteppedMotion, outputs: OutputMap, step: Index, low: Array, high: Array, share: float
) -> tuple[Index, Array, Array]:
    """Divide parts of some realisations in which outputs deviate from their polynomials: step, begin, end."""
    course = motion.course
    extent = (course.last - course.begin)[step]
    turns = np.flatnonzero(np.diff(course.owner[step], prepend=-1))
    length = (high - low) * extent
    number = np.cumsum(np.diff(course.owner[step], prepend=course.owner[step[:1]]) != 0)
    whole = np.add.reduceat(length, turns)[number]
    count = np.maximum(1, np.ceil(length / np.where(whole > 0, FINEST * whole, 1.0) - 1e-9)).astype(np.int64)
    part, begun = np.repeat(np.arange(len(step)), count), np.cumsum(count) - count
    among = np.arange(len(part)) - begun[part]
    begin, end = among / count[part], np.where(among + 1 == count[part], 1.0, (among + 1) / count[part])
    span = (high - low)[part]
    left, right = low[part] + begin * span, np.where(end == 1.0, high[part], low[part] + end * span)
    seen = motion.observed(outputs, step[part], left, right)
    with np.errstate(invalid="ignore"):
        series = motion.observed(outputs, step, low, high) @ SERIES
        highest = np.abs(seen).max(axis=2)
        size = np.maximum.reduceat(highest, np.flatnonzero(np.diff(number[part], prepend=-1)))
        wrong = np.empty((len(step), len(outputs.names)))
        for c in np.unique(count).tolist():  # few distinct counts: the parts of a step are similar
            alike = np.flatnonzero(count == c)
            places = 2 * (np.arange(c)[:, None] + PLACES) / c - 1
            vander = np.polynomial.chebyshev.chebvander(places.ravel(), len(PLACES) - 1)
            values = seen[begun[alike, None] + np.arange(c)].transpose(0, 2, 1, 3).reshape(*wrong[alike].shape, -1)
            wrong[alike] = np.abs(values - series[alike] @ vander.T).max(axis=2)
        missed = wrong > np.maximum(SURPRISE * np.abs(series[:, :, -4:]).sum(axis=2), share * size[number])
    chosen = (missed | np.isnan(wrong)).any(axis=1)
    kept = chosen[part] | (among == 0)
    return (
        step[part[kept]],
        np.where(chosen[part], left, low[part])[kept],
        np.where(chosen[part], right, high[part])[kept],
    )


def _cut(course: StepHistory, step: Index, low: Array, high: Array, since: Array) -> tuple[Index, Array, Array]:
    """Divide parts right before a time of each realisation, s, shape (R,); infinite: nowhere."""
    owner = course.owner[step]
    number = np.cumsum(np.diff(owner, prepend=owner[:1]) != 0)
    extent = (course.last - course.begin)[step]
    place = (since[number] - course.begin[step]) / np.where(extent > 0, extent, 1.0) - SHY * (high - low)
    inside = (place > low) & (place < high) & ~course.kept[step]
    count = 1 + inside.astype(np.int64)
    behind = np.cumsum(count)[inside] - 1
    step, low, high = np.repeat(step, count), np.repeat(low, count), np.repeat(high, count)
    high[behind - 1] = low[behind] = place[inside]
    return step, low, high
