"""Merging of links without joints with the links to which they are fixed; the motion does not change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from uqmbd_models.rotations import matrix, product, turned
from uqmbd_models.tree import Array, Inertial, LoopClosure, Tree

__all__ = ["Fused", "fuse"]


@dataclass(frozen=True)
class Fused:
    """Merged link: its new link, and the pose of its frame in this link."""

    name: str
    link: int
    position: Array
    quaternion: Array


def fuse(tree: Tree, *, every: bool) -> tuple[Tree, tuple[Fused, ...]]:
    """Merge links that are fixed to another link or to the ground.

    `tree`: model; `every`: if false, merge only links without mass and inertia, and links fixed to the ground.
    """
    moving = {joint.link for joint in tree.joints}
    home: dict[int, tuple[int, Array, Array]] = {0: (0, np.zeros(3), np.array([1.0, 0, 0, 0]))}
    for k, link in enumerate(tree.links[1:], 1):
        into, position, quaternion = home[link.parent]
        here = position + turned(quaternion, link.position), product(quaternion, link.quaternion)
        light = not (link.inertial.mass or link.inertial.inertia.any())
        alike = light or link.compensation == tree.links[into].compensation
        fixed = k not in moving and (into == 0 or light or (every and alike))
        home[k] = (into, *here) if fixed else (k, np.zeros(3), np.array([1.0, 0, 0, 0]))
    kept = [k for k in range(len(tree.links)) if home[k][0] == k]
    number = {k: n for n, k in enumerate(kept)}
    parts: dict[int, list[Inertial]] = {k: [] for k in kept}
    for k, link in enumerate(tree.links):
        into, position, quaternion = home[k]
        if into and k != into:
            parts[into].append(_in_frame(link.inertial, position, quaternion))
    links = []
    for k in kept:
        link = tree.links[k]
        into, position, quaternion = home[link.parent]
        links.append(
            replace(
                link,
                inertial=_sum([link.inertial, *parts[k]]) if parts[k] else link.inertial,
                parent=number[into],
                position=position + turned(quaternion, link.position),
                quaternion=product(quaternion, link.quaternion),
            )
        )
    loops = tuple(_in_remaining_links(loop, home, number) for loop in tree.loops)
    joints = tuple(replace(joint, link=number[joint.link]) for joint in tree.joints)
    fused = tuple(
        Fused(tree.links[k].name, number[into], position, quaternion)
        for k, (into, position, quaternion) in home.items()
        if k != into
    )
    return replace(tree, links=tuple(links), joints=joints, loops=loops), fused


def _in_frame(inertial: Inertial, position: Array, quaternion: Array) -> Inertial:
    """Return mass, centre and inertia in another frame."""
    turn = matrix(quaternion)
    return Inertial(inertial.mass, position + turn @ inertial.com, turn @ inertial.inertia @ turn.T)


def _sum(parts: Sequence[Inertial]) -> Inertial:
    """Return the sum of inertias in one frame."""
    mass = sum(part.mass for part in parts)
    com = sum((part.mass * part.com for part in parts), np.zeros(3)) / mass if mass else parts[0].com
    inertia = np.zeros((3, 3))
    for part in parts:
        arm = part.com - com
        inertia += part.inertia + part.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return Inertial(mass, com, inertia)


def _in_remaining_links(
    loop: LoopClosure, home: dict[int, tuple[int, Array, Array]], number: dict[int, int]
) -> LoopClosure:
    """Return a loop in the frames of the remaining links."""
    (i, position_i, turn_i), (j, position_j, turn_j) = home[loop.link_i], home[loop.link_j]
    rotation = None
    if loop.rotation is not None:
        rotation = product(product(turn_i, loop.rotation), turn_j * (1, -1, -1, -1))
    return replace(
        loop,
        link_i=number[i],
        link_j=number[j],
        point_i=position_i + turned(turn_i, loop.point_i),
        point_j=position_j + turned(turn_j, loop.point_j),
        rotation=rotation,
    )
