"""Event-driven integration of an ensemble, and the times of what happens."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence

import numpy as np

from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.contact.evaluator import ContactEvaluator
from uqmbd.dynamics.contact.event_driven import EventDrivenMotion
from uqmbd.dynamics.contact.records import named_times
from uqmbd.dynamics.contact.segments import followed_segments
from uqmbd.dynamics.integration import Counters, SegmentedMotion, Trajectories
from uqmbd.errors import StudyError
from uqmbd.typing import Array

__all__ = ["event_times", "integrate_with_events", "motion_in_segments"]


def integrate_with_events(ensemble: Batch, times: Array, rtol: float, *, recording: bool = False) -> Trajectories:
    """Integrate all realisations of a model with events by the explicit method; return steps, too, with `recording`."""
    begin = clock.perf_counter()
    _require_compiled(ensemble)
    states = np.full((len(ensemble), len(times), ensemble.model.layout.width), np.nan)
    messages, members = list(ensemble.start.messages), np.flatnonzero(ensemble.start.ok)
    if not len(members):
        return Trajectories(times, states, tuple(messages), Counters(seconds=clock.perf_counter() - begin))
    evaluator = ContactEvaluator(ensemble.model)
    motion = EventDrivenMotion(ensemble.select(members), times, rtol, evaluator, recording=recording)
    with np.errstate(all="ignore"):
        motion.follow()
    path = motion.run.recorder.found
    states[members] = motion.run.result
    for member, message in zip(members.tolist(), motion.messages, strict=True):
        messages[member] = message
    counters = Counters(
        integrations=int(motion.restarts.sum()),
        accelerations=motion.run.evaluations,
        steps=int(motion.run.steps.sum()),
        events=int(motion.records.count.sum()),
        by_dop853=len(members),
        seconds=clock.perf_counter() - begin,
    )
    return Trajectories(
        times,
        states,
        tuple(messages),
        counters,
        motion.records.times(members, len(ensemble)),
        path=None if path is None else path.placed(members),
    )


def motion_in_segments(ensemble: Batch, times: Array, rtol: float) -> SegmentedMotion:
    """Follow one realisation from event to event; see `SegmentedMotion`."""
    _require_compiled(ensemble)
    motion = EventDrivenMotion(ensemble, times, rtol, ContactEvaluator(ensemble.model))
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
            f"mechanism {ensemble.model.name!r} has events, and its accelerations cannot be compiled, without which "
            "no integrator of uqmbd follows events: it is too large, or bodies without mass are free to move."
        )
