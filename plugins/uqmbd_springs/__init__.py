"""Springs, dampers and loads."""

from __future__ import annotations

import uqmbd
from uqmbd_springs.bushing import Bushing
from uqmbd_springs.laws import NonlinearSpringDamper, NonlinearTorsionSpringDamper, length, rate
from uqmbd_springs.loads import PointForce, Torque
from uqmbd_springs.spring import SpringDamper
from uqmbd_springs.torsion import TorsionSpringDamper

__all__ = [
    "Bushing",
    "NonlinearSpringDamper",
    "NonlinearTorsionSpringDamper",
    "PointForce",
    "SpringDamper",
    "Torque",
    "TorsionSpringDamper",
    "length",
    "rate",
]


@uqmbd.hookimpl
def uqmbd_components() -> list[type[uqmbd.Component]]:
    """Return the springs and loads of this package."""
    return [
        Bushing,
        NonlinearSpringDamper,
        NonlinearTorsionSpringDamper,
        PointForce,
        SpringDamper,
        Torque,
        TorsionSpringDamper,
    ]
