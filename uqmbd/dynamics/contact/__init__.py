"""Contacts, impacts, and integration from event to event."""

from __future__ import annotations

from uqmbd.dynamics.contact.contacts import Lens, lasting
from uqmbd.dynamics.contact.integrate import integrate_with_events, motion_in_segments

__all__ = [
    "Lens",
    "integrate_with_events",
    "lasting",
    "motion_in_segments",
]
