"""Distances between two bodies with shapes, by python-fcl, with the precision of rounding errors for most shapes.

Spheres and capsules are points and segments with a radius; boxes and meshes are surfaces of triangles. fcl computes
distances of pairs of triangles directly (J. Pan, S. Chitta and D. Manocha, FCL: a general purpose library for collision
and proximity queries, 2012). For cylinders, fcl uses an iterative method with errors of 1e-6 of their size. Alternating
projections onto the two convex solids, with Anderson acceleration, reduce these errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

import uqmbd
from uqmbd.shapes import BodyShape, Box, Capsule, Cylinder, Mesh, Sphere
from uqmbd.typing import Array

__all__ = ["Solid", "distance", "solid_of"]

PRECISE = 1e-11
"""Difference of two bounds of a distance, relative to the size, at which alternating projections end."""

ROUNDS = 400
"""Largest number of alternating projections."""

MEMORY = 4
"""Number of earlier iterates of the Anderson acceleration."""

KINDS = (Box, Sphere, Capsule, Cylinder, Mesh)


@dataclass(frozen=True, eq=False)
class Solid:
    """Shape with numerical parameters, in the frame of its body."""

    kind: type[BodyShape]
    lengths: Array
    position: Array
    rotation: Array
    vertices: Array  # vertices of the triangles of a mesh, in the frame of the shape
    faces: Any

    @property
    def radius(self) -> float:
        """Radius around the core, m."""
        return float(self.lengths[0]) if self.kind in (Sphere, Capsule) else 0.0

    @cached_property
    def reach(self) -> float:
        """Largest distance of a point from the origin of the body, m."""
        return float(np.linalg.norm(self.position)) + self.size

    @cached_property
    def size(self) -> float:
        """Largest distance of a point from the origin of the shape, m."""
        if self.kind is Mesh:
            return float(np.linalg.norm(self.vertices, axis=1).max())
        half = self.lengths[1] / 2 if len(self.lengths) == 2 else 0.0
        if self.kind is Box:
            return float(np.linalg.norm(self.lengths)) / 2
        return float(self.lengths[0] + half)

    @cached_property
    def geometry(self) -> Any:
        """Object of fcl: the solid, or its core."""
        import fcl

        if self.kind is Cylinder:
            return fcl.Cylinder(*self.lengths.tolist())
        vertices, faces = self.core
        made = fcl.BVHModel()
        made.beginModel(len(vertices), len(faces))
        made.addSubModel(vertices, faces)
        made.endModel()
        return made

    @cached_property
    def core(self) -> tuple[Array, Any]:
        """Triangles of the core, which are degenerate for a point or a segment."""
        if self.kind is Mesh:
            return np.ascontiguousarray(self.vertices), np.ascontiguousarray(self.faces)
        if self.kind is Box:
            vertices, faces = Box((1, 1, 1)).surface([0, 0, 0, *self.lengths])
            return np.ascontiguousarray(vertices), np.ascontiguousarray(faces)
        half = self.lengths[1] / 2 if self.kind is Capsule else 0.0
        return np.array([[0, 0, -half], [0, 0, half], [0, 0, 0.0]]), np.array([[0, 1, 2]])

    @cached_property
    def tree(self) -> Any:
        """Geometry as a collision object of fcl."""
        import fcl

        return fcl.CollisionObject(self.geometry, fcl.Transform())

    def placed(self, rotation: Array, position: Array) -> tuple[Array, Array]:
        """Return rotation and position of the shape for a pose of its body."""
        return rotation @ self.rotation, rotation @ self.position + position

    def point(self) -> Array:
        """Return a point of the solid or its core, in its frame."""
        vertices, faces = self.core if self.kind is Mesh else (np.zeros((1, 3)), [[0]])
        first: Array = vertices[int(faces[0][0])]
        return first

    def encloses(self, place: Array) -> bool:
        """Return whether a point in the frame of the shape is inside its surface of triangles."""
        if self.kind is Box:
            return bool((abs(place) <= self.lengths / 2).all())
        if self.kind is not Mesh:
            return False
        a, b, c = (self.vertices[self.faces[:, k]] - place for k in range(3))
        la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
        triple = np.einsum("ij,ij->i", a, np.cross(b, c))
        dots = [np.einsum("ij,ij->i", *pair) for pair in ((a, b), (b, c), (c, a))]
        # A. van Oosterom and J. Strackee, The solid angle of a plane triangle, 1983
        angles = 2 * np.arctan2(triple, la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb)
        return abs(float(angles.sum())) > 2 * np.pi

    def project(self, place: Array) -> Array:
        """Return the nearest point of a convex core, in its frame; the caller adds the radius."""
        if self.kind is Box:
            return np.clip(place, -self.lengths / 2, self.lengths / 2)
        half = self.lengths[1] / 2 if self.kind in (Capsule, Cylinder) else 0.0
        along = float(np.clip(place[2], -half, half))
        if self.kind is not Cylinder:
            return np.array([0.0, 0.0, along])
        out = float(np.hypot(place[0], place[1]))
        share = min(1.0, float(self.lengths[0]) / out) if out > 0 else 1.0
        return np.array([share * place[0], share * place[1], along])

    def support(self, direction: Array) -> Array:
        """Return the point of the core that is furthest in a direction, in its frame."""
        if self.kind is Box:
            return np.where(direction >= 0, 0.5, -0.5) * self.lengths
        half = self.lengths[1] / 2 if self.kind in (Capsule, Cylinder) else 0.0
        end = np.array([0.0, 0.0, half if direction[2] >= 0 else -half])
        if self.kind is Cylinder:
            out = float(np.hypot(direction[0], direction[1]))
            end[:2] = self.lengths[0] * direction[:2] / out if out > 0 else 0.0
        return end


def solid_of(shape: BodyShape, values: Sequence[float]) -> Solid:
    """Return a shape with values of its expressions."""
    kind = next((one for one in KINDS if isinstance(shape, one)), None)
    if kind is None:
        raise uqmbd.StudyError(
            f"clearance: distances of the shape {shape!r} are unknown; expected a shape of uqmbd.shapes."
        )
    numbers = np.asarray(values, dtype=float)
    lengths = numbers[3:]
    vertices, faces = np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    if isinstance(shape, Mesh):
        vertices, faces = lengths[0] * shape.vertices, shape.faces
    return Solid(kind, lengths, numbers[:3], np.asarray(shape.rotation), vertices, faces)


def distance(first: Solid, second: Solid, pose: tuple[Array, Array], other: tuple[Array, Array]) -> float:
    """Return the distance of two solids in m, which is 0 if their surfaces touch; poses are rotations and positions."""
    import fcl

    places = [solid.placed(*where) for solid, where in ((first, pose), (second, other))]
    objects = [solid.tree for solid in (first, second)]
    for one, (rotation, position) in zip(objects, places, strict=True):
        one.setTransform(fcl.Transform(rotation, position))
    result = fcl.DistanceResult()
    found = float(fcl.distance(*objects, fcl.DistanceRequest(True), result))
    radii = first.radius + second.radius
    if found <= 0:
        return 0.0
    if Cylinder in (first.kind, second.kind) and Mesh not in (first.kind, second.kind):
        found = _improved(first, second, places, np.array(result.nearest_points[0]), found)
    return max(found - radii, 0.0)


def contains(first: Solid, second: Solid, pose: tuple[Array, Array], other: tuple[Array, Array]) -> bool:
    """Return whether one solid encloses a point of the other."""
    (one, p), (two, q) = first.placed(*pose), second.placed(*other)
    inside = first.encloses(one.T @ (two @ second.point() + q - p))
    return inside or second.encloses(two.T @ (one @ first.point() + p - q))


def _improved(first: Solid, second: Solid, places: list[tuple[Array, Array]], start: Array, found: float) -> float:
    """Return the distance of the cores of two convex solids by alternating projections from a point of the first."""
    (one, p), (two, q) = places
    size = first.size + second.size

    def onto(solid: Solid, rotation: Array, origin: Array, place: Array) -> Array:
        nearest: Array = rotation @ solid.project(rotation.T @ (place - origin)) + origin
        return nearest

    x = onto(first, one, p, start)
    history: list[tuple[Array, Array]] = []
    best = found
    for _ in range(ROUNDS):
        y = onto(second, two, q, x)
        image = onto(first, one, p, y)
        gap = y - image
        length = float(np.linalg.norm(gap))
        if length == 0:
            return 0.0
        u = gap / length
        # the two solids lie on both sides of a slab across u
        lower = float(u @ (two @ second.support(-two.T @ u) + q - one @ first.support(one.T @ u) - p))
        best = min(best, length)
        if best - lower <= PRECISE * size:
            break
        history = [*history, (x, image)][-MEMORY:]
        x = image
        if len(history) > 1:
            residuals = np.array([g - f for f, g in history])
            change = np.diff(residuals, axis=0).T
            share, *_ = np.linalg.lstsq(change, residuals[-1], rcond=1e-12)
            x = image - np.diff(np.array([g for _, g in history]), axis=0).T @ share
            x = onto(first, one, p, x)
    return best
