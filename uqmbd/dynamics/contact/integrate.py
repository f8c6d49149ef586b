"""Event-driven integration of an ensemble, and the times of its events.

The module also returns the motion of one realisation from event to event, with each piece as a function of time.
"""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from uqmbd.compiled import Encounters, ExplicitStatus, IntegrationState
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.contact.evaluator import ContactEvaluator
from uqmbd.dynamics.contact.event_driven import EventDrivenMotion
from uqmbd.dynamics.contact.records import named_times
from uqmbd.dynamics.integration import Counters, Interval, Segment, SegmentedMotion, Trajectories
from uqmbd.errors import StudyError
from uqmbd.typing import Array

__all__ = ["event_times", "integrate_with_events", "motion_in_segments"]


@dataclass(frozen=True)
class _RestartState:
    """Start of a motion between restarts, with all data that affect its steps."""

    begin: float
    interval_begin: float
    interval: int
    wanted: float
    z: Array
    mode: Array
    heading: Array
    internal: Array
    slow: float


def followed_segments(motion: EventDrivenMotion) -> SegmentedMotion:
    """Integrate the only realisation of a motion from its start, and return its segments."""
    pieces: list[_RestartState] = []
    ends: list[float] = []

    def begun() -> None:
        run, e = motion.run, motion.encounters
        # merge restarts without progress in time
        while pieces and pieces[-1].begin >= run.now[0]:
            pieces.pop()
        pieces.append(
            _RestartState(
                *(float(run.now[0]), float(run.begin[0]), int(run.interval[0]), float(run.wanted[0])),
                *(run.z[0].copy(), e.mode[0].copy(), e.heading[0].copy(), e.internal[0].copy()),
                float(e.slow[0]),
            )
        )

    motion.restarted, motion.encounters.reports = begun, True
    motion.follow()
    if not pieces:
        return SegmentedMotion((), motion.messages[0])
    last = float(motion.run.now[0])
    ends = [*(piece.begin for piece in pieces[1:]), last]
    happened = motion.records.of(0)
    segments = []
    for piece, end in zip(pieces, ends, strict=True):
        names = [f"{motion.model.events[k][0]}: {label}" for time, k, label in happened if time == end]
        text = ", ".join(dict.fromkeys(names)) or ("" if piece is pieces[-1] else "break")
        segments.append(Segment(piece.begin, end, text, partial(_states, motion, piece)))
    return SegmentedMotion(tuple(segments), motion.messages[0])


def _states(motion: EventDrivenMotion, piece: _RestartState, times: Array) -> Array:
    """Return the states (T, width) of a piece at times (T,) in s, projected onto the constraints."""
    run, contacts = motion.run, motion.run.contacts
    assert contacts is not None
    order = np.argsort(times, kind="stable")
    intervals = [
        Interval(float(run.interval_ends[k]), float(run.interval_longest[k]), jumps=False)
        for k in range(piece.interval, int(run.last_interval[0]) + 1)
    ]
    encounters = Encounters(contacts, 1, watched=False)
    encounters.mode[0], encounters.heading[0], encounters.internal[0] = piece.mode, piece.heading, piece.internal
    encounters.length[:], encounters.slow[:] = motion.length, piece.slow
    grid = np.concatenate([[piece.begin], np.asarray(times, dtype=float)[order]])
    again = IntegrationState(
        run.dynamics, run.method, piece.z[None], motion.batch.block, grid, [intervals], run.floor, contacts, encounters
    )
    again.begin[0], again.wanted[0] = piece.interval_begin, piece.wanted
    with np.errstate(all="ignore"):
        while again.status[0] == ExplicitStatus.RUNNING and again.column[0] < len(grid):
            again.told[0] = 1
            again.advance()
            again.status[0] = ExplicitStatus.RUNNING if again.status[0] == ExplicitStatus.STEPPED else again.status[0]
    again.project()
    again.result[0, again.column[0] :] = np.nan
    found = np.empty((len(times), run.z.shape[1]))
    found[order] = again.result[0, 1:]
    return found


def integrate_with_events(
    ensemble: Batch, times: Array, rtol: float, *, recording: bool = False, stages: int = 0
) -> Trajectories:
    """Integrate all realisations of a model with events; with `recording`, return steps.

    Steps are explicit, or implicit with `stages`.
    """
    begin = clock.perf_counter()
    _require_compiled(ensemble)
    states = np.full((len(ensemble), len(times), ensemble.model.layout.width), np.nan)
    messages, members = list(ensemble.start.messages), np.flatnonzero(ensemble.start.ok)
    if not len(members):
        return Trajectories(times, states, tuple(messages), Counters(seconds=clock.perf_counter() - begin))
    evaluator = ContactEvaluator(ensemble.model)
    motion = EventDrivenMotion(ensemble.select(members), times, rtol, evaluator, recording=recording, stages=stages)
    with np.errstate(all="ignore"):
        motion.follow()
    path = motion.run.recorder.found
    states[members] = motion.run.result
    for member, message in zip(members.tolist(), motion.messages, strict=True):
        messages[member] = message
    counters = Counters(
        integrations=int(motion.encounters.restarts.sum()),
        accelerations=motion.run.evaluations,
        steps=int(motion.run.steps.sum()),
        events=len(motion.records),
        two_motions=len(motion.decisions.several),
        by_dop853=0 if stages else len(members),
        by_radau=len(members) if stages else 0,
        seconds=clock.perf_counter() - begin,
    )
    return Trajectories(
        times,
        states,
        tuple(messages),
        counters,
        motion.records.times(members, len(ensemble)),
        notes=tuple(motion.decisions.several[k] for k in sorted(motion.decisions.several)),
        path=None if path is None else path.placed(members),
    )


def motion_in_segments(ensemble: Batch, times: Array, rtol: float, *, stages: int = 0) -> SegmentedMotion:
    """Integrate one realisation from event to event, implicitly with `stages`; see `SegmentedMotion`."""
    _require_compiled(ensemble)
    motion = EventDrivenMotion(ensemble, times, rtol, ContactEvaluator(ensemble.model), stages=stages)
    with np.errstate(all="ignore"):
        return followed_segments(motion)


def event_times(ensemble: Batch, happened: Mapping[int, Sequence[tuple[float, int, str]]]) -> dict[str, Array]:
    """Find the times of all events by name; see `uqmbd.extend.Ensemble.event_times`."""
    names: dict[tuple[str, str], int] = {}
    events = [
        (member, time, names.setdefault((ensemble.model.events[event][0], label), len(names)))
        for member, found in happened.items()
        for time, event, label in found
    ]
    if not events:
        return {}
    members, times, kinds = (np.array(x) for x in zip(*events, strict=True))
    return named_times(members, times, kinds, list(names), len(ensemble))


def _require_compiled(ensemble: Batch) -> None:
    system = ensemble.model.system
    if system is None or system.programs is None:
        raise StudyError(
            f"mechanism {ensemble.model.name!r} has events, which need compiled accelerations. These cannot be "
            "compiled: the mechanism is too large, or bodies without mass are free to move. Simplify the mechanism, "
            "or give these bodies mass."
        )
