"""Contacts: compliant ones with four laws of the normal force, and impacts of rigid bodies; Coulomb friction."""

from __future__ import annotations

import uqmbd
from uqmbd_contact.contacts import ClearanceJoint, PlaneContact, RoadContact, SphereContact
from uqmbd_contact.impacts import PlaneImpact, RoadImpact, SphereImpact
from uqmbd_contact.profile import distance

__all__ = [
    "ClearanceJoint",
    "PlaneContact",
    "PlaneImpact",
    "RoadContact",
    "RoadImpact",
    "SphereContact",
    "SphereImpact",
    "distance",
]


@uqmbd.hookimpl
def uqmbd_components() -> list[type[uqmbd.Component]]:
    """Return the contacts of this package."""
    return [ClearanceJoint, PlaneContact, PlaneImpact, RoadContact, RoadImpact, SphereContact, SphereImpact]
