"""Comparison of realisations at markers (events, equal phases of a clock, or both) instead of equal times."""

from __future__ import annotations

from uqmbd_collocation.alignment.aligned_elements import align, followed
from uqmbd_collocation.alignment.choice import Runs, chosen_over_time, runs_in_words, taken_values
from uqmbd_collocation.alignment.combined_trajectories import CombinedTrajectories
from uqmbd_collocation.alignment.event_trajectories import EventTrajectories
from uqmbd_collocation.alignment.impossible import EndsEarlyWarning, Impossible
from uqmbd_collocation.alignment.merging import merged
from uqmbd_collocation.alignment.phase_trajectories import PhaseTrajectories

__all__ = [
    "CombinedTrajectories",
    "EndsEarlyWarning",
    "EventTrajectories",
    "Impossible",
    "PhaseTrajectories",
    "Runs",
    "align",
    "chosen_over_time",
    "followed",
    "merged",
    "runs_in_words",
    "taken_values",
]
