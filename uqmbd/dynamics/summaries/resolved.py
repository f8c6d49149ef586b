"""Expressions along a motion, resolved: polynomials on parts of steps, which are halved where they are not accurate.

A step of an integrator is long: an output of the states may have a peak or a kink within it.  So an expression is
evaluated at interpolated states, at eight Chebyshev points of a part of a step, and the part is halved until the last
coefficients of its polynomial are small, where that can change what is asked for.  All realisations are halved
together, and each by what is its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from uqmbd.compiled import PLACES
from uqmbd.dynamics.equations import OutputMap
from uqmbd.dynamics.summaries.motion import Motion
from uqmbd.typing import Array, Index, Mask

__all__ = ["FINE", "NODES", "Need", "Parts", "resolved", "values_at"]


COUNT = len(PLACES)
NODES = 2 * PLACES - 1
"""Chebyshev points of a part, from -1 to 1: those of a whole step are where its states are recorded."""

FINE = np.linspace(-1, 1, 33)
"""Where a polynomial is evaluated to find its largest and smallest values."""

SHARE = 0.02
"""Part of the tolerance of the integration by which a polynomial may be wrong, and at least ..."""

ROUNDING = 2e-12
"""... as a part of the largest value."""

SAFETY = 2.0
"""By which an estimate of a polynomial's error is multiplied."""

SLOW = 10.0
"""Ratio of the last coefficients to those before, times this: from 1 on they fall so slowly that there is a kink.  One
between the first two points hardly shows in them: the error there is so many times their size."""

DEEPEST = 40
"""How often a part may be halved."""

JUMP = 0.1
"""Error, as a part of what is between the largest and the smallest value, from which on it is that of a jump."""

LONGEST = 1 / 64
"""Part of the whole time that a part lasts at most: what an output does for a moment shows in some of its points."""

ROUGH, SMOOTHER = 6, 0.25
"""After so many times two halves are at least so much more accurate than the whole, or neither is ever."""


def _to_coefficients() -> Array:
    """Matrix from values at the nodes to Chebyshev coefficients."""
    vander = np.polynomial.chebyshev.chebvander(NODES, COUNT - 1)
    return np.asarray(np.linalg.inv(vander))


_COEFFICIENTS = _to_coefficients()
_FINE = np.asarray(np.polynomial.chebyshev.chebvander(FINE, COUNT - 1), dtype=float)


def _times(matrix: Array, values: Array) -> Array:
    """Product of a matrix (A, B) with each of values (B, E): term by term, the same in any company."""
    found = np.zeros((len(matrix), values.shape[1]))
    for row, weights in zip(found, matrix.tolist(), strict=True):
        for k, weight in enumerate(weights):
            row += weight * values[k]
    return found


def values_at(coefficients: Array, places: Array) -> Array:
    """Values (E,) of Chebyshev series (E, 8) at places (E,), by the recurrence of Clenshaw."""
    one, two = np.zeros(len(places)), np.zeros(len(places))
    for k in range(coefficients.shape[1] - 1, 0, -1):
        one, two = coefficients[:, k] + 2 * places * one - two, one
    return np.asarray(coefficients[:, 0] + places * one - two)


def _above(fine: Array) -> Array:
    """Bound values of polynomials (E,) from those at `FINE` (33, E).

    A peak is less above the largest of them than that is above its neighbours.
    """
    top = fine.argmax(axis=0)
    beside = (np.clip(top + k, 0, len(fine) - 1) for k in (-1, 1))
    largest, one, two = (np.take_along_axis(fine, k[None], axis=0)[0] for k in (top, *beside))
    return np.asarray(2 * largest - np.minimum(one, two))


def _error(sizes: Array) -> Array:
    """Errors (E, O) of series whose coefficients have sizes (E, 8, O): the slower these fall, the more is left."""
    last, before = sizes[:, -1] + sizes[:, -2], sizes[:, -3] + sizes[:, -4]
    ratio = np.minimum(last / np.maximum(before, 1e-300), 1.0)
    return np.asarray(SAFETY * last * (1 + (SLOW * ratio) ** 2))


@dataclass(frozen=True)
class Parts:
    """Parts of the steps of a motion, in order, with values of outputs.

    Attributes
    ----------
    motion : Motion
    step : array of int, shape (E,)
        Of which each is a part.
    low, high : array, shape (E,)
        From which part of the step's polynomial to which.
    depth : array of int, shape (E,)
        How often the step was halved.
    values : array, shape (E, 8, O)
        At the nodes.
    coefficients : array, shape (E, 8, O)
    error : array, shape (E, O)
        By which the polynomial may be wrong; zero where nothing makes it better.
    most, least : array, shape (E, O)
        Between which the polynomial is.
    """

    motion: Motion
    step: Index
    low: Array
    high: Array
    depth: Index
    values: Array
    coefficients: Array
    error: Array
    most: Array
    least: Array

    @classmethod
    def of(cls, motion: Motion, outputs: OutputMap, step: Index, low: Array, high: Array, depth: Index) -> Parts:
        """Evaluate outputs on parts."""
        values = motion.observed(outputs, step, low, high)
        with np.errstate(all="ignore"):
            # times side by side: whole rows are added up
            rows = np.ascontiguousarray(values.transpose(1, 2, 0)).reshape(COUNT, -1)
            series = _times(_COEFFICIENTS, rows)
            fine = _times(_FINE, series)
            shape = (-1, len(step))
            most = np.ascontiguousarray(np.maximum(_above(fine), rows.max(axis=0)).reshape(shape).T)
            least = np.ascontiguousarray(np.minimum(-_above(-fine), rows.min(axis=0)).reshape(shape).T)
            coefficients = np.ascontiguousarray(series.reshape(COUNT, *shape).transpose(2, 0, 1))
            error = _error(np.abs(coefficients))
        found = cls(motion, step, low, high, depth, values, coefficients, error, most, least)
        found.error[motion.kept[step]] = 0.0
        return found._as_good_as_ever((depth >= DEEPEST)[:, None])

    def _as_good_as_ever(self, which: Mask) -> Parts:
        """Return the parts with some outputs (E, O) as they are, since nothing makes them better; straight at jumps.

        No polynomial follows a jump: between the values on both sides it reaches others, which the output never has.
        """
        highest, lowest = self.values.max(axis=1), self.values.min(axis=1)
        jump = which & (self.error > JUMP * (highest - lowest))
        begin, end = self.values[:, 0], self.values[:, -1]
        straight = np.zeros_like(self.coefficients)
        straight[:, 0], straight[:, 1] = 0.5 * (begin + end), 0.5 * (end - begin)
        return replace(
            self,
            coefficients=np.where(jump[:, None], straight, self.coefficients),
            error=np.where(which, 0.0, self.error),
            most=np.where(jump, highest, self.most),
            least=np.where(jump, lowest, self.least),
        )

    def _merged(self, kept: Index, other: Parts) -> Parts:
        """Return some of these and others, in order."""
        step = np.concatenate([self.step[kept], other.step])
        order = np.lexsort((np.concatenate([self.low[kept], other.low]), step))
        fields = ("low", "high", "depth", "values", "coefficients", "error", "most", "least")
        joined = (np.concatenate([getattr(self, name)[kept], getattr(other, name)])[order] for name in fields)
        return Parts(self.motion, step[order], *joined)

    def halved(self, outputs: OutputMap, which: Mask) -> Parts:
        """Return the parts with some of them halved."""
        whole = np.flatnonzero(which)
        middle = 0.5 * (self.low[whole] + self.high[whole])
        low = np.stack([self.low[whole], middle], axis=1).ravel()
        high = np.stack([middle, self.high[whole]], axis=1).ravel()
        depth = self.depth[whole] + 1
        halves = Parts.of(self.motion, outputs, np.repeat(self.step[whole], 2), low, high, np.repeat(depth, 2))
        # what is no better in both halves is rounding, or rougher than can be resolved
        better = (halves.error.reshape(len(whole), 2, -1) <= SMOOTHER * self.error[whole, None]).any(axis=1)
        never = np.repeat(~better & (depth > ROUGH)[:, None], 2, axis=0)
        return self._merged(np.flatnonzero(~which), halves._as_good_as_ever(never))

    @cached_property
    def owner(self) -> Index:
        """Of which realisation each is, shape (E,)."""
        return self.motion.owner[self.step]

    @cached_property
    def first(self) -> Index:
        """First part of each realisation that has some, shape (R,)."""
        return np.flatnonzero(np.diff(self.owner, prepend=-1))

    @cached_property
    def number(self) -> Index:
        """Number of the realisation of each part, among those that have some, shape (E,)."""
        return np.cumsum(np.diff(self.owner, prepend=self.owner[:1]) != 0)

    @cached_property
    def begin(self) -> Array:
        """When each begins, s."""
        return self._time(self.low)

    @cached_property
    def end(self) -> Array:
        """When each ends, s."""
        return self._time(self.high)

    def _time(self, part: Array) -> Array:
        m, k = self.motion, self.step
        return np.minimum(m.begin[k] + part * (m.last[k] - m.begin[k]), m.end[k])

    def time(self, which: Index, places: Array) -> Array:
        """Tell the times of places from -1 to 1 in some parts, s."""
        return self.begin[which] + 0.5 * (1 + places) * (self.end[which] - self.begin[which])


Need = Callable[[Parts, Array], Mask]
"""From parts and their tolerances (E, O) to which of them have to be halved, (E,)."""


def resolved(motion: Motion, outputs: OutputMap, rtol: float, needs: Sequence[Need]) -> tuple[Parts, Array]:
    """Resolve outputs along a motion as far as is needed.

    Parameters
    ----------
    motion : Motion
    outputs : OutputMap
    rtol : float
        Relative tolerance of the integration.
    needs : sequence of callable
        What is asked for.

    Returns
    -------
    Parts
        In order.
    array, shape (R, O)
        Tolerances of the realisations that have parts, absolute.
    """
    step, low, high = _begun(motion)
    parts = Parts.of(motion, outputs, step, low, high, np.zeros(len(step), dtype=np.int64))
    with np.errstate(invalid="ignore"):
        size = np.maximum.reduceat(np.maximum(np.abs(parts.most), np.abs(parts.least)), parts.first, axis=0)
        allowed = max(SHARE * rtol, ROUNDING) * size
        while True:
            tolerance = allowed[parts.number]
            which = np.zeros(len(parts.step), dtype=bool)
            for need in needs:
                which |= need(parts, tolerance)
            if not which.any():
                return parts, allowed
            parts = parts.halved(outputs, which)


def _begun(motion: Motion) -> tuple[Index, Array, Array]:
    """Return the steps, divided evenly where they are long: of which step each part is, from where to where."""
    length, turns = motion.end - motion.begin, np.flatnonzero(np.diff(motion.owner, prepend=-1))
    whole = np.add.reduceat(length, turns)[np.cumsum(np.diff(motion.owner, prepend=motion.owner[:1]) != 0)]
    share = length / np.where(whole > 0, whole, 1.0)
    # contacts that last are interpolated whole
    counts = np.where(motion.kept, 1, np.maximum(1, np.ceil(share / LONGEST - 1e-9))).astype(np.int64)
    step = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(len(step)) - np.repeat(np.cumsum(counts) - counts, counts)
    reach, of = motion.reach[step], counts[step]
    return step, reach * number / of, np.where(number + 1 == of, reach, reach * (number + 1) / of)
