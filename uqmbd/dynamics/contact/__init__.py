"""Contacts, impacts, and integration from event to event."""
