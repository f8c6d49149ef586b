"""Integration in stacks of realisations, and check of every result against the constraints."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from uqmbd.compiled import RecordedSteps
from uqmbd.dynamics.assembly import violated
from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.integration import Counters, Solved, Trajectories, integrate_by_ida, off_constraints, position_jumps
from uqmbd.errors import RedundantConstraintWarning
from uqmbd.typing import Array, Index

__all__ = ["MANY", "STACK", "IntegratedRealisations", "checked", "in_stacks"]


Method = Callable[[Ensemble, Array, float], Trajectories]


def checked(method: Method, ensemble: Ensemble, times: Array, rtol: float) -> Trajectories:
    """Integrate K realisations by `method`; realisations with jumps of positions or violated constraints fail."""
    jumps = position_jumps(ensemble, times, rtol) if ensemble.model.rheonomic else {}
    found = method(ensemble, times, rtol) if not jumps else _others(method, ensemble, times, rtol, jumps)
    model = ensemble.model
    if model.layout.rank < model.layout.constraints:  # equations were omitted as redundant
        wrong = violated(model, times, found.states, ensemble.block, ensemble.gradient_lengths, rtol)
        found = _stopped(found, wrong, 0)
    # the start was assembled: the integration has failed, not the assembly
    return _stopped(found, off_constraints(ensemble, times, found.states, rtol, found.off), 1)


def _stopped(found: Trajectories, off: dict[int, tuple[int, str]], least: int) -> Trajectories:
    """Mark realisations as failed from a time on, at the earliest from the time with index `least`."""
    texts = {k: text for k, text in off.items() if not found.messages[k]}
    if not texts:
        return found
    states, messages = found.states.copy(), list(found.messages)
    for k, (first, text) in texts.items():
        states[k, max(least, first) :], messages[k] = np.nan, text
    return replace(found, states=states, messages=tuple(messages))


def _others(method: Method, ensemble: Ensemble, times: Array, rtol: float, jumps: dict[int, str]) -> Trajectories:
    """Integrate the realisations without jumps."""
    start, layout, count = ensemble.start, ensemble.model.layout, len(ensemble)
    states = np.full((count, len(times), layout.width), np.nan)
    failed = np.array(sorted(jumps), dtype=np.int64)
    states[failed, 0] = np.concatenate([start.q, start.s, start.v], axis=1)[failed]
    messages = [jumps.get(k, "") for k in range(count)]
    rest = np.setdiff1d(np.arange(count), failed)
    if not len(rest):
        return Trajectories(times, states, tuple(messages))
    found = method(ensemble.select(rest), times, rtol)
    states[rest] = found.states
    for k, message in zip(rest.tolist(), found.messages, strict=True):
        messages[k] = message
    scalars = {}
    for name, values in found.scalars.items():
        scalars[name] = np.full(count, np.nan)
        scalars[name][rest] = values
    off = None if found.off is None else np.full((count, found.off.shape[1]), np.nan)
    if off is not None and found.off is not None:
        off[rest] = found.off
    path = None if found.path is None else found.path.placed(rest)
    return replace(found, states=states, messages=tuple(messages), scalars=scalars, off=off, path=path)


STACK = 64
"""Largest number of realisations in a stack with shared steps of an implicit method."""
MANY = 4096
"""Largest number of realisations that an explicit method integrates at once."""


@dataclass(frozen=True)
class IntegratedRealisations:
    """Integrated realisations, and the integrator of each; empty if no body can move."""

    solved: Solved
    by: tuple[str, ...]

    @classmethod
    def of(cls, solved: Solved, name: str) -> IntegratedRealisations:
        """Return integrated realisations with the same integrator for all."""
        return cls(solved, (name,) * len(solved.messages))

    def replaced(self, rows: Index, other: Solved, name: str, taken: Index) -> IntegratedRealisations:
        """Return the result after another integrator has tried given rows; accepted results replace earlier ones."""
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
            path = RecordedSteps.joined([path.placed(kept), other.path.placed(placed)])
        notes = self.solved.notes + tuple(note for note in other.notes if note not in self.solved.notes)
        counters = self.solved.counters + other.counters
        return IntegratedRealisations(
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


Solve = Callable[[Ensemble, Index, Array, float, bool], IntegratedRealisations]


def in_stacks(
    solve: Solve, ensemble: Ensemble, times: Array, rtol: float, stack: int, *, recording: bool
) -> Trajectories:
    """Integrate all assembled realisations in stacks of at most `stack`, at output times (T,), s.

    The callable `solve` integrates the members (M,) of one stack. With `recording`, the motion between output times is
    also returned.
    """
    start, layout = ensemble.start, ensemble.model.layout
    messages, by = list(start.messages), list[str]()
    counters, notes, paths = Counters(), list[str](), list[RecordedSteps | None]()
    assembled = np.flatnonzero(start.ok)
    whole = len(assembled) == len(ensemble) <= stack
    states, off = np.full((0 if whole else len(ensemble), len(times), layout.width), np.nan), None
    for k in range(0, len(assembled), stack):
        members = assembled[k : k + stack]
        if layout.unknowns:
            found = solve(ensemble, members, times, rtol, recording)
        else:
            found = IntegratedRealisations.of(integrate_by_ida(ensemble, members, times, rtol, recording=recording), "")
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
    counters = counters + Counters(by_dop853=by.count("dop853"), by_ida=by.count("ida"), by_radau=by.count("radau"))
    return Trajectories(
        times, states, tuple(messages), counters, notes=tuple(notes), off=off, path=RecordedSteps.joined(paths)
    )
