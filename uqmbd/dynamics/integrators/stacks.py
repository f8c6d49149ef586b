"""Integration of an ensemble in stacks of realisations, and who integrated each of them."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from uqmbd.compiled import Path
from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.integration import Counters, Solved, Trajectories, integrate_by_ida
from uqmbd.errors import RedundantConstraintWarning
from uqmbd.typing import Array, Index

__all__ = ["MANY", "STACK", "Solution", "in_stacks"]


STACK = 64
"""Realisations of a stack that share the steps of an implicit method."""
MANY = 4096
"""Realisations that an explicit method integrates at once."""


@dataclass(frozen=True)
class Solution:
    """Integrated realisations, and the name of who integrated each; empty where nothing moves."""

    solved: Solved
    by: tuple[str, ...]

    @classmethod
    def of(cls, solved: Solved, name: str) -> Solution:
        """Name the same integrator for all realisations."""
        return cls(solved, (name,) * len(solved.messages))

    def replaced(self, rows: Index, other: Solved, name: str, taken: Index) -> Solution:
        """Return what holds after another integrator has tried some rows: of these, those that are taken replace."""
        mine = rows[taken]
        states, messages, by = self.solved.states.copy(), list(self.solved.messages), list(self.by)
        states[mine] = other.states[taken]
        off = None if self.solved.off is None else self.solved.off.copy()
        if off is not None:
            off[mine] = np.nan if other.off is None else other.off[taken]
        for row, k in zip(mine.tolist(), taken.tolist(), strict=True):
            messages[row], by[row] = other.messages[k], name
        path = self.solved.path
        if path is not None and other.path is not None:
            kept, placed = np.arange(len(messages)), np.full(len(other.messages), -1)
            kept[mine], placed[taken] = -1, mine
            path = Path.joined([path.placed(kept), other.path.placed(placed)])
        notes = self.solved.notes + tuple(note for note in other.notes if note not in self.solved.notes)
        counters = self.solved.counters + other.counters
        return Solution(
            replace(
                self.solved,
                states=states,
                messages=tuple(messages),
                counters=counters,
                notes=notes,
                off=off,
                path=path,
            ),
            tuple(by),
        )


Solve = Callable[[Ensemble, Index, Array, float, bool], Solution]


def in_stacks(
    solve: Solve, ensemble: Ensemble, times: Array, rtol: float, stack: int, *, recording: bool
) -> Trajectories:
    """Integrate all realisations that could be assembled.

    Parameters
    ----------
    solve : callable
        Integrates the members (M,) of an ensemble that make up a stack.
    ensemble : Ensemble
        K realisations.
    times : array, shape (T,)
        Output times, s.
    rtol : float
        Relative tolerance.
    stack : int
        Most realisations of a stack.
    recording : bool
        Whether the motion between output times is returned, too.
    """
    start, layout = ensemble.start, ensemble.model.layout
    messages, by = list(start.messages), list[str]()
    counters, notes, paths = Counters(), list[str](), list[Path | None]()
    assembled = np.flatnonzero(start.ok)
    whole = len(assembled) == len(ensemble) <= stack
    states, off = np.full((0 if whole else len(ensemble), len(times), layout.width), np.nan), None
    for k in range(0, len(assembled), stack):
        members = assembled[k : k + stack]
        if layout.unknowns:
            found = solve(ensemble, members, times, rtol, recording)
        else:
            found = Solution.of(integrate_by_ida(ensemble, members, times, rtol, recording=recording), "")
        if whole:
            states, off = found.solved.states, found.solved.off
        else:
            states[members] = found.solved.states
        paths.append(None if found.solved.path is None else found.solved.path.placed(members))
        for member, message in zip(members, found.solved.messages, strict=True):
            messages[member] = message
        by += found.by
        counters = counters + found.solved.counters
        notes += [note for note in found.solved.notes if note not in notes]
    if notes:
        more = f" (and {len(notes) - 1} more such changes)" if len(notes) > 1 else ""
        warnings.warn(
            f"mechanism {ensemble.model.name!r}: {notes[0]}{more}. The motion is not affected; "
            "the reactions of these joints are not unique.",
            RedundantConstraintWarning,
            stacklevel=6,
        )
    counters = counters + Counters(by_dop853=by.count("dop853"), by_ida=by.count("ida"))
    return Trajectories(times, states, tuple(messages), counters, notes=tuple(notes), off=off, path=Path.joined(paths))
