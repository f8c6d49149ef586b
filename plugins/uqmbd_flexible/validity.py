"""Range in which the theory of small deflections about a floating frame is valid."""

from __future__ import annotations

from typing import Any

import numpy as np

from uqmbd_flexible.modal_model import ModalModel

__all__ = ["SLOW", "SMALL", "largest_speed", "relative_deflections"]

TANGENTS = 50
"""Number of nodes whose tangents are compared with the deflections of all nodes."""

SMALL = 0.1
"""Largest deflection, relative to the length of a body, up to which the theory of small deflections is used."""

SLOW = 0.25
"""Largest angular speed, relative to the lowest frequency of the held body, with small centrifugal stiffening.

Rotation at a speed W changes the lowest frequency w of a beam clamped on the axis of rotation: w^2 becomes
w^2 + 1.193 W^2 (Wright et al., Journal of Applied Mechanics 49, 1982). The neglected change of w is at most 3.7 %.
"""

CLAMPED = 3.516 / 22.373
"""Lowest frequency of a uniform beam clamped at one end, relative to that of the free beam."""

MEAN_AXES = 1e-9
"""Largest integrals of the shapes, relative to the mass, of a model whose frame follows the mean motion of the body."""


def largest_speed(model: ModalModel, fraction: float) -> float:
    """Return a fraction of the lowest frequency of the held body, rad/s.

    A model in mean axes has the frequencies of the free body, from which that of the held body is estimated.
    """
    size = MEAN_AXES * model.mass * np.array([1.0, max(model.length, 1e-300)])
    free = np.abs(model.translation).max() <= size[0] and np.abs(model.rotation).max() <= size[1]
    return fraction * 2 * np.pi * float(model.frequencies[0]) * (CLAMPED if free else 1.0)


def relative_deflections(model: ModalModel) -> Any:
    """Return the largest deflection of a node relative to another node, and to its tangent, in each mode, (mode,)."""
    shapes = list({id(x): x for x in model.nodes.values()}.values())
    found = np.ones(model.modes)
    if not shapes:
        return found
    moved, places = np.array([x.translation for x in shapes]), np.array([x.position for x in shapes])
    found = np.maximum(found, np.linalg.norm(np.ptp(moved, axis=0), axis=0))
    for base in [x for x in shapes if x.rotation is not None][:: max(1, len(shapes) // TANGENTS)]:
        arms, turn = places - base.position, np.asarray(base.rotation)
        if model.dimension == 2:
            carried = np.stack([-arms[:, 1], arms[:, 0]], axis=1)[:, :, None] * turn[0]
        else:
            carried = np.cross(turn.T[None], arms[:, None]).transpose(0, 2, 1)
        found = np.maximum(found, np.linalg.norm(moved - base.translation - carried, axis=1).max(axis=0))
    return found
