"""Drivers: motion prescribed as a function of time."""

from __future__ import annotations

import uqmbd
from uqmbd_drivers.position import DistanceDriver, PositionDriver
from uqmbd_drivers.rotation import RotationDriver

__all__ = ["DistanceDriver", "PositionDriver", "RotationDriver"]


@uqmbd.hookimpl
def uqmbd_components() -> list[type[uqmbd.Component]]:
    """Return the drivers of this package."""
    return [DistanceDriver, PositionDriver, RotationDriver]
