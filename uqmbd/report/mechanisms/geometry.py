"""Vectors of the plane and of space: hulls, normals, frames about an axis, points of a plane, ends of circles."""

from __future__ import annotations

import numpy as np

from uqmbd.typing import Array

__all__ = ["across", "axes_of", "extremes", "foot", "hull", "normals"]


def hull(points: Array) -> Array:
    """Return the corners of the convex hull of points, shape (N, 2), anticlockwise; of points on a line its two ends.

    Examples
    --------
    >>> import numpy as np
    >>> hull(np.array([[0, 0], [2, 0], [1, 0.5], [2, 2], [0, 2.0]])).tolist()
    [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]
    """
    ordered = points[np.lexsort((points[:, 1], points[:, 0]))]
    if len(ordered) < 3:
        return ordered
    ends = []
    for chain in (ordered, ordered[::-1]):
        kept: list[Array] = []
        for point in chain:
            while len(kept) > 1 and _cross(kept[-1] - kept[-2], point - kept[-2]) <= 1e-4:
                kept.pop()
            kept.append(point)
        ends += kept[:-1]
    return np.array(ends)


def _cross(a: Array, b: Array) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def normals(axis: Array) -> tuple[Array, Array]:
    """Two unit vectors perpendicular to an axis in space and to each other."""
    axis = axis / np.linalg.norm(axis)
    other = np.eye(3)[int(np.argmin(abs(axis)))]
    b = np.cross(axis, other)
    b = b / np.linalg.norm(b)
    return b, np.cross(axis, b)


def axes_of(axis: Array) -> Array:
    """Return unit vectors as rows, shape (axes, axes): along an axis, and across it; in the plane on its left.

    Examples
    --------
    >>> import numpy as np
    >>> axes_of(np.array([0.0, 2.0])).tolist()
    [[0.0, 1.0], [-1.0, 0.0]]
    """
    along = axis / np.linalg.norm(axis)
    return np.array([along, *normals(axis)] if len(axis) == 3 else [along, [-along[1], along[0]]])


def across(normal: Array) -> list[Array]:
    """Return unit vectors along a plane, given its normal: one in the plane of the page, two in space."""
    if len(normal) == 3:
        return list(normals(normal))
    return [np.array([normal[1], -normal[0]]) / np.linalg.norm(normal)]


def foot(origin: Array, normal: Array, point: Array) -> Array:
    """Return the points of a plane that are nearest to others; all of shape (..., axis), m.

    Examples
    --------
    >>> import numpy as np
    >>> foot(np.array([0.0, 1.0]), np.array([0.0, 2.0]), np.array([3.0, 5.0])).tolist()
    [3.0, 1.0]
    """
    unit = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    nearest: Array = point - unit * np.sum(unit * (point - origin), axis=-1, keepdims=True)
    return nearest


def extremes(points: Array, radius: float) -> Array:
    """Return the ends of circles or spheres along the axes, shape (N, axis), m, about points (..., axis)."""
    d = points.shape[-1]
    ends: Array = points.reshape(-1, 1, d) + radius * np.concatenate([np.eye(d), -np.eye(d)])
    return ends.reshape(-1, d)
