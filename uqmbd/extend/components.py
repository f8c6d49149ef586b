"""Names for plugins that add joints, drivers, springs, loads and contacts: frames, rotations, declared terms."""

from __future__ import annotations

from uqmbd.mechanism import AttachedFrame as AttachedFrame
from uqmbd.mechanism import Coordinate as Coordinate
from uqmbd.mechanism import DryFriction as DryFriction
from uqmbd.mechanism import Frame as Frame
from uqmbd.mechanism import Impact as Impact
from uqmbd.mechanism import JointAngle as JointAngle
from uqmbd.mechanism import JointDisplacement as JointDisplacement
from uqmbd.mechanism import Local as Local
from uqmbd.mechanism import NamedFrame as NamedFrame
from uqmbd.mechanism import Requirement as Requirement
from uqmbd.mechanism import Separation as Separation
from uqmbd.mechanism import TypedComponent as TypedComponent
from uqmbd.mechanism import VelocityConstraint as VelocityConstraint
from uqmbd.mechanism import aligned as aligned
from uqmbd.mechanism import counted_angle as counted_angle
from uqmbd.mechanism import half_angle as half_angle
from uqmbd.mechanism import joint_frames as joint_frames
from uqmbd.mechanism import numbers as numbers
from uqmbd.mechanism import perpendiculars as perpendiculars
from uqmbd.mechanism import quaternion_product as quaternion_product
from uqmbd.mechanism import relative_quaternion as relative_quaternion
from uqmbd.mechanism import smallest_rotation as smallest_rotation
