"""Springs, dampers, friction, tyres and loads."""

from __future__ import annotations

import uqmbd
from uqmbd_springs.bushing import Bushing
from uqmbd_springs.friction import RotationalFriction, SlidingFriction
from uqmbd_springs.laws import NonlinearSpringDamper, NonlinearTorsionSpringDamper, length, rate
from uqmbd_springs.loads import FollowerForce, Gravity, PointForce, Torque
from uqmbd_springs.roads import distance, haversine_bump, sampled_road
from uqmbd_springs.rotors import RotorInertia, SlidingInertia
from uqmbd_springs.spring import SlidingSpringDamper, SpringDamper
from uqmbd_springs.torsion import TorsionSpringDamper
from uqmbd_springs.tyre import RadialTyre, RoadFollower

__all__ = [
    "Bushing",
    "FollowerForce",
    "Gravity",
    "NonlinearSpringDamper",
    "NonlinearTorsionSpringDamper",
    "PointForce",
    "RadialTyre",
    "RoadFollower",
    "RotationalFriction",
    "RotorInertia",
    "SlidingFriction",
    "SlidingInertia",
    "SlidingSpringDamper",
    "SpringDamper",
    "Torque",
    "TorsionSpringDamper",
    "distance",
    "haversine_bump",
    "length",
    "rate",
    "sampled_road",
]


@uqmbd.hookimpl
def uqmbd_components() -> list[type[uqmbd.Component]]:
    """Return the components of this package: springs, friction, tyres and loads."""
    return [
        Bushing,
        FollowerForce,
        Gravity,
        NonlinearSpringDamper,
        NonlinearTorsionSpringDamper,
        PointForce,
        RadialTyre,
        RoadFollower,
        RotationalFriction,
        RotorInertia,
        SlidingFriction,
        SlidingInertia,
        SlidingSpringDamper,
        SpringDamper,
        Torque,
        TorsionSpringDamper,
    ]
