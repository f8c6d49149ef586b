"""Event-driven integration of an ensemble: one realisation after the other, and the times of what happens."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.contact.evaluator import ContactEvaluator
from uqmbd.dynamics.contact.event_driven import EventDrivenMotion
from uqmbd.dynamics.contact.pieces import MotionPiece
from uqmbd.dynamics.integration import Counters, Segment, SegmentedMotion, Trajectories
from uqmbd.mechanism import event_name
from uqmbd.typing import Array

__all__ = ["event_times", "integrate_with_events", "motion_in_segments"]


def integrate_with_events(ensemble: Batch, times: Array, rtol: float) -> Trajectories:
    """Integrate all realisations of a model with events, one by one, by the explicit method."""
    begin = clock.perf_counter()
    states = np.full((len(ensemble), len(times), ensemble.model.layout.width), np.nan)
    messages, runs = list(ensemble.start.messages), dict[int, EventDrivenMotion]()
    evaluator = ContactEvaluator(ensemble.model)
    with np.errstate(all="ignore"):
        for member in np.flatnonzero(ensemble.start.ok).tolist():
            run = runs[member] = EventDrivenMotion(ensemble.select(np.array([member])), times, rtol, evaluator)
            run.run()
            states[member], messages[member] = run.states(), run.message
    counters = Counters(
        integrations=sum(len(r.pieces) for r in runs.values()),
        accelerations=sum(r.evaluations for r in runs.values()),
        steps=sum(r.steps for r in runs.values()),
        events=sum(len(r.records) for r in runs.values()),
        by_dop853=len(runs),
        seconds=clock.perf_counter() - begin,
    )
    happened = {k: [(r.time, r.event, r.label) for r in run.records] for k, run in runs.items()}
    return Trajectories(times, states, tuple(messages), counters, event_times(ensemble, happened))


def motion_in_segments(ensemble: Batch, times: Array, rtol: float) -> SegmentedMotion:
    """Follow one realisation from event to event; see `SegmentedMotion`."""
    run = EventDrivenMotion(ensemble, times, rtol, ContactEvaluator(ensemble.model))
    with np.errstate(all="ignore"):
        run.run()
    return SegmentedMotion(
        tuple(Segment(p.begin, p.end, _label(run, p), partial(run.observed, piece=p)) for p in run.pieces), run.message
    )


def _label(run: EventDrivenMotion, piece: MotionPiece) -> str:
    """Say what ended a piece of the motion."""
    names = [f"{run.ensemble.model.events[h.event][0]}: {h.label}" for h in run.records if h.time == piece.end]
    return ", ".join(dict.fromkeys(names)) or ("" if piece is run.pieces[-1] else "break")


def event_times(ensemble: Batch, happened: Mapping[int, Sequence[tuple[float, int, str]]]) -> dict[str, Array]:
    """Find the times of all events by name; see `uqmbd.Ensemble.event_times`."""
    found: dict[str, Array] = {}
    for member, events in happened.items():
        counts: dict[tuple[str, str], int] = {}
        for time, event, label in events:
            component = ensemble.model.events[event][0]
            number = counts[component, label] = counts.get((component, label), 0) + 1
            name = event_name(component, label, number)
            found.setdefault(name, np.full(len(ensemble), np.nan))[member] = time
    return found
