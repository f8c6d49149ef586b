"""Content of a model file as numbers: links, joints, couplings and loops for the builder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

import uqmbd

__all__ = ["Array", "Coupling", "Inertial", "TreeJoint", "Link", "LoopClosure", "Tree", "remarks"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Inertial:
    """Mass, centre of mass in the frame of the link, and inertia about it in the axes of the link."""

    mass: float
    com: Array
    inertia: Array


@dataclass(frozen=True)
class Link:
    """Link, which becomes a body."""

    name: str
    parent: int  # index of the parent link; the ground is 0
    # pose of the link's frame in the frame of its parent, with all joints at their reference
    position: Array
    quaternion: Array
    inertial: Inertial  # kg, m, kg m^2
    compensation: float = 0.0  # share of the weight that is compensated; 1: all of it
    line: int = 0  # first line in the file; 0: unknown


@dataclass(frozen=True)
class TreeJoint:
    """Joint of a link; a link can have several joints in sequence."""

    name: str
    kind: str
    link: int  # index of the moving link
    # point, axis: (3,), in the frame of the link
    point: Array
    axis: Array
    reference: Array  # joint position at the link's stated pose in the parent: one number, a quaternion, or a pose
    start: Array  # joint position at the start, in the same form
    speed: Array  # joint speed at the start: 1, 3 or 6 numbers
    limits: tuple[float, float] | None = None
    # stiffness, rest: spring rate, and position without force
    stiffness: float = 0.0
    rest: Array = field(default_factory=lambda: np.zeros(1))
    # damping, friction, inertia: viscous damping, Coulomb friction, and inertia of a rotor, for each freedom
    damping: float = 0.0
    friction: float = 0.0
    inertia: float = 0.0


@dataclass(frozen=True)
class LoopClosure:
    """Two coincident points of two bodies, with a fixed relative rotation if it is given."""

    name: str
    link_i: int
    link_j: int
    point_i: Array
    point_j: Array
    rotation: Array | None = None


@dataclass(frozen=True)
class Coupling:
    """Joint whose position is a polynomial in the position of another joint, or constant.

    Positions are relative to their references: ``q_1 = coefficients[0] + coefficients[1] q_2 + ...``.
    """

    name: str
    joint: str
    other: str | None
    coefficients: tuple[float, ...]


@dataclass(frozen=True)
class Tree:
    """Model: links (the first is the ground), joints, loops, and the omitted parts."""

    name: str
    source: str
    read_by: str
    gravity: Array
    links: tuple[Link, ...]
    joints: tuple[TreeJoint, ...]
    loops: tuple[LoopClosure, ...]
    couplings: tuple[Coupling, ...]
    omissions: tuple[uqmbd.extend.Omission, ...]


def remarks(joints: Sequence[TreeJoint]) -> list[uqmbd.extend.Omission]:
    """Return remarks on joints that a mechanism represents in another form."""
    limited = tuple(joint.name for joint in joints if joint.limits)
    dry = tuple(joint.name for joint in joints if joint.friction)
    rows = [
        ("limits of joints", limited, "uqmbd does not enforce them; outputs record the distances from the limits"),
        ("dry friction", dry, "imported as smooth friction, which creeps instead of sticking; see RotationalFriction"),
    ]
    return [uqmbd.extend.Omission(what, names, why) for what, names, why in rows if names]
