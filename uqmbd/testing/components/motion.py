"""Rigid motions of a whole mechanism, applied to coordinates, rates and generalised forces."""

from __future__ import annotations

import numpy as np

from uqmbd.mechanism import Space
from uqmbd.typing import Array

__all__ = ["displaced", "random_turn", "random_unit", "virtual_motions"]


def random_unit(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Return random unit vectors with their entries along the last axis."""
    found: Array = rng.normal(size=shape)
    found /= np.linalg.norm(found, axis=-1, keepdims=True)
    return found


def random_turn(space: Space, rng: np.random.Generator) -> Array:
    """Return the quaternion of a random rotation, a half-angle pair in planar space, or an empty array for points.

    >>> import uqmbd
    >>> random_turn(uqmbd.Planar(), np.random.default_rng(0)).shape
    (2,)
    """
    return random_unit(rng, (space.size - space.dimension,)) if space.turns else np.zeros(0)


def displaced(space: Space, turn: Array, values: Array, shift: Array | None = None, own: int = 0) -> Array:
    """Rotate coordinates, rates or forces (bodies * size,) about the world origin by a unit quaternion, and shift them.

    The last `own` values belong to coordinates of components and do not change.

    The map of the coordinates is orthogonal, so generalised forces transform like rates. Only coordinates have a shift
    (dimension,).

    >>> import uqmbd
    >>> half_turn = np.array([0.0, 1.0])
    >>> displaced(uqmbd.Planar(), half_turn, np.array([1.0, 0.0, 1.0, 0.0]), shift=np.array([0.0, 2.0]))
    array([-1.,  2.,  0.,  1.])
    """
    d = space.dimension
    count = len(values) - own
    parts = values[:count].reshape(-1, space.size).copy()
    if space.turns:
        rotation = np.array(space.rotation(list(turn)).tolist(), dtype=float)
        parts[:, :d] = parts[:, :d] @ rotation.T
        parts[:, d:] = parts[:, d:] @ _left(turn).T
    if shift is not None:
        parts[:, :d] += shift
    return np.concatenate([parts.ravel(), values[count:]])


def virtual_motions(space: Space, q: Array, own: int = 0) -> Array:
    """Return the rates of coordinates (bodies * size,) for the rigid motions of all bodies, one row for each motion.

    The motions are translations along the axes and, for bodies that rotate, rotations about the axes through the world
    origin. The last `own` coordinates belong to components and do not change.

    >>> import uqmbd
    >>> virtual_motions(uqmbd.Planar(), np.array([1.0, 0.0, 1.0, 0.0]))[2]
    array([0. , 1. , 0. , 0.5])
    """
    d = space.dimension
    parts = q[: len(q) - own].reshape(-1, space.size)
    motions = []
    for k in range(d):
        rate = np.zeros_like(parts)
        rate[:, k] = 1
        motions.append(rate.ravel())
    for k in range(0 if not space.turns else 3 if d == 3 else 1):
        axis = np.zeros(4 if d == 3 else 2)
        axis[k + 1] = 1
        rate = np.zeros_like(parts)
        rate[:, :d] = np.cross(axis[1:], parts[:, :d]) if d == 3 else parts[:, :d] @ np.array([[0, 1], [-1, 0]])
        rate[:, d:] = parts[:, d:] @ _left(axis).T / 2
        motions.append(rate.ravel())
    return np.pad(np.array(motions), ((0, 0), (0, own)))


def _left(e: Array) -> Array:
    """Return the matrix that multiplies a quaternion by `e` from the left."""
    if len(e) == 2:
        return np.array([[e[0], -e[1]], [e[1], e[0]]])
    a, b, c, d = e
    return np.array([[a, -b, -c, -d], [b, a, -d, c], [c, d, a, -b], [d, -c, b, a]])
