"""Joints: what holds bodies together.  Each is its geometry, and nothing else."""

from __future__ import annotations

import uqmbd
from uqmbd_joints.distance import Distance
from uqmbd_joints.fixed import Fixed
from uqmbd_joints.prismatic import Prismatic
from uqmbd_joints.revolute import Revolute
from uqmbd_joints.spherical import Spherical

__all__ = ["Distance", "Fixed", "Prismatic", "Revolute", "Spherical"]


@uqmbd.hookimpl
def uqmbd_components() -> list[type[uqmbd.Component]]:
    """Return the joints of this package."""
    return [Distance, Fixed, Prismatic, Revolute, Spherical]
