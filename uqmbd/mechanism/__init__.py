"""What a user describes: mechanism, bodies, components, outputs.  Symbolic and declarative; no numbers are crunched."""

from __future__ import annotations

from uqmbd.mechanism.body import Body, Ground
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
    Separation,
    Upright,
    VirtualWork,
)
from uqmbd.mechanism.components.turn_counting import counted_angle, half_angle
from uqmbd.mechanism.expressions.time import step, t
from uqmbd.mechanism.expressions.timeless import (
    AtEquilibrium,
    EventTime,
    MotionSymbol,
    ScalarSymbol,
    at_equilibrium,
    damping_ratio,
    eigenfrequency,
)
from uqmbd.mechanism.geometry.frame import Frame
from uqmbd.mechanism.geometry.quaternions import (
    aligned,
    joint_frames,
    nominal,
    perpendiculars,
    quaternion_product,
    relative_quaternion,
    smallest_rotation,
)
from uqmbd.mechanism.geometry.space import Planar, Space, Spatial, Translational
from uqmbd.mechanism.mechanism import Mechanism, Output

__all__ = [
    "AtEquilibrium",
    "Auxiliary",
    "Body",
    "Component",
    "Constraint",
    "Frame",
    "Ground",
    "Event",
    "Impact",
    "Kinetic",
    "Local",
    "Mechanism",
    "EventTime",
    "MotionSymbol",
    "Output",
    "Parameter",
    "Planar",
    "Potential",
    "ScalarSymbol",
    "Separation",
    "Space",
    "Spatial",
    "Translational",
    "Upright",
    "VirtualWork",
    "aligned",
    "at_equilibrium",
    "counted_angle",
    "damping_ratio",
    "eigenfrequency",
    "half_angle",
    "joint_frames",
    "nominal",
    "perpendiculars",
    "quaternion_product",
    "relative_quaternion",
    "smallest_rotation",
    "step",
    "t",
]
