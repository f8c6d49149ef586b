"""Components: parameters, terms, values and bodies."""

from __future__ import annotations

from uqmbd.mechanism.components.auxiliary_state import AuxiliarySymbol, at_initial_values, frames_of
from uqmbd.mechanism.components.component import (
    Auxiliary,
    Component,
    Constraint,
    DryFriction,
    Event,
    Impact,
    Kinetic,
    Local,
    Parameter,
    Potential,
    ReactionSymbol,
    Separation,
    Term,
    Upright,
    VelocityConstraint,
    VirtualWork,
    flatten,
)
from uqmbd.mechanism.components.coordinates import Coordinate, CoordinateSet, StateSymbol, coordinates_of, pairs_of
from uqmbd.mechanism.components.effects import effective_parameters, known_effects, no_effect, require_effects
from uqmbd.mechanism.components.joint_motion import (
    AngleSymbol,
    JointAngle,
    JointDisplacement,
    angles_in,
    motion_quantities,
)
from uqmbd.mechanism.components.parameter import range_text
from uqmbd.mechanism.components.parameter_values import settle, stated_in_bodies, unseen_in
from uqmbd.mechanism.components.reaction import ReactingComponent
from uqmbd.mechanism.components.turn_counting import counted_angle, half_angle
from uqmbd.mechanism.components.typed import TypedComponent
from uqmbd.mechanism.components.user_law import law_at, law_values

__all__ = [
    "AngleSymbol",
    "Auxiliary",
    "AuxiliarySymbol",
    "at_initial_values",
    "Component",
    "Constraint",
    "Coordinate",
    "CoordinateSet",
    "Event",
    "DryFriction",
    "Impact",
    "JointAngle",
    "JointDisplacement",
    "Kinetic",
    "ReactingComponent",
    "Local",
    "Parameter",
    "Potential",
    "ReactionSymbol",
    "Separation",
    "StateSymbol",
    "Term",
    "TypedComponent",
    "Upright",
    "VelocityConstraint",
    "VirtualWork",
    "angles_in",
    "coordinates_of",
    "counted_angle",
    "effective_parameters",
    "flatten",
    "frames_of",
    "half_angle",
    "known_effects",
    "law_at",
    "law_values",
    "motion_quantities",
    "no_effect",
    "pairs_of",
    "range_text",
    "require_effects",
    "settle",
    "stated_in_bodies",
    "unseen_in",
]
