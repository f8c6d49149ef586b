"""Motion of realisations at any time from recorded steps, and expressions along it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uqmbd.compiled import PLACES, RecordedSteps, StepHistory
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import OutputMap
from uqmbd.dynamics.linear import RESIDUAL
from uqmbd.dynamics.observation import observe, observe_singly, output_program
from uqmbd.typing import Array, Index

__all__ = ["SteppedMotion", "motion_of"]


AT_ONCE = 1 << 9
"""Number of parts in one evaluation outside the driver."""


@dataclass(frozen=True)
class SteppedMotion:
    """Motion of realisations, given by steps."""

    batch: Batch
    course: StepHistory

    def observed(self, outputs: OutputMap, steps: Index, low: Array, high: Array) -> Array:
        """Evaluate outputs at eight places of parts of steps, bounded by `low` and `high` (E,): (E, output, 8)."""
        program, count = output_program(self.batch.model, outputs), len(outputs.names)
        if program is None:
            found = np.empty((len(steps), count, len(PLACES)))
            kept = self.course.kept[steps]
            for some in (np.flatnonzero(~kept), np.flatnonzero(kept)):
                evaluate = self._interpolated if kept[some[:1]].any() else self._evaluated
                for k in range(0, len(some), AT_ONCE):
                    rows = some[k : k + AT_ONCE]
                    found[rows] = evaluate(outputs, steps[rows], low[rows], high[rows])
            return found
        given = self.batch.block[:, : self.batch.model.block_parameters], self.batch.values
        found = self.course.observed(program, *given, steps, low, high)
        if found.shape[1] > count:
            rows, places = np.nonzero(~(found[:, count] <= RESIDUAL**2))
            if len(rows):
                states, times = self.course.states_of(steps[rows], low[rows], high[rows])
                each, owner = np.arange(len(rows)), self.course.owner[steps[rows]]
                poor = observe_singly(self.batch, outputs, states[each, places], times[each, places], owner)
                found[rows, :count, places] = poor
        return found[:, :count]

    def _evaluated(self, outputs: OutputMap, steps: Index, low: Array, high: Array) -> Array:
        owner = np.repeat(self.course.owner[steps], len(PLACES))
        states, times = self.course.states_of(steps, low, high)
        found = observe(self.batch, outputs, states.reshape(len(owner), -1), times.ravel(), owner)
        return found.reshape(len(steps), len(PLACES), -1).transpose(0, 2, 1)

    def _interpolated(self, outputs: OutputMap, steps: Index, low: Array, high: Array) -> Array:
        """Interpolate outputs in persistent contact: only recorded states satisfy the contacts."""
        which, back = np.unique(steps, return_inverse=True)
        owner = np.repeat(self.course.owner[which], len(PLACES))
        states, times = self.course.states_of(which, np.zeros(len(which)), np.ones(len(which)))
        known = observe(self.batch, outputs, states.reshape(len(owner), -1), times.ravel(), owner)
        known = known.reshape(len(which), len(PLACES), -1)
        course = replace(self.course, row=np.arange(len(known)), states=known)
        some = replace(course, **{name: getattr(self.course, name)[which] for name in STEPS})
        return some.states_of(back.ravel(), low, high)[0].transpose(0, 2, 1)


STEPS = ("owner", "begin", "end", "last", "kept")
"""Data of each step of a motion, except the location of its states."""


def motion_of(batch: Batch, path: RecordedSteps, members: Index, time: float, states: Array) -> SteppedMotion:
    """Return the motion of the selected realisations (ascending numbers) from recorded steps.

    Later steps replace earlier steps.  With a single time there are no steps; the realisations then stay in their
    `states` (K, width).
    """
    if len(still := np.setdiff1d(members, path.owner)):
        ends, kept = np.tile([time, time], (len(still), 1)), np.zeros(len(still), dtype=bool)
        alone = RecordedSteps(still, ends, kept, np.repeat(states[still, None], len(PLACES), axis=1))
        path = (
            alone if not len(path.owner) else RecordedSteps(*(np.concatenate(x) for x in zip(path, alone, strict=True)))
        )
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
    owner, some, begin, end, last = (x[held] for x in (owner, some, begin, end, last))
    return SteppedMotion(batch, StepHistory(owner, some, begin, end, last, path.kept[some], path.states))
