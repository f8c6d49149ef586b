"""Readers of robots and linkages in URDF, and in MJCF by MuJoCo (extra ``mujoco``)."""

from __future__ import annotations

import uqmbd
from uqmbd_models.readers import MJCF, URDF

__all__ = ["MJCF", "URDF"]


@uqmbd.hookimpl
def uqmbd_readers() -> list[type]:
    """Return the readers of this package."""
    return [MJCF, URDF]
