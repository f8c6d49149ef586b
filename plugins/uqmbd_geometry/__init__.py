"""Geometry of bodies: mass and inertia from mesh files, shapes of model files, and clearances between bodies.

trimesh reads meshes, and python-fcl computes distances: ``pip install uqmbd[geometry]``.
"""

from __future__ import annotations

import uqmbd
from uqmbd_geometry.checks import ClearanceTimes
from uqmbd_geometry.clearances import clearance, clearance_over_time
from uqmbd_geometry.meshes import from_mesh, read_mesh
from uqmbd_geometry.model_shapes import add_model_shapes

__all__ = ["add_model_shapes", "clearance", "clearance_over_time", "from_mesh", "read_mesh"]


@uqmbd.hookimpl
def uqmbd_checks() -> list[type]:
    """Return the checks of this package."""
    return [ClearanceTimes]
