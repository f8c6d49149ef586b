"""The motion of realisations at any time, from recorded steps, and expressions of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqmbd.compiled import PLACES, Path
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import OutputMap
from uqmbd.dynamics.linear import excess
from uqmbd.dynamics.observation import observe
from uqmbd.typing import Array, Index, Mask

__all__ = ["Motion", "motion_of"]


INSIDE = 1e-12
"""Part of a time by which equations are evaluated inside a step: at its ends forces may jump."""

AT_ONCE = 1 << 9
"""Parts that are evaluated at once."""

_ENDS = np.where(np.arange(len(PLACES)) % 2, -1.0, 1.0) * np.where(np.arange(len(PLACES)) % (len(PLACES) - 1), 1.0, 0.5)
"""Barycentric weights of the places, which are Chebyshev points."""


@dataclass(frozen=True)
class Motion:
    """Steps of realisations, one after the other.

    Attributes
    ----------
    batch : Batch
        The realisations.
    owner : array of int, shape (P,)
        Of which realisation a step is; ascending.
    begin, end : array, shape (P,)
        From when to when it holds, s.
    last : array, shape (P,)
        Where its polynomial ends, s: not before `end`.
    kept : array of bool, shape (P,)
        Whether contacts last: states in between would not be on them.
    states : array, shape (P, 8, width)
        At the places of the polynomial.
    """

    batch: Batch
    owner: Index
    begin: Array
    end: Array
    last: Array
    kept: Mask
    states: Array

    @cached_property
    def reach(self) -> Array:
        """Part of its polynomial at which each step ends, shape (P,)."""
        length = self.last - self.begin
        return np.where(length > 0, (self.end - self.begin) / np.where(length > 0, length, 1.0), 1.0)

    def observed(self, outputs: OutputMap, steps: Index, low: Array, high: Array) -> Array:
        """Evaluate outputs at the places of parts of steps (E,), from one part of each to another: (E, 8, output)."""
        found = np.empty((len(steps), len(PLACES), len(outputs.names)))
        kept = self.kept[steps]
        for some in (np.flatnonzero(~kept), np.flatnonzero(kept)):
            evaluate = self._interpolated if kept[some[:1]].any() else self._evaluated
            for k in range(0, len(some), AT_ONCE):
                rows = some[k : k + AT_ONCE]
                found[rows] = evaluate(outputs, steps[rows], low[rows], high[rows])
        return found

    def _evaluated(self, outputs: OutputMap, steps: Index, low: Array, high: Array) -> Array:
        model, owner = self.batch.model, np.repeat(self.owner[steps], len(PLACES))
        states = self._weighted(self.states[steps], low, high).reshape(len(owner), -1)
        times = self._inside(steps, low, high)
        if model.layout.rank and model.system is not None and model.system.programs is not None:
            q, v = excess(model, states, times, self.batch.block[owner])
            n, first = model.layout.coordinates, model.layout.velocities
            states[:, :n] -= np.where(np.isfinite(q), q, 0.0)
            states[:, first:] -= np.where(np.isfinite(v), v, 0.0)
        return observe(self.batch, outputs, states, times, owner).reshape(len(steps), len(PLACES), -1)

    def _interpolated(self, outputs: OutputMap, steps: Index, low: Array, high: Array) -> Array:
        """Interpolate outputs where contacts last: only recorded states are on these."""
        which, back = np.unique(steps, return_inverse=True)
        zero, one = np.zeros(len(which)), np.ones(len(which))
        owner = np.repeat(self.owner[which], len(PLACES))
        states, times = self.states[which].reshape(len(owner), -1), self._inside(which, zero, one)
        known = observe(self.batch, outputs, states, times, owner).reshape(len(which), len(PLACES), -1)
        return self._weighted(known[back], low, high)

    def _weighted(self, values: Array, low: Array, high: Array) -> Array:
        """Change values (E, 8, W) of polynomials at the places to those of parts, by barycentric interpolation."""
        some = np.flatnonzero((low != 0) | (high != 1))
        if not len(some):
            return values
        parts = low[some, None] + (high - low)[some, None] * PLACES
        parts[:, -1] = high[some]
        apart = parts[:, :, None] - PLACES
        hit = apart == 0
        weights = _ENDS / np.where(hit, 1.0, apart)
        weights = np.where(hit.any(axis=2, keepdims=True), hit.astype(float), weights)
        # one product for each step: the same in any company
        values[some] = (weights @ values[some]) / weights.sum(axis=2, keepdims=True)
        return values

    def _inside(self, steps: Index, low: Array, high: Array) -> Array:
        """Tell the times of the places of parts, inside the steps."""
        begin, end = self.begin[steps, None], self.end[steps, None]
        margin = np.minimum(INSIDE * np.maximum(1.0, np.maximum(np.abs(begin), np.abs(end))), 0.5 * (end - begin))
        parts = low[:, None] + (high - low)[:, None] * PLACES
        times = begin + parts * (self.last[steps, None] - begin)
        return np.clip(times, begin + margin, end - margin).ravel()


def motion_of(batch: Batch, path: Path, members: Index, time: float, states: Array) -> Motion:
    """Return the motion of some realisations (ascending numbers) from recorded steps; what was recorded later holds.

    Those without steps, as there is one time only, stay in their `states` (K, width) at a time.
    """
    if len(still := np.setdiff1d(members, path.owner)):
        ends, kept = np.tile([time, time], (len(still), 1)), np.zeros(len(still), dtype=bool)
        alone = Path(still, ends, kept, np.repeat(states[still, None], len(PLACES), axis=1))
        path = alone if not len(path.owner) else Path(*(np.concatenate(x) for x in zip(path, alone, strict=True)))
    wanted = np.zeros(len(batch), dtype=bool)
    wanted[members] = True
    some = np.flatnonzero(wanted[path.owner])
    some = some[np.argsort(path.owner[some], kind="stable")]
    owner, begin, last = path.owner[some], path.ends[some, 0], path.ends[some, 1]
    end = last.copy()
    same = owner[1:] == owner[:-1]
    for k in np.unique(owner[:-1][same & (begin[1:] < end[:-1])]).tolist():
        first, stop = np.searchsorted(owner, [k, k + 1])
        later = np.minimum.accumulate(begin[first + 1 : stop][::-1])[::-1]
        end[first : stop - 1] = np.minimum(end[first : stop - 1], later)
    held = (end > begin) | (last == begin)
    some, owner, begin, end, last = some[held], owner[held], begin[held], end[held], last[held]
    return Motion(batch, owner, begin, end, last, path.kept[some], path.states[some])
