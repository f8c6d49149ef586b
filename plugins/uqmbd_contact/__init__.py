"""Compliant contacts with a law of the normal force, impacts of rigid bodies, and Coulomb friction."""

from __future__ import annotations

import uqmbd
from uqmbd_contact.contacts import ClearanceJoint, PlaneContact, RoadContact, SphereContact
from uqmbd_contact.geometry import distance
from uqmbd_contact.impacts import PlaneImpact, RoadImpact, SphereImpact
from uqmbd_contact.laws import REGISTERED, ContactLaw, damping, depth, depth_rate, exponent, friction, speed, stiffness

__all__ = [
    "ClearanceJoint",
    "ContactLaw",
    "PlaneContact",
    "PlaneImpact",
    "RoadContact",
    "RoadImpact",
    "SphereContact",
    "SphereImpact",
    "damping",
    "depth",
    "depth_rate",
    "distance",
    "exponent",
    "friction",
    "speed",
    "stiffness",
]


@uqmbd.hookimpl
def uqmbd_components() -> list[type[uqmbd.Component]]:
    """Return the contacts of this package."""
    return [ClearanceJoint, PlaneContact, PlaneImpact, RoadContact, RoadImpact, SphereContact, SphereImpact]


@uqmbd.hookimpl
def uqmbd_contact_laws() -> list[type]:
    """Return the laws of contact of this package."""
    return REGISTERED
