"""Content of a model file, in plain numbers: links, joints, couplings and loops, as the builder needs them."""

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
    """A body."""

    name: str
    parent: int  # among the links; the ground is 0
    # position, quaternion: of its frame in that of its parent, where all joints are at their reference
    position: Array
    quaternion: Array
    inertial: Inertial  # kg, m, kg m^2
    compensation: float = 0.0  # as much of its weight is compensated, 1: all
    line: int = 0  # of the file, where it begins; 0: not known


@dataclass(frozen=True)
class TreeJoint:
    """Freedom of a link; several of one link follow each other."""

    name: str
    kind: str
    link: int  # the link that moves
    # point, axis: (3,), in the frame of the link
    point: Array
    axis: Array
    reference: Array  # its position where the link is at its place in the parent: one number, a quaternion, or a pose
    start: Array  # its position at the start, of the same form
    speed: Array  # its speed at the start: 1, 3 or 6 numbers
    limits: tuple[float, float] | None = None
    # stiffness, rest: spring rate, and the position without force
    stiffness: float = 0.0
    rest: Array = field(default_factory=lambda: np.zeros(1))
    # damping, friction, inertia: viscous, of Coulomb, and of a rotor: of each of its freedoms
    damping: float = 0.0
    friction: float = 0.0
    inertia: float = 0.0


@dataclass(frozen=True)
class LoopClosure:
    """Two points that coincide, of bodies which keep a relative rotation as well where there is one."""

    name: str
    link_i: int
    link_j: int
    point_i: Array
    point_j: Array
    rotation: Array | None = None


@dataclass(frozen=True)
class Coupling:
    """A joint whose position is a polynomial in that of another one, or constant.

    From their references on: ``q_1 = coefficients[0] + coefficients[1] q_2 + ...``.
    """

    name: str
    joint: str
    other: str | None
    coefficients: tuple[float, ...]


@dataclass(frozen=True)
class Tree:
    """A model: links (the ground is the first), joints, loops, and the omitted parts."""

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
    """Return the joints that a mechanism represents in another form."""
    limited = tuple(joint.name for joint in joints if joint.limits)
    dry = tuple(joint.name for joint in joints if joint.friction)
    rows = [
        ("limits of joints", limited, "nothing stops there; their margins are outputs"),
        ("dry friction", dry, "taken as smooth friction, which creeps where it should stick; see RotationalFriction"),
    ]
    return [uqmbd.extend.Omission(what, names, why) for what, names, why in rows if names]
