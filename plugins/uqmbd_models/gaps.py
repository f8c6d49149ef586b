"""Check of loops and couplings at the start configuration of the file."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import uqmbd
from uqmbd_models.motion import FramePose
from uqmbd_models.rotations import inverse, product
from uqmbd_models.tree import Tree

__all__ = ["list_gaps"]

CLOSED = 1e-6
"""Largest gap that counts as a rounding error, in rad or relative to the size of the model."""


def list_gaps(tree: Tree, poses: dict[int, FramePose]) -> list[uqmbd.extend.Omission]:
    """Return the loops and couplings that are open at the start configuration, with their gaps.

    `tree`: model; `poses`: poses of its links at the start.
    """
    places = [link.position for link in tree.links] + [x for loop in tree.loops for x in (loop.point_i, loop.point_j)]
    size = {"rad": 1.0, "m": max(float(np.linalg.norm(x)) for x in places) or 1.0}
    found = tuple(
        f"{name} by {gap:.3g} {units}" for name, gap, units in _yield_gaps(tree, poses) if gap > CLOSED * size[units]
    )
    why = (
        "the assembly moves joints until these constraints are satisfied, so the start configuration "
        "differs from the file"
    )
    return [uqmbd.extend.Omission("constraints violated in the start configuration", found, why)] if found else []


def _yield_gaps(tree: Tree, poses: dict[int, FramePose]) -> Iterator[tuple[str, float, str]]:
    """Yield name, gap and units of loops and couplings."""
    for loop in tree.loops:
        i, j = poses[loop.link_i], poses[loop.link_j]
        yield loop.name, float(np.linalg.norm(i.point(loop.point_i) - j.point(loop.point_j))), "m"
        if loop.rotation is not None:
            wanted = product(i.quaternion, loop.rotation / np.linalg.norm(loop.rotation))
            turn = product(inverse(wanted), j.quaternion)
            yield loop.name, float(2 * np.arctan2(np.linalg.norm(turn[1:]), abs(turn[0]))), "rad"
    moved = {joint.name: float(joint.start[0] - joint.reference[0]) for joint in tree.joints}
    units = {joint.name: "rad" if joint.kind == "hinge" else "m" for joint in tree.joints}
    for coupling in tree.couplings:
        other = 0.0 if coupling.other is None else moved[coupling.other]
        wanted_at = float(np.polynomial.polynomial.polyval(other, coupling.coefficients))
        yield coupling.name, abs(moved[coupling.joint] - wanted_at), units[coupling.joint]
