"""Drivers, which prescribe a motion as a function of time."""

from __future__ import annotations

import uqmbd
from uqmbd_drivers.position import DistanceDriver, PositionDriver
from uqmbd_drivers.rotation import RotationDriver
from uqmbd_drivers.speed import LinearSpeedDriver, SpeedDriver

__all__ = ["DistanceDriver", "LinearSpeedDriver", "PositionDriver", "RotationDriver", "SpeedDriver"]


@uqmbd.hookimpl
def uqmbd_components() -> list[type[uqmbd.Component]]:
    """Return the drivers of this package."""
    return [DistanceDriver, LinearSpeedDriver, PositionDriver, RotationDriver, SpeedDriver]
