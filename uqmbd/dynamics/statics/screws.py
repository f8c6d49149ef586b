"""Continuation of a steady motion: each body rotates with a frame of constant angular velocity, and spins in it.

Let ``W`` be the angular velocity of the frame of a body, and ``sigma = R^T (omega - W)`` the spin of the body. The spin
is constant in the body, whose rotation is ``exp(W t) R exp(sigma t)``. The velocity of the origin of the body turns
with a frame of angular velocity ``U``. Velocities and accelerations determine the frames. If several frames are
possible, the frame of another body is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.linalg import expm

from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.linear import accelerations
from uqmbd.typing import Array

__all__ = ["Screws", "cross_matrix", "left_product", "screws_of"]


SAME = 1e-6
"""Relative part of an acceleration that counts as zero."""

PHASES = (0.0, 0.37, 1.13, 2.6)
"""Rotation angles in rad of a frame at which a steady motion is examined."""

NONE = 1e-7
"""Acceleration, relative to the largest, that counts as zero: the residual of Newton's method."""

LEAST = 1e-9
"""Acceleration, m/s^2 or rad/s^2, that counts as rounding."""

SLOW = 1e-6
"""Angular velocity in rad/s that counts as zero."""


def cross_matrix(x: Array) -> Array:
    """Return the matrix of ``x ×``."""
    return np.array([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])


def left_product(x: Array) -> Array:
    """Return the matrix of the quaternion product ``(0, x) e``, as a linear map of ``e``."""
    a, b, c = x
    return np.array([[0, -a, -b, -c], [a, 0, -c, b], [b, c, 0, -a], [c, -b, a, 0]])


def _right_product(x: Array) -> Array:
    a, b, c = x
    return np.array([[0, -a, -b, -c], [a, 0, c, -b], [b, -c, 0, a], [c, b, -a, 0]])


@dataclass(frozen=True)
class Screws:
    """Steady motion of one realisation."""

    model: Model
    places: Array  # (body, 3): positions at the initial time, in three dimensions
    quaternions: Array  # (body, 4): at the initial time
    velocities: Array  # (body, 3): at the initial time
    turning: Array  # (body, 3): angular velocities W of frames, world axes
    spin: Array  # (body, 3): spins, body axes
    moving: Array  # (body, 3): angular velocities U of frames, world axes
    s: Array  # (state,): auxiliary states
    rates: Array  # (state,): constant rates of the auxiliary states

    @property
    def fastest(self) -> float:
        """Largest angular velocity, rad/s."""
        every = np.concatenate([self.turning, self.spin, self.moving])
        return float(np.linalg.norm(every, axis=1).max(initial=0.0))

    @property
    def times(self) -> list[float]:
        """Return times after the initial time at which a steady motion is examined, s.

        The times correspond to rotation angles of the fastest frame, and of the slowest rotation between two frames.
        """
        vectors = [*self.frames, *self.spin]
        turns = [float(np.linalg.norm(x - y)) for x, y in combinations(vectors, 2)]
        speeds = [x for x in turns if x > max(SLOW, 1e-7 * self.fastest)]
        if not speeds:
            return list(PHASES)
        found = [x / max(speeds) for x in PHASES]
        return found + ([x / min(speeds) for x in PHASES[1:]] if 2 * min(speeds) < max(speeds) else [])

    @property
    def frames(self) -> list[Array]:
        """Return angular velocities of candidate frames for constant coefficients; the frame at rest is first."""
        found = [np.zeros(3)]
        every = np.concatenate([self.turning, self.moving, self.turning + self._spins()])
        limit = 1e-7 * max(self.fastest, 1e-12)
        for x in every if self.model.dimension > 1 else ():
            if all(np.linalg.norm(x - y) > limit for y in found):
                found.append(x)
        return found

    def _spins(self) -> Array:
        """Return spins, in world axes, of bodies that spin about the axis of their frame; zero for other bodies."""
        found = np.zeros_like(self.spin)
        for b, (e, w, x) in enumerate(zip(self.quaternions, self.turning, self.spin, strict=True)):
            spin = _rotation(e) @ x
            if np.linalg.norm(np.cross(w, spin)) <= 1e-9 * max(self.fastest, 1e-12) ** 2:
                found[b] = spin
        return found

    def attitudes(self, after: float) -> tuple[Array, Array, Array]:
        """Return quaternions of the bodies and their first and second rates, at a time after the initial time, s."""
        found = []
        for e, w, x in zip(self.quaternions, self.turning, self.spin, strict=True):
            left, right = left_product(w) / 2, _right_product(x) / 2
            now = expm(after * left) @ expm(after * right) @ e
            rate = left @ now + right @ now
            found.append((now, rate, left @ rate + right @ rate))
        a, b, c = (np.array(x).reshape(-1, 4) for x in zip(*found, strict=True))
        return a, b, c

    def at(self, after: float) -> tuple[Array, Array, Array, Array, Array]:
        """Return coordinates, velocities, accelerations, auxiliary states and their rates, `after` s from the start."""
        r, v, a = [], [], []
        for place, speed, u in zip(self.places, self.velocities, self.moving, strict=True):
            turn = np.zeros((6, 6))  # matrix for (integral of the velocity, velocity)
            turn[:3, 3:], turn[3:, 3:] = np.eye(3), cross_matrix(u)
            moved = expm(after * turn) @ np.concatenate([np.zeros(3), speed])
            r.append(place + moved[:3])
            v.append(moved[3:])
            a.append(np.cross(u, moved[3:]))
        e = self.attitudes(after)
        parts = [self._flat(np.array(x), y) for x, y in zip((r, v, a), e, strict=True)]
        return parts[0], parts[1], parts[2], self.s + after * self.rates, self.rates

    def _flat(self, places: Array, quaternions: Array) -> Array:
        d, size = self.model.dimension, self.model.size
        columns = [places[:, :d]]
        if size > d:
            columns.append(quaternions[:, [0, 3]] if d == 2 else quaternions)
        return np.concatenate(columns, axis=1).ravel()


def _rotation(e: Array) -> Array:
    a, x = e[0], e[1:]
    found: Array = (a * a - x @ x) * np.eye(3) + 2 * np.outer(x, x) + 2 * a * cross_matrix(x)
    return found


def _spatial(model: Model, x: Array, quaternion: float) -> tuple[Array, Array]:
    """Return coordinates, or their rates, in three dimensions: positions (body, 3) and quaternions (body, 4)."""
    d, size = model.dimension, model.size
    parts = x.reshape(-1, size)
    places, e = np.zeros((len(parts), 3)), np.zeros((len(parts), 4))
    places[:, :d] = parts[:, :d]
    if size == d:
        e[:, 0] = quaternion
    else:
        e[:, [0, 3] if d == 2 else slice(None)] = parts[:, d:]
    return places, e


def _angular(e: Array, rates: Array) -> Array:
    """Return the vector parts of ``2 rates e*``."""
    conjugate = e * np.array([1, -1, -1, -1])
    vector = rates[:, :1] * conjugate[:, 1:] + conjugate[:, :1] * rates[:, 1:]
    return np.asarray(2 * (vector + np.cross(rates[:, 1:], conjugate[:, 1:])))


def screws_of(model: Model, q: Array, s: Array, v: Array, parameters: Array) -> Screws | str:
    """Return the screws of the bodies of one realisation in a steady motion, or the reason why it is not steady."""
    row = parameters[None]

    def motion(x: Array, y: Array, z: Array, time: float) -> tuple[Array, Array, Array, Array, Array, Array, Array]:
        a, _, rates = (f[0] for f in accelerations(model, x[None], y[None], z[None], time, row))
        places, e = _spatial(model, x, 1.0)
        velocity, e1 = _spatial(model, z, 0.0)
        acceleration, e2 = _spatial(model, a, 0.0)
        omega = _angular(e, e1)
        # the square of a rate is a scalar and does not contribute to the vector part
        return velocity, acceleration, omega, _angular(e, e2), a, rates, e

    velocity, acceleration, omega, alpha, a, rates, e = motion(q, s, v, model.time)
    if not np.isfinite(a).all():
        return "its accelerations are not determined there"
    fastest = max(float(np.linalg.norm(omega, axis=1).max(initial=0.0)), 1e-3)
    h = 3e-3 / fastest

    def jerk(part: float) -> tuple[Array, Array]:
        t = part * h
        found = motion(q + t * v + t * t / 2 * a, s + t * rates, v + t * a, model.time + t)
        return found[1], found[3]

    # rate at the middle of any curve through the state with its rates, by differences of order 4
    ends = [jerk(x) for x in (-2.0, -1.0, 1.0, 2.0)]
    jerks, snaps = ((x - 8 * y + 8 * z - w) / (12 * h) for x, y, z, w in zip(*ends, strict=True))
    known = [np.zeros(3), *omega]
    angular = max(float(np.abs(alpha).max(initial=0.0)), float(np.abs(omega).max(initial=0.0)) * fastest)
    floor = NONE * angular + LEAST
    turning = [_frame(w, b, c, known, fastest, floor) for w, b, c in zip(omega, alpha, snaps, strict=True)]
    known += [x for x in turning if x is not None]
    # points off the origins move with the angular velocities
    linear = max(float(np.abs(acceleration).max(initial=0.0)), float(np.abs(velocity).max(initial=0.0)) * fastest)
    largest = max(linear, angular * model.length)
    floor = NONE * largest + LEAST
    moving = [_frame(w, b, c, known, fastest, floor) for w, b, c in zip(velocity, acceleration, jerks, strict=True)]
    for name, x, y in zip(model.bodies, turning, moving, strict=True):
        if x is None or y is None:
            what = "angular velocity" if x is None else "velocity"
            return f"the {what} of body {name!r} changes in size, or does not turn about a fixed axis"
    frames, paths = np.array(turning).reshape(-1, 3), np.array(moving).reshape(-1, 3)
    spin = np.array([_rotation(x).T @ (w - f) for x, w, f in zip(e, omega, frames, strict=True)]).reshape(-1, 3)
    places, _ = _spatial(model, q, 1.0)
    return Screws(model, places, e, velocity, frames, spin, paths, s, rates)


def _frame(x: Array, rate: Array, second: Array, known: list[Array], fastest: float, floor: float) -> Array | None:
    """Return the angular velocity of a frame in which a vector with known rates is constant; None if none exists.

    A suitable angular velocity from `known` is preferred, the slowest first.
    """
    size = float(np.linalg.norm(x))
    noise = max(SAME * size * fastest, floor)
    fitting = [w for w in known if np.linalg.norm(np.cross(w, x) - rate) <= noise]
    # constants are not rotated
    fitting = [w for w in fitting if np.linalg.norm(np.cross(w, rate) - second) <= 1e3 * noise * fastest]
    if fitting:
        return min(fitting, key=lambda w: float(np.linalg.norm(w)))
    if abs(float(rate @ x)) > 1e2 * noise * size or size <= 1e-9:
        return None
    # W x X = X' does not determine the part along X; W x X' = X'' determines it
    across = np.cross(x, rate) / size**2
    unit = x / size
    along = np.cross(unit, rate)
    if np.linalg.norm(along) <= noise:  # the vector does not rotate but changes
        return None
    part = float(along @ (second - np.cross(across, rate)) / max(float(along @ along), 1e-300))
    return np.asarray(across + part * unit)
