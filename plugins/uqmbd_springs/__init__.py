"""Springs, dampers and loads."""

from __future__ import annotations

import uqmbd
from uqmbd_springs.loads import PointForce, Torque
from uqmbd_springs.spring import SpringDamper
from uqmbd_springs.torsion import TorsionSpringDamper

__all__ = ["PointForce", "SpringDamper", "Torque", "TorsionSpringDamper"]


@uqmbd.hookimpl
def uqmbd_components() -> list[type[uqmbd.Component]]:
    """Return the springs and loads of this package."""
    return [PointForce, SpringDamper, Torque, TorsionSpringDamper]
