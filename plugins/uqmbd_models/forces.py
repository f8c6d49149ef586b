"""Forces in joints: springs, dampers, friction and rotors."""

from __future__ import annotations

from typing import Any

from uqmbd_models.motion import PlacedJoint
from uqmbd_models.names import Names
from uqmbd_springs import (
    RotationalFriction,
    RotorInertia,
    SlidingFriction,
    SlidingInertia,
    SlidingSpringDamper,
    SpringDamper,
    TorsionSpringDamper,
)

__all__ = ["add_forces"]

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}

SMOOTH = 0.01
"""Transition speed of imported dry friction, rad/s or m/s: imported friction is smooth, because all methods support
it."""


def add_forces(mechanism: Any, names: Names, placed: PlacedJoint, parent: Any, body: Any, zero: float | None) -> None:
    """Add spring, friction and rotor of a joint, for each of its freedoms.

    `parent`, `body`: bodies connected by the joint; `zero`: position of a hinge or slide in the file at zero position
    of the component.
    """
    joint = placed.joint
    if joint.kind == "hinge":
        _add_rotational(mechanism, names, placed, parent, body, "", placed.axis_i)
        if joint.stiffness:
            free = float(joint.rest[0] - (zero or 0.0))
            spring = TorsionSpringDamper(
                names.take(f"{placed.name}_spring"), parent, body, stiffness=joint.stiffness, free_angle=free,
                axis_i=placed.axis_i, axis_j=placed.axis_j,
            )  # fmt: skip
            mechanism.add(spring)
    elif joint.kind == "slide":
        points = {"point_i": placed.point_i, "point_j": placed.point_j}
        _add_sliding(mechanism, names, placed, parent, body, "", placed.axis_i, points)
        if joint.stiffness:
            free = float(joint.rest[0] - (zero or 0.0))
            spring_at = SlidingSpringDamper(
                names.take(f"{placed.name}_spring"), parent, body, placed.point_i, placed.point_j,
                axis_i=placed.axis_i, stiffness=joint.stiffness, free_displacement=free,
            )  # fmt: skip
            mechanism.add(spring_at)
    else:
        for letter, axis in AXES.items():
            # speeds of a ball joint are about the axes of the moving body
            _add_rotational(mechanism, names, placed, body, parent, f"_{letter}", axis)
        if joint.kind == "free":
            points = {"point_i": (0.0,) * 3, "point_j": (0.0,) * 3}
            for letter, axis in AXES.items():
                _add_sliding(mechanism, names, placed, parent, body, f"_along_{letter}", axis, points)
            if joint.stiffness:
                rest = tuple(map(float, joint.rest[:3]))
                name = names.take(f"{placed.name}_spring")
                mechanism.add(SpringDamper(name, parent, body, rest, (0, 0, 0), stiffness=joint.stiffness))


def _add_rotational(mechanism: Any, names: Names, placed: PlacedJoint, i: Any, j: Any, letter: str, axis: Any) -> None:
    """Add friction and rotor about an axis of body i."""
    joint = placed.joint
    if joint.damping or joint.friction:
        name = names.take(f"{placed.name}_friction{letter}")
        rubs = {"damping": joint.damping, "transition": SMOOTH, "axis_i": axis}
        mechanism.add(RotationalFriction(name, i, j, joint.friction, **rubs))
    if joint.inertia:
        name = names.take(f"{placed.name}_rotor{letter}")
        mechanism.add(RotorInertia(name, i, j, joint.inertia, axis_i=axis))


def _add_sliding(
    mechanism: Any, names: Names, placed: Any, i: Any, j: Any, letter: str, axis: Any, points: Any
) -> None:
    """Add friction and inertia along an axis of body i."""
    joint = placed.joint
    if joint.damping or joint.friction:
        name = names.take(f"{placed.name}_friction{letter}")
        rubs = {"friction": joint.friction, "damping": joint.damping, "transition": SMOOTH}
        mechanism.add(SlidingFriction(name, i, j, **points, axis_i=axis, **rubs))
    if joint.inertia:
        name = names.take(f"{placed.name}_rotor{letter}")
        mechanism.add(SlidingInertia(name, i, j, **points, axis_i=axis, mass=joint.inertia))
