"""Rotations in numbers, as quaternions with the scalar first; SciPy does the arithmetic."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from uqmbd_models.tree import Array

__all__ = ["about", "inverse", "matrix", "product", "turned"]


def product(a: Any, b: Any) -> Array:
    """Quaternion of rotation b followed by a, ``a b``."""
    (p, *u), (q, *v) = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    return np.array([p * q - np.dot(u, v), *(p * np.asarray(v) + q * np.asarray(u) + np.cross(u, v))])


def inverse(a: Any) -> Array:
    """Quaternion of the inverse rotation."""
    return np.asarray(a, dtype=float) * (1, -1, -1, -1)


def about(axis: Any, angle: float) -> Array:
    """Quaternion of a rotation about a unit axis.

    Examples
    --------
    >>> about((0, 0, 1), np.pi).round(3).tolist()
    [0.0, 0.0, 0.0, 1.0]
    """
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * np.asarray(axis, dtype=float))])


def matrix(quaternion: Any) -> Array:
    """Rotation matrix of a quaternion."""
    found: Array = Rotation.from_quat(np.asarray(quaternion, dtype=float), scalar_first=True).as_matrix()
    return found


def turned(quaternion: Any, vector: Any) -> Array:
    """Turn a vector."""
    found: Array = matrix(quaternion) @ np.asarray(vector, dtype=float)
    return found
