"""Bodies, the ground, and the inertia of bodies: checks and random inertia."""

from __future__ import annotations

from uqmbd.mechanism.bodies.attached_frame import AttachedFrame, carrier_name, flow_of, local_in_body, owners_in
from uqmbd.mechanism.bodies.body import Body, BodyPose, BodyTerms, Ground
from uqmbd.mechanism.bodies.inertia import inertia_entries, is_tensor_of_body, mass_number, orientation
from uqmbd.mechanism.bodies.inertia_ensemble import MassProperties, random_body_inertia, random_inertia

__all__ = [
    "Body",
    "BodyTerms",
    "Ground",
    "MassProperties",
    "BodyPose",
    "AttachedFrame",
    "carrier_name",
    "flow_of",
    "local_in_body",
    "owners_in",
    "inertia_entries",
    "is_tensor_of_body",
    "mass_number",
    "orientation",
    "random_body_inertia",
    "random_inertia",
]
