"""Surfaces of the shapes of bodies, in coordinates relative to the corners of the boxes around the shapes.

The corners are drawn points of the bodies (`Mark` of the kind ``corner``, eight for each shape in the order of binary
numbers).  A vertex has coordinates from 0 to 1 between corners.  Drawings therefore need only the points of a pose.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.report.drawing import ROLES, mixed
from uqmbd.report.mechanisms.sheet import Shape, Sheet
from uqmbd.typing import Array

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.mechanism import Mark, Mechanism
    from uqmbd.report.mechanisms.pose_data import PoseData

__all__ = ["Solids", "collect_solids"]

MOST_FACES = 6000
"""Maximum number of triangles in the drawing of a mechanism; meshes are simplified to this number."""

LEVELS = 8
"""Number of shades of a face."""

SHADE = 0.75
"""Share of the colour of the body in its darkest faces."""


def collect_solids(mechanism: Mechanism, marks: Sequence[Mark]) -> dict[str, Any]:
    """Return the surfaces of all shapes as variables of a dataset; empty without shapes.

    ``solid_vertex`` (vertex, 3): coordinates between the corners of the shape. ``solid_corner`` (vertex): index of its
    first corner among the points. ``solid_face`` (face, 3): vertices of each triangle, anticlockwise from outside.
    """
    from uqmbd.mechanism import nominal

    shapes = [shape for body in mechanism.bodies.values() for shape in body.shapes]
    if not shapes:
        return {}
    firsts = [k for k, mark in enumerate(marks) if mark.kind == "corner"][::8]
    surfaces = []
    for shape in shapes:
        low, high = (np.array([float(nominal(x)) for x in end]) for end in shape.bounds)
        values = [0.0, 0.0, 0.0, *(float(nominal(x)) for x in shape.expressions[3:])]
        vertices, faces = shape.surface(values)
        size = np.where(high > low, high - low, 1.0)
        surfaces.append(((vertices @ shape.rotation - low) / size, faces))
    total = sum(len(faces) for _, faces in surfaces)
    if total > MOST_FACES:
        surfaces = [simplified(*one, max(200, MOST_FACES * len(one[1]) // total)) for one in surfaces]
    begins = np.cumsum([0, *(len(vertices) for vertices, _ in surfaces)])
    owners = [np.full(len(one[0]), first) for one, first in zip(surfaces, firsts, strict=True)]
    return {
        "solid_vertex": (("vertex", "side"), np.concatenate([one[0] for one in surfaces]).astype(np.float32)),
        "solid_corner": ("vertex", np.concatenate(owners).astype(np.int32)),
        "solid_face": (
            ("face", "corner"),
            np.concatenate([one[1] + k for one, k in zip(surfaces, begins[:-1], strict=True)]).astype(np.int32),
        ),
    }


def simplified(vertices: Array, faces: NDArray[np.int64], most: int) -> tuple[Array, NDArray[np.int64]]:
    """Merge the vertices of a mesh in each cell of a grid; the cell size is chosen so that at most `most` faces remain.

    Vertex clustering: J. Rossignac and P. Borrel, Multi-resolution 3D approximations for rendering, 1993.

    >>> turn, height = np.meshgrid(np.arange(64), np.linspace(0, 1, 33), indexing="ij")
    >>> angle = 2 * np.pi * turn.ravel() / 64
    >>> vertices = np.column_stack([np.cos(angle), np.sin(angle), height.ravel()])
    >>> quads = [(33 * a + z, 33 * ((a + 1) % 64) + z) for a in range(64) for z in range(32)]
    >>> faces = np.array([t for p, q in quads for t in ((p, q, q + 1), (p, q + 1, p + 1))])
    >>> len(faces), len(simplified(vertices, faces, 500)[1]) <= 500
    (4096, True)
    """
    cells = 256.0
    while len(faces) > most and cells >= 1:
        _, number = np.unique(np.floor(vertices * cells + 0.5).astype(np.int64), axis=0, return_inverse=True)
        number = number.ravel()
        merged = number[faces]
        distinct = (np.diff(np.sort(merged, axis=1), axis=1) > 0).all(axis=1)
        if np.count_nonzero(distinct) <= most:
            counts = np.bincount(number)
            middles = np.column_stack([np.bincount(number, vertices[:, k]) / counts for k in range(3)])
            return middles, merged[distinct]
        cells /= 1.25
    return vertices, faces[:most]


@dataclass(frozen=True)
class Solids:
    """Surfaces of the shapes in a dataset of poses."""

    data: xr.Dataset | PoseData

    @cached_property
    def faces(self) -> NDArray[np.int64]:
        """Vertices of each triangle, (face, 3); empty without shapes."""
        if "solid_face" not in self.data:
            return np.zeros((0, 3), dtype=np.int64)
        return self.data["solid_face"].values.astype(np.int64)

    @cached_property
    def corners(self) -> NDArray[np.int64]:
        """Index of the first corner of each vertex among the points."""
        return self.data["solid_corner"].values.astype(np.int64)

    def places(self, points: Array) -> Array:
        """Return the vertices in the world, from points (point, axis)."""
        share = self.data["solid_vertex"].values.astype(float)
        first = points[self.corners]
        return first + sum(
            share[:, [axis]] * (points[self.corners + (1 << axis)] - first) for axis in range(share.shape[1])
        )

    @property
    def owners(self) -> list[str]:
        """Name of the body of each face."""
        bodies = self.data["point_body"].values.astype(str)
        return [str(name) for name in bodies[self.corners[self.faces[:, 0]]]]

    def draw(self, sheet: Sheet, points: Array, roles: Sequence[str]) -> Iterator[Shape]:
        """Yield the visible faces, from the back to the front; `roles` are colour roles of the faces.

        A face that faces the viewer is pale, and a face that is seen from the side is dark.
        """
        if not len(self.faces):
            return
        places = self.places(points)
        page, behind = sheet.project(places), sheet.depth(places)
        a, b, c = (page[self.faces[:, k]] for k in range(3))
        area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        steep = area
        if sheet.spatial:
            sides = [places[self.faces[:, k]] for k in range(3)]
            whole = np.linalg.norm(np.cross(sides[1] - sides[0], sides[2] - sides[0]), axis=1)
            steep = area * sheet.unit**2 / np.where(whole > 0, whole, 1.0)
        far = behind[self.faces].mean(axis=1)
        seen = np.flatnonzero(area > 0)
        seen = seen[np.argsort(-far[seen], kind="stable")]
        for order, k in enumerate(seen.tolist()):
            level = round((LEVELS - 1) * (1 - min(float(steep[k]), 1.0))) if sheet.spatial else 0
            paint = shade(roles[k], level)
            yield Shape(page[self.faces[k]], paint, paint, 0.4, closed=True, order=2 + 0.5 * order / len(seen))


def shade(role: str, level: int) -> str:
    """Return the colour of a face on a light page.

    >>> shade("c0", 0), shade("c0", 7)
    ('#b8d8e9', '#2e8cc0')
    """
    paper, colour = ROLES[f"pale-{role}"][0], ROLES[role][0]
    return mixed(paper, colour, SHADE * level / (LEVELS - 1))
