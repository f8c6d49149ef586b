"""Contacts, impacts, and integration from event to event."""

from __future__ import annotations

from uqmbd.dynamics.contact.evaluator import ContactEvaluator
from uqmbd.dynamics.contact.impacts import impact
from uqmbd.dynamics.contact.integrate import event_times, integrate_with_events, motion_in_segments
from uqmbd.dynamics.contact.persistent import states_in_contact
from uqmbd.dynamics.contact.programs import contact_programs
from uqmbd.dynamics.contact.undetermined import undetermined_forces

__all__ = [
    "ContactEvaluator",
    "contact_programs",
    "event_times",
    "impact",
    "integrate_with_events",
    "motion_in_segments",
    "states_in_contact",
    "undetermined_forces",
]
