"""Poses and velocities of links at the start, from positions and velocities of their joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from uqmbd_models.rotations import about, inverse, product, turned
from uqmbd_models.tree import Array, Tree, TreeJoint

__all__ = ["PlacedLinks", "PlacedJoint", "FramePose", "place"]


@dataclass(frozen=True)
class FramePose:
    """Position, orientation and velocity of a frame in the world, with the angular velocity in its own axes."""

    position: Array
    quaternion: Array
    velocity: Array
    spin: Array
    moves: bool

    def point(self, local: Any) -> Array:
        """Return the world position of a point of the frame."""
        return self.position + turned(self.quaternion, local)


@dataclass(frozen=True)
class PlacedJoint:
    """Joint between two frames: a reference (the parent, or the previous part of the same link) and the moving part."""

    name: str  # name in the mechanism
    joint: TreeJoint
    # point and axis of the joint in the reference frame (i) and in the moving frame (j)
    point_i: tuple[float, ...]
    axis_i: tuple[float, ...]
    point_j: tuple[float, ...]
    axis_j: tuple[float, ...]
    turn: Array  # quaternion of the second frame relative to the first at the reference of the joint
    pose: FramePose  # initial pose of the moving frame


@dataclass(frozen=True)
class PlacedLinks:
    """All joints in the order of the links, and the pose of each link."""

    joints: tuple[PlacedJoint, ...]
    poses: dict[int, FramePose]


def place(tree: Tree, names: dict[int, str]) -> PlacedLinks:
    """Return the joints and the poses of links at the start.

    `tree`: model; `names`: names of its joints in the mechanism, by index.
    """
    zero, one = np.zeros(3), np.array([1.0, 0, 0, 0])
    poses = {0: FramePose(zero, one, zero, zero, False)}
    moving = any(np.any(joint.speed) for joint in tree.joints)
    found = []
    for k, link in enumerate(tree.links[1:], 1):
        pose, shift, turn = poses[link.parent], link.position, link.quaternion
        joints = [(n, joint) for n, joint in enumerate(tree.joints) if joint.link == k]
        for n, joint in joints:
            ends = shift + turned(turn, joint.point), turned(turn, joint.axis)
            pose = _moved(_carried(pose, shift, turn, moving), joint)
            (point_i, axis_i), point_j, axis_j = map(_numbers, ends), _numbers(joint.point), _numbers(joint.axis)
            found.append(PlacedJoint(names[n], joint, point_i, axis_i, point_j, axis_j, turn, pose))
            shift, turn = zero, one
        poses[k] = pose if joints else _carried(pose, shift, turn, moving)
    return PlacedLinks(tuple(found), poses)


def _carried(pose: FramePose, shift: Array, turn: Array, moving: bool) -> FramePose:
    """Return the pose of a frame that is fixed in another frame."""
    velocity = pose.velocity + turned(pose.quaternion, np.cross(pose.spin, shift))
    return FramePose(
        pose.point(shift), product(pose.quaternion, turn), velocity, turned(inverse(turn), pose.spin), moving
    )


def _moved(pose: FramePose, joint: TreeJoint) -> FramePose:
    """Return the pose of a frame after a joint has moved it from its reference."""
    if joint.kind == "free":
        quaternion = joint.start[3:] / np.linalg.norm(joint.start[3:])
        return FramePose(joint.start[:3], quaternion, joint.speed[:3], joint.speed[3:], pose.moves)
    if joint.kind == "slide":
        way = turned(pose.quaternion, joint.axis)
        position = pose.position + way * (joint.start[0] - joint.reference[0])
        carried = np.cross(turned(pose.quaternion, pose.spin), position - pose.position)
        return FramePose(
            position, pose.quaternion, pose.velocity + carried + way * joint.speed[0], pose.spin, pose.moves
        )
    anchor = pose.point(joint.point)
    at_anchor = pose.velocity + turned(pose.quaternion, np.cross(pose.spin, joint.point))
    if joint.kind == "hinge":
        turn, speed = about(joint.axis, joint.start[0] - joint.reference[0]), joint.axis * joint.speed[0]
    else:
        turn, speed = joint.start / np.linalg.norm(joint.start), joint.speed
    quaternion = product(pose.quaternion, turn)
    spin = turned(inverse(turn), pose.spin) + speed
    position = anchor - turned(quaternion, joint.point)
    return FramePose(
        position, quaternion, at_anchor - turned(quaternion, np.cross(spin, joint.point)), spin, pose.moves
    )


def _numbers(vector: Any) -> tuple[float, ...]:
    return tuple(map(float, vector))
