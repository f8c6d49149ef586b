"""Joints between bodies; each class defines only the geometry of one joint."""

from __future__ import annotations

import uqmbd
from uqmbd_joints.cylindrical import Cylindrical
from uqmbd_joints.distance import Distance
from uqmbd_joints.fixed import Fixed
from uqmbd_joints.gears import Gear, RackAndPinion
from uqmbd_joints.parallel1 import Parallel1
from uqmbd_joints.points import PointOnLine, PointOnPlane
from uqmbd_joints.primitives import Dot1, Dot2, Parallel2
from uqmbd_joints.prismatic import Prismatic
from uqmbd_joints.revolute import Revolute
from uqmbd_joints.revolute_spherical import RevoluteSpherical
from uqmbd_joints.rolling import RollingSphere, RollingWheel, Skate
from uqmbd_joints.screw import Screw
from uqmbd_joints.spherical import Spherical
from uqmbd_joints.universal import Universal

__all__ = [
    "Cylindrical",
    "Distance",
    "Dot1",
    "Dot2",
    "Fixed",
    "Gear",
    "Parallel1",
    "Parallel2",
    "PointOnLine",
    "PointOnPlane",
    "Prismatic",
    "RackAndPinion",
    "Revolute",
    "RevoluteSpherical",
    "RollingSphere",
    "RollingWheel",
    "Screw",
    "Skate",
    "Spherical",
    "Universal",
]


@uqmbd.hookimpl
def uqmbd_components() -> list[type[uqmbd.Component]]:
    """Return the joints of this package."""
    return [
        Cylindrical,
        Distance,
        Dot1,
        Dot2,
        Fixed,
        Gear,
        Parallel1,
        Parallel2,
        PointOnLine,
        PointOnPlane,
        Prismatic,
        RackAndPinion,
        Revolute,
        RevoluteSpherical,
        RollingSphere,
        RollingWheel,
        Screw,
        Skate,
        Spherical,
        Universal,
    ]
