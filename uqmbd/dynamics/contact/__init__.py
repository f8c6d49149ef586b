"""Contacts, impacts, and integration from event to event."""

from __future__ import annotations

from uqmbd.dynamics.contact.evaluator import ContactEvaluator
from uqmbd.dynamics.contact.integrate import integrate_with_events, motion_in_segments
from uqmbd.dynamics.contact.lasting import states_in_contact

__all__ = [
    "ContactEvaluator",
    "integrate_with_events",
    "states_in_contact",
    "motion_in_segments",
]
