"""Inertia shape integrals of modes, from mass matrices of finite elements or from points with mass.

The velocity of all degrees of freedom is ``v = T V + R w + sum_k (E(w) shape_k q_k + shape_k q_k')``. ``T`` are unit
translations, ``R`` unit rotations about the origin. ``E(w)`` turns the displacement and the rotation at each node. The
kinetic energy ``v^T M v / 2`` contains all integrals as products of these fields with the mass matrix (nodal form of
the floating frame of reference: Zwoelfer and Gerstmayr, Acta Mechanica 231, 2020). For elements that contain rigid
motions exactly, such as isoparametric solids, these are the integrals of the continuum.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqmbd.typing import Array

__all__ = ["NodalLayout", "shape_integrals"]

Mass = Callable[[Array], Array]
"""Function that returns the product of the mass matrix and columns."""


@dataclass(frozen=True)
class NodalLayout:
    """Layout of degrees of freedom, node by node: translations and, if `turns`, rotations of each node."""

    nodes: Array  # (node, d)
    turns: bool

    @property
    def dimension(self) -> int:
        """Dimension of the space."""
        return int(self.nodes.shape[1])

    @property
    def rotations(self) -> int:
        """Number of rotations of a frame: 1 in the plane, 3 in space."""
        return 1 if self.dimension == 2 else 3

    @property
    def width(self) -> int:
        """Number of degrees of freedom of a node."""
        return self.dimension + (self.rotations if self.turns else 0)

    def parts(self, values: Array) -> tuple[Array, Array | None]:
        """Divide columns (dof, column) into translations (node, d, column) and rotations (node, r, column)."""
        table = values.reshape(len(self.nodes), self.width, -1)
        return table[:, : self.dimension], table[:, self.dimension :] if self.turns else None

    def translations(self) -> Array:
        """Return unit translations as columns, (dof, d)."""
        found = np.zeros((len(self.nodes), self.width, self.dimension))
        for a in range(self.dimension):
            found[:, a, a] = 1.0
        return found.reshape(-1, self.dimension)

    def turnings(self) -> Array:
        """Return unit rotations about the origin as columns, (dof, r)."""
        found = np.zeros((len(self.nodes), self.width, self.rotations))
        for a in range(self.rotations):
            found[:, : self.dimension, a] = crossed(a, self.nodes[:, :, None])[:, :, 0]
            if self.turns:
                found[:, self.dimension + a, a] = 1.0
        return found.reshape(-1, self.rotations)

    def turned(self, axis: int, shapes: Array) -> Array:
        """Return ``E_a shape`` of shapes (dof, mode): the axis crossed with displacement and rotation at each node."""
        moved, rotated = self.parts(shapes)
        found = [crossed(axis, moved)]
        if rotated is not None:
            found.append(crossed(axis, rotated) if self.dimension == 3 else np.zeros_like(rotated))
        return np.concatenate(found, axis=1).reshape(shapes.shape)


def crossed(axis: int, vectors: Array) -> Array:
    """Return a unit vector crossed with vectors (node, d, column); in the plane the axis is normal to it."""
    found = np.zeros_like(vectors)
    if vectors.shape[1] == 2:
        found[:, 0], found[:, 1] = -vectors[:, 1], vectors[:, 0]
        return found
    i, j = (axis + 1) % 3, (axis + 2) % 3
    found[:, i], found[:, j] = -vectors[:, j], vectors[:, i]
    return found


def shape_integrals(fields: NodalLayout, mass: Mass, shapes: Array) -> Mapping[str, Any]:
    """Return the integrals of `ModalModel` for shapes (dof, mode), by name."""
    moves, turns = fields.translations(), fields.turnings()
    spun = [fields.turned(a, shapes) for a in range(fields.rotations)]
    heavy_moves, heavy_turns, heavy_shapes = mass(moves), mass(turns), mass(shapes)
    heavy_spun = [mass(x) for x in spun]
    total = float(np.trace(moves.T @ heavy_moves)) / fields.dimension
    first = moves.T @ heavy_turns  # e_a . (e_b cross m c)
    if fields.dimension == 2:
        com = np.array([first[1, 0], -first[0, 0]]) / total
    else:
        com = np.array([first[1, 2] - first[2, 1], first[2, 0] - first[0, 2], first[0, 1] - first[1, 0]]) / (2 * total)
    return {
        "mass": total,
        "com": com,
        "inertia": turns.T @ heavy_turns,
        "modal_mass": shapes.T @ heavy_shapes,
        "translation": moves.T @ heavy_shapes,
        "rotation": turns.T @ heavy_shapes,
        "gyration": np.array([x.T @ heavy_shapes for x in spun]),
        "linear": np.array([[turns[:, a] @ x for x in heavy_spun] for a in range(fields.rotations)]),
        "quadratic": np.array([[x.T @ y for y in heavy_spun] for x in spun]),
    }
