"""Contacts, impacts, and integration from event to event."""

from __future__ import annotations

from uqmbd.dynamics.contact.contacts import Lens, lasting
from uqmbd.dynamics.contact.event_driven import Hybrid
from uqmbd.dynamics.contact.integrate import event_times, integrate_with_events

__all__ = [
    "Hybrid",
    "Lens",
    "event_times",
    "integrate_with_events",
    "lasting",
]
