"""Integration of an ensemble with events: one realisation after the other, and the times of what happens."""

from __future__ import annotations

import time as clock

import numpy as np

from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.contact.contacts import Lens
from uqmbd.dynamics.contact.event_driven import Hybrid
from uqmbd.dynamics.integration import Counters, Solved
from uqmbd.mechanism.expressions import event_name
from uqmbd.typing import Array, Index

__all__ = ["event_times", "integrate_with_events"]


def integrate_with_events(ensemble: Batch, members: Index, times: Array, rtol: float) -> tuple[Solved, list[Hybrid]]:
    """Integrate assembled realisations of a model with events, one by one.

    Parameters
    ----------
    ensemble : Batch
        All realisations.
    members : array of int, shape (M,)
        Those to be integrated.
    times : array, shape (T,)
        Output times, s.
    rtol : float
        Relative tolerance.

    Returns
    -------
    Solved
        Like that of other integrators.
    list of Hybrid
        What happened to each, and its pieces.
    """
    begin = clock.perf_counter()
    states = np.full((len(members), len(times), ensemble.model.layout.width), np.nan)
    runs: list[Hybrid] = []
    lens = Lens(ensemble.model)
    with np.errstate(all="ignore"):
        for row, member in enumerate(members):
            run = Hybrid(ensemble.select(np.array([member])), times, rtol, lens)
            run.run()
            states[row] = run.states()
            runs.append(run)
    counters = Counters(
        integrations=sum(len(r.pieces) for r in runs),
        accelerations=sum(r.evaluations for r in runs),
        steps=sum(r.steps for r in runs),
        events=sum(len(r.happenings) for r in runs),
        seconds=clock.perf_counter() - begin,
    )
    return Solved(states, tuple(r.message for r in runs), counters), runs


def event_times(ensemble: Batch, members: Index, runs: list[Hybrid]) -> dict[str, Array]:
    """Find the times of all events by name, shape (K,); NaN where a realisation has no such event."""
    found: dict[str, Array] = {}
    for member, run in zip(members, runs, strict=True):
        counts: dict[tuple[str, str], int] = {}
        for happening in run.happenings:
            component = ensemble.model.events[happening.event][0]
            number = counts[component, happening.label] = counts.get((component, happening.label), 0) + 1
            name = event_name(component, happening.label, number)
            found.setdefault(name, np.full(len(ensemble), np.nan))[member] = happening.time
    return found
