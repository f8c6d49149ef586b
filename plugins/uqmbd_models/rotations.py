"""Rotations as quaternions with the scalar first; SciPy computes them."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from uqmbd_models.tree import Array

__all__ = ["about", "across", "from_rpy", "inverse", "matrix", "product", "turned"]


def product(a: Any, b: Any) -> Array:
    """Return the quaternion of rotation b followed by a, ``a b``."""
    (p, *u), (q, *v) = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    return np.array([p * q - np.dot(u, v), *(p * np.asarray(v) + q * np.asarray(u) + np.cross(u, v))])


def inverse(a: Any) -> Array:
    """Return the quaternion of the inverse rotation."""
    return np.asarray(a, dtype=float) * (1, -1, -1, -1)


def about(axis: Any, angle: float) -> Array:
    """Return the quaternion of a rotation about a unit axis by an angle, rad.

    >>> about((0, 0, 1), np.pi).round(3).tolist()
    [0.0, 0.0, 0.0, 1.0]
    """
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * np.asarray(axis, dtype=float))])


def matrix(quaternion: Any) -> Array:
    """Return the rotation matrix (3, 3) of a quaternion."""
    found: Array = Rotation.from_quat(np.asarray(quaternion, dtype=float), scalar_first=True).as_matrix()
    return found


def turned(quaternion: Any, vector: Any) -> Array:
    """Return a rotated vector (3,)."""
    found: Array = matrix(quaternion) @ np.asarray(vector, dtype=float)
    return found


def from_rpy(angles: Any) -> Array:
    """Return the quaternion of successive rotations about the fixed axes x, y and z, by angles, rad.

    >>> from_rpy((0, 0, np.pi / 2)).round(3).tolist()
    [0.707, 0.0, 0.0, 0.707]
    """
    found: Array = Rotation.from_euler("xyz", np.asarray(angles, dtype=float)).as_quat(scalar_first=True)
    return found


def across(axis: Any) -> tuple[Array, Array]:
    """Return two directions across a unit axis, from x and y by the shortest rotation of z to the axis.

    >>> [x.round(3).tolist() for x in across((1, 0, 0))]
    [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    """
    z = np.array([0.0, 0.0, 1.0])
    way = np.cross(z, axis)
    size = np.linalg.norm(way)
    turn = np.arctan2(size, np.dot(z, axis)) * (way / size if size else np.array([1.0, 0, 0]))
    found = Rotation.from_rotvec(turn).as_matrix()
    return found[:, 0], found[:, 1]
