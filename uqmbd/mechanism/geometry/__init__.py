"""Spaces, frames and rotations."""

from __future__ import annotations

from uqmbd.mechanism.geometry.angles import angle_at_start, continued
from uqmbd.mechanism.geometry.frame import Frame, NamedFrame
from uqmbd.mechanism.geometry.matrix import Matrix
from uqmbd.mechanism.geometry.quaternions import (
    aligned,
    joint_frames,
    nominal,
    perpendiculars,
    quaternion_of_matrix,
    quaternion_product,
    relative_quaternion,
    smallest_rotation,
    unit,
)
from uqmbd.mechanism.geometry.shapes import BodyShape, Box, Capsule, Cylinder, Mesh, Sphere, check_shapes
from uqmbd.mechanism.geometry.space import Line, Planar, Space, Spatial, Translational

__all__ = [
    "Box",
    "Capsule",
    "Cylinder",
    "Frame",
    "Line",
    "Matrix",
    "Mesh",
    "NamedFrame",
    "Planar",
    "BodyShape",
    "Space",
    "Spatial",
    "Sphere",
    "Translational",
    "aligned",
    "check_shapes",
    "angle_at_start",
    "continued",
    "joint_frames",
    "nominal",
    "perpendiculars",
    "quaternion_of_matrix",
    "quaternion_product",
    "relative_quaternion",
    "smallest_rotation",
    "unit",
]
