"""Realisations compared at landmarks instead of at equal times: events, equal phases of a clock, or both."""

from __future__ import annotations

from uqmbd_collocation.alignment.aligned_elements import align
from uqmbd_collocation.alignment.combined_paths import CombinedPaths
from uqmbd_collocation.alignment.event_paths import EventPaths
from uqmbd_collocation.alignment.impossible import Impossible
from uqmbd_collocation.alignment.merging import merged
from uqmbd_collocation.alignment.phase_paths import PhasePaths

__all__ = ["CombinedPaths", "EventPaths", "Impossible", "PhasePaths", "align", "merged"]
