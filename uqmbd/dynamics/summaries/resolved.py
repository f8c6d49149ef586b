"""Expressions along a motion, resolved: polynomials on parts of steps, which are divided where they are not accurate.

A step of an integrator is long: an output of the states may have a peak or a kink within it.  So an expression is
evaluated at interpolated states, at eight Chebyshev points of a part of a step, and the part is divided until the last
coefficients of its polynomial are small, where that can change what is asked for.  All realisations are divided
together, and each by what is its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqmbd.compiled import Course, Fitted, Need, PartTable
from uqmbd.dynamics.equations import OutputMap
from uqmbd.dynamics.summaries.motion import Motion
from uqmbd.typing import Array, Index

__all__ = ["SHARE", "Parts", "part_table", "resolved", "values_at"]


SHARE = 0.02
"""Part of the tolerance of the integration by which a polynomial may be wrong, and at least ..."""

ROUNDING = 2e-12
"""... as a part of the largest value."""

LONGEST = 1 / 64
"""Part of the whole time that a part lasts at most: what an output does for a moment shows in some of its points."""


def values_at(coefficients: Array, places: Array) -> Array:
    """Values (E,) of Chebyshev series (E, 8) at places (E,), by the recurrence of Clenshaw."""
    one, two = np.zeros(len(places)), np.zeros(len(places))
    for k in range(coefficients.shape[1] - 1, 0, -1):
        one, two = coefficients[:, k] + 2 * places * one - two, one
    return np.asarray(coefficients[:, 0] + places * one - two)


@dataclass(frozen=True)
class Parts:
    """Parts of the steps of a motion, in order, with values of outputs.

    Attributes
    ----------
    table : PartTable
        What is known of them; it is used again for others.
    """

    table: PartTable

    @cached_property
    def order(self) -> Index:
        """Numbers of the parts in the table, shape (E,)."""
        return self.table.order

    @cached_property
    def owner(self) -> Index:
        """Of which realisation each is, shape (E,); ascending."""
        return self.table.course.owner[self.table.step[self.order]]

    @cached_property
    def begin(self) -> Array:
        """When each begins, s."""
        return self.table.begin[self.order]

    @cached_property
    def end(self) -> Array:
        """When each ends, s."""
        return self.table.end[self.order]

    @cached_property
    def first(self) -> Index:
        """First part of each realisation that has some, shape (R,)."""
        return np.flatnonzero(np.diff(self.owner, prepend=-1))

    @cached_property
    def number(self) -> Index:
        """Number of the realisation of each part, among those that have some, shape (E,)."""
        return np.cumsum(np.diff(self.owner, prepend=self.owner[:1]) != 0)

    def of(self, name: str, column: int, which: Index | slice = slice(None)) -> Array:
        """Return what is known of one output in some parts, by its name in the table."""
        found: Array = getattr(self.table, name)[self.order[which], column]
        return found

    def fitted(self, column: int) -> Fitted:
        """Return the polynomials of one output."""
        table = self.table
        return Fitted(column, self.order, table.begin, table.end, table.values, table.coefficients)

    def time(self, which: Index, places: Array) -> Array:
        """Tell the times of places from -1 to 1 in some parts, s."""
        return self.begin[which] + 0.5 * (1 + places) * (self.end[which] - self.begin[which])


def part_table(outputs: OutputMap, rtol: float, needs: Sequence[Need]) -> PartTable:
    """Make room for parts on which outputs are resolved.

    Parameters
    ----------
    outputs : OutputMap
    rtol : float
        Relative tolerance of the integration.
    needs : sequence of Need
        What is asked for.
    """
    return PartTable(len(outputs.names), needs, max(SHARE * rtol, ROUNDING))


def resolved(motion: Motion, outputs: OutputMap, table: PartTable) -> Parts:
    """Resolve outputs along a motion as far as is needed; what was in the table is lost."""
    table.begin_with(motion.course, *_begun(motion.course))
    with np.errstate(invalid="ignore"):
        while table.refine(motion.observed(outputs, *table.new)):
            pass
    return Parts(table)


def _begun(course: Course) -> tuple[Index, Array, Array]:
    """Return the steps, divided evenly where they are long: of which step each part is, from where to where."""
    length, turns = course.end - course.begin, np.flatnonzero(np.diff(course.owner, prepend=-1))
    whole = np.add.reduceat(length, turns)[np.cumsum(np.diff(course.owner, prepend=course.owner[:1]) != 0)]
    share = length / np.where(whole > 0, whole, 1.0)
    # contacts that last are interpolated whole
    counts = np.where(course.kept, 1, np.maximum(1, np.ceil(share / LONGEST - 1e-9))).astype(np.int64)
    extent = course.last - course.begin
    reached = np.where(extent > 0, length / np.where(extent > 0, extent, 1.0), 1.0)
    step = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(len(step)) - np.repeat(np.cumsum(counts) - counts, counts)
    reach, of = reached[step], counts[step]
    return step, reach * number / of, np.where(number + 1 == of, reach, reach * (number + 1) / of)
