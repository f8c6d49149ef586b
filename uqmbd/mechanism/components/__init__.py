"""Components: parameters, terms, values and bodies."""

from __future__ import annotations

from uqmbd.mechanism.components.auxiliary_state import AuxiliarySymbol, at_initial_values
from uqmbd.mechanism.components.component import (
    Auxiliary,
    Component,
    Constraint,
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
    "Event",
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
    "Term",
    "TypedComponent",
    "Upright",
    "VelocityConstraint",
    "VirtualWork",
    "angles_in",
    "counted_angle",
    "effective_parameters",
    "flatten",
    "half_angle",
    "known_effects",
    "law_at",
    "law_values",
    "motion_quantities",
    "no_effect",
    "range_text",
    "require_effects",
    "settle",
    "stated_in_bodies",
    "unseen_in",
]
