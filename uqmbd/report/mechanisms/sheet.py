"""Page of a mechanism drawing, in inches: shapes, and vectors of their positions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqmbd.typing import Array

__all__ = [
    "MARGIN",
    "Shape",
    "Sheet",
    "VIEW",
    "across",
    "axes_of",
    "extremes",
    "foot",
    "hull",
    "link_shapes",
    "normals",
    "outline_of",
    "sheet_for",
]


def hull(points: Array) -> Array:
    """Return the corners of the convex hull of points (N, 2), anticlockwise; the two ends if they are collinear.

    >>> import numpy as np
    >>> hull(np.array([[0, 0], [2, 0], [1, 0.5], [2, 2], [0, 2.0]])).tolist()
    [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]
    """
    ordered = points[np.lexsort((points[:, 1], points[:, 0]))]
    if len(ordered) < 3:
        return ordered
    ends = []
    for side in (ordered, ordered[::-1]):
        chain: list[Array] = []
        for point in side:
            while len(chain) > 1 and _cross(chain[-1] - chain[-2], point - chain[-2]) <= 1e-4:
                chain.pop()
            chain.append(point)
        ends += chain[:-1]
    return np.array(ends)


def _cross(a: Array, b: Array) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def normals(axis: Array) -> tuple[Array, Array]:
    """Return two unit vectors perpendicular to an axis in space and to each other."""
    axis = axis / np.linalg.norm(axis)
    other = np.eye(3)[int(np.argmin(abs(axis)))]
    b = np.cross(axis, other)
    b = b / np.linalg.norm(b)
    return b, np.cross(axis, b)


def axes_of(axis: Array) -> Array:
    """Return unit vectors as rows (axes, axes): along an axis, then perpendicular to it (in the plane: to its left).

    >>> import numpy as np
    >>> axes_of(np.array([0.0, 2.0])).tolist()
    [[0.0, 1.0], [-1.0, 0.0]]
    """
    along = axis / np.linalg.norm(axis)
    return np.array([along, *normals(axis)] if len(axis) == 3 else [along, [-along[1], along[0]]])


def across(normal: Array) -> list[Array]:
    """Return unit vectors perpendicular to a normal: one in two dimensions, two in space."""
    if len(normal) == 3:
        return list(normals(normal))
    return [np.array([normal[1], -normal[0]]) / np.linalg.norm(normal)]


def foot(origin: Array, normal: Array, point: Array) -> Array:
    """Return the orthogonal projections of points onto planes; all arrays have the shape (..., axis), m.

    >>> import numpy as np
    >>> foot(np.array([0.0, 1.0]), np.array([0.0, 2.0]), np.array([3.0, 5.0])).tolist()
    [3.0, 1.0]
    """
    unit = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    nearest: Array = point - unit * np.sum(unit * (point - origin), axis=-1, keepdims=True)
    return nearest


def extremes(points: Array, radius: float) -> Array:
    """Return the extreme points (N, axis) of circles or spheres along the axes in m, from centres (..., axis)."""
    d = points.shape[-1]
    ends: Array = points.reshape(-1, 1, d) + radius * np.concatenate([np.eye(d), -np.eye(d)])
    return ends.reshape(-1, d)


VIEW = (24.0, -58.0)  # degrees: elevation and azimuth of the spatial view
MARGIN = 0.5  # inches between the edges of the page and the points, for joints, names and the ground


@dataclass(frozen=True)
class Shape:
    """Line or area on the page."""

    vertices: Array  # (N, 2): inches; NaN interrupts a line
    # edge, face: roles with colours on a page and on paper (`ROLES`); no face: a line; edge "none": an area
    edge: str = "ink"
    face: str | None = None
    width: float = 1.0  # width of the line, points
    closed: bool = False  # whether the last vertex is joined to the first one
    style: Any = "-"  # line style of Matplotlib
    order: float = 3.0  # shapes of higher order are above others
    alpha: float = 1.0  # opacity


@dataclass(frozen=True)
class Sheet:
    """Mapping of points to the page."""

    project: Callable[[Array], Array]  # maps points (..., 2 or 3), m, to the page (..., 2), inches
    depth: Callable[[Array], Array]  # maps points to their distance behind the page, for the order of drawing
    unit: float  # metres per inch
    box: tuple[float, float, float, float]  # available area for names, inches
    spatial: bool  # whether the view is spatial


def sheet_for(points: Array, width: float, height: float) -> Sheet:
    """Return a page without axes that contains all points; a spatial view is orthographic.

    The layout agrees with the player of a report (`view.js`).

    `points` (N, 2 or 3) are finite, in m; `width` and `height` are in inches.

    >>> import numpy as np
    >>> sheet = sheet_for(np.array([[0.0, 0.0], [2.0, 0.5]]), 6.0, 3.0)
    >>> sheet.project(np.array([[1.0, 0.25], [2.0, 0.25]])).tolist()
    [[3.0, 1.5], [5.5, 1.5]]
    """
    low, high = points.min(axis=0), points.max(axis=0)
    extent, centre, spatial = high - low, (low + high) / 2, points.shape[-1] == 3
    if spatial:
        e, a = np.deg2rad(VIEW)
        rows = np.array([[-np.sin(a), np.cos(a), 0], [-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)]])
        towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        unit = (float(np.linalg.norm(extent)) or 1.0) / (min(width, height) - 0.8 * MARGIN)
    else:
        rows, towards = np.eye(2), np.zeros(2)
        largest = float(extent.max())
        unit = max(float(extent[0]), 0.25 * largest if largest > 0 else 0.5) / (width - 2 * MARGIN)
        unit = max(unit, float(extent[1]) / (height - 2 * MARGIN))

    def project(given: Array) -> Array:
        page: Array = np.array([width / 2, height / 2]) + (given - centre) @ rows.T / unit
        return page

    def depth(given: Array) -> Array:
        behind: Array = -(given @ towards)
        return behind

    return Sheet(project, depth, unit, (0.1, 0.1, width - 0.1, height - 0.1), spatial)


def outline_of(sheet: Sheet, points: Array) -> Array:
    """Return the corners (1 or more, 2) of the hull of a body on the page, inches."""
    return hull(np.unique(np.round(sheet.project(points), 3), axis=0))


def link_shapes(
    corners: Array, role: str, light: str, thick: float, order: float, *, along: bool = False
) -> list[Shape]:
    """Return a rounded link or plate around the corners of a body, as a rim and a face in a lighter colour.

    `along`: the corners are points of a line, not of an area.
    """
    closed = len(corners) > 2 and not along
    vertices = corners if len(corners) > 1 else np.repeat(corners, 2, axis=0) + [[-1e-3, 0], [1e-3, 0]]
    return [
        Shape(vertices, paint, paint if closed else None, width, closed, order=place)
        for paint, width, place in ((role, thick, order), (light, 0.8 * thick, order + 1e-3))
    ]
