"""What sums a motion up: extremes, integrals, last values and first times, of each realisation by itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqmbd.compiled import Need
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import OutputMap
from uqmbd.dynamics.integration import Trajectories
from uqmbd.dynamics.observation import observe_along
from uqmbd.dynamics.summaries.extremes import SAME, extremes
from uqmbd.dynamics.summaries.integrals import first_times, integrals
from uqmbd.dynamics.summaries.motion import motion_of
from uqmbd.dynamics.summaries.resolved import SHARE, Parts, part_table, resolved
from uqmbd.mechanism import Output, Summary
from uqmbd.typing import Array, Index

__all__ = ["SummaryMap", "running_minimum", "summarised", "summary_map"]


AT_ONCE = 128
"""Realisations whose motions are held at once."""


@dataclass(frozen=True)
class SummaryMap:
    """Compiled expressions that are summed up over a motion.

    Attributes
    ----------
    names : tuple of str
        As they are written.
    kinds : tuple of str
        What of its expression each is (`Summary.kind`).
    columns : tuple of int
        Which output each sums up, of `along`; of `ending` where only the last value counts.
    along, ending : OutputMap
    """

    names: tuple[str, ...]
    kinds: tuple[str, ...]
    columns: tuple[int, ...]
    along: OutputMap
    ending: OutputMap

    @property
    def needs_path(self) -> bool:
        """Whether the motion between the output times counts."""
        return bool(self.along.names)

    @cached_property
    def needs(self) -> list[Need]:
        """What has to be resolved."""
        every = zip(self.kinds, self.columns, strict=True)
        return list(dict.fromkeys(Need(*_NEEDS[kind], column) for kind, column in every if kind in _NEEDS))


_EXTREMES = {"maximum": (1.0, 0), "minimum": (-1.0, 0), "time_of_maximum": (1.0, 1), "time_of_minimum": (-1.0, 1)}
"""Sign, and whether it is the value or the time."""

LARGEST, SMALLEST, SO_FAR, INTEGRAL, REACHED = range(5)
"""What an expression is resolved for (`Need.kind`)."""

_NEEDS = {
    "maximum": (LARGEST, 0.0),
    "time_of_maximum": (LARGEST, SAME / SHARE),
    "minimum": (SMALLEST, 0.0),
    "time_of_minimum": (SMALLEST, SAME / SHARE),
    "integral": (INTEGRAL, 0.0),
    "root_mean_square": (INTEGRAL, 0.0),
    "first_time": (REACHED, 0.0),
}


def summary_map(found: Sequence[Summary], compiled: Callable[[list[Output]], OutputMap]) -> SummaryMap:
    """Compile what is summed up; `compiled` makes a map of outputs."""
    ending = [s for s in found if s.kind == "final"]
    expressions = list(dict.fromkeys(s.summed for s in found if s.kind != "final"))
    last = list(dict.fromkeys(s.summed for s in ending))
    return SummaryMap(
        tuple(str(s) for s in found),
        tuple(s.kind for s in found),
        tuple(last.index(s.summed) if s.kind == "final" else expressions.index(s.summed) for s in found),
        *(compiled([Output(str(e), e, "") for e in part]) for part in (expressions, last)),
    )


def summarised(batch: Batch, seen: SummaryMap, trajectories: Trajectories, members: Index) -> Array:
    """Sum the motions of some realisations up.

    Parameters
    ----------
    batch : Batch
        K realisations.
    seen : SummaryMap
        What is asked for.
    trajectories : Trajectories
        Their motion, with its path where that is needed.
    members : array of int, shape (M,)
        Realisations that were integrated to the last time.

    Returns
    -------
    array, shape (M, summary)
        NaN: a value that is not reached.
    """
    found = np.full((len(members), len(seen.names)), np.nan)
    if seen.ending.names and len(members):
        states = trajectories.states[members][:, -1:]
        values = observe_along(batch.select(members), seen.ending, trajectories.times[-1:], states)[:, :, 0]
        for k, (kind, column) in enumerate(zip(seen.kinds, seen.columns, strict=True)):
            if kind == "final":
                found[:, k] = values[:, column]
    if not seen.needs_path:
        return found

    def collect(rows: Index, parts: Parts, allowed: Array) -> None:
        for k, (kind, column) in enumerate(zip(seen.kinds, seen.columns, strict=True)):
            if kind in _EXTREMES:
                sign, which = _EXTREMES[kind]
                found[rows, k] = extremes(parts, allowed, column, sign)[which]
            elif kind == "first_time":
                found[rows, k] = first_times(parts, column)
            elif kind != "final":
                total, length = integrals(parts, column)
                found[rows, k] = np.sqrt(np.maximum(total / length, 0.0)) if kind == "root_mean_square" else total

    _resolve(batch, seen.along, trajectories, members, seen.needs, collect)
    return found


def running_minimum(batch: Batch, outputs: OutputMap, trajectories: Trajectories) -> Array:
    """Find the smallest values of outputs so far, at the output times and between them.

    Parameters
    ----------
    batch : Batch
        K realisations.
    outputs : OutputMap
        Of states, time and inputs.
    trajectories : Trajectories
        Their motion, with its path (``integrate(..., between=True)``).

    Returns
    -------
    array, shape (K, output, T)
        From the first time to each output time, on both sides of jumps; NaN where a realisation failed.
    """
    times = np.asarray(trajectories.times, dtype=float)
    found = np.full((len(batch), len(outputs.names), len(times)), np.nan)
    members = np.flatnonzero([not message for message in trajectories.messages])

    def collect(rows: Index, parts: Parts, allowed: Array) -> None:
        for column in range(len(outputs.names)):
            found[members[rows], column] = parts.fitted(column).least_so_far(parts.first, times)

    if outputs.names:
        needs = [Need(SO_FAR, 0.0, column) for column in range(len(outputs.names))]
        _resolve(batch, outputs, trajectories, members, needs, collect)
    return found


def _resolve(
    batch: Batch,
    outputs: OutputMap,
    trajectories: Trajectories,
    members: Index,
    needs: Sequence[Need],
    collect: Callable[[Index, Parts, Array], None],
) -> None:
    """Resolve outputs along the motions of members, some at once, and hand them on with their rows among these."""
    if not members.size:  # all have failed, and there is no motion
        return
    if trajectories.path is None:
        raise ValueError("trajectories without a path: integrate(..., between=True)")
    table = part_table(outputs, trajectories.rtol, needs)
    for k in range(0, len(members), AT_ONCE):
        rows = np.arange(k, min(k + AT_ONCE, len(members)))
        motion = motion_of(batch, trajectories.path, members[rows], trajectories.times[0], trajectories.states[:, 0])
        parts = resolved(motion, outputs, table)
        there = np.searchsorted(members[rows], parts.owner[parts.first])
        collect(rows[there], parts, table.allowed)
