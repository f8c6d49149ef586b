"""Blocks on each other that slide along one line: random mechanisms, and their motion by another method."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.integrate
import sympy

import uqmbd
from uqmbd_contact import PlaneImpact
from uqmbd_drivers import PositionDriver
from uqmbd_joints import Prismatic
from uqmbd_springs import PointForce

G = 9.81
AHEAD = 1e-9
"""Time after an event at which it is decided what sticks, s: loads are smooth."""
SLOW = 1e-7
"""Sliding that is none, m/s."""


@dataclass(frozen=True)
class Stack:
    """Blocks with what pushes them: block k lies on block k - 1, and the lowest on a base that moves.

    `limits` (block,) are the largest friction below each, N, `loads` the forces (block,) at a time, N, and `base` the
    velocity and the acceleration of the base.  Displacements are along the unit vector `along`.
    """

    mechanism: uqmbd.Mechanism
    masses: np.ndarray
    limits: np.ndarray
    loads: Callable[[float], np.ndarray]
    base: Callable[[float], tuple[float, float]]
    along: np.ndarray

    def displacements(self, states):
        """Displacements (T, block) of states (T, width)."""
        size = {1: 2, 2: 4, 3: 7}[self.turning]
        count, dim = len(self.masses), len(self.along)
        first = states.shape[1] // 2 - size * count
        places = first + size * np.arange(count)[:, None] + np.arange(dim)
        return states[:, places] @ self.along

    @property
    def turning(self):
        """Which kind of space: 1 of particles, 2 the plane, 3 space."""
        space = self.mechanism.space
        return 3 if isinstance(space, uqmbd.Spatial) else 1 if isinstance(space, uqmbd.Translational) else 2


def random_stack(space, rng, blocks, legs, kind):
    """Push blocks with feet at random places by ramps or oscillating forces, or shake their base.

    `kind`: "ramp" and "wave" act on one block, "together" brings all contacts to their limits at once, or nearly so,
    "shaken" moves the base.
    """
    dim = 3 if space is uqmbd.Spatial else 2
    up, angle = np.eye(dim)[-1], rng.uniform(0, 2 * np.pi) if dim == 3 else 0.0
    along = np.array([np.cos(angle), np.sin(angle), 0.0][:dim]) if dim == 3 else np.array([1.0, 0.0])
    mechanism = uqmbd.Mechanism("stack", space(gravity=tuple(-G * up)))
    masses = rng.uniform(0.5, 3, blocks)
    mu = np.full(blocks, 0.3) if rng.random() < 0.3 else rng.uniform(0.1, 0.7, blocks)
    limits = mu * G * np.cumsum(masses[::-1])[::-1]
    slope, wave, rate = np.zeros(blocks), np.zeros(blocks), rng.uniform(2, 12)
    pushed, shaking = rng.integers(blocks), 0.0
    if kind == "ramp":
        slope[pushed] = rng.uniform(0.8, 4) * limits[pushed] * rng.choice([-1, 1])
    elif kind == "wave":
        wave[pushed] = rng.uniform(1.1, 2.5) * limits[pushed]
    elif kind == "together":
        nearly = rng.choice([0, 1e-12, 1e-9, 1e-6, 1e-3]) * rng.uniform(-1, 1, blocks)
        slope = rng.uniform(1, 3) * (limits - np.append(limits[1:], 0.0)) * (1 + nearly)
    else:
        shaking = rng.uniform(1.2, 3) * mu[0] * G / rate**2
    support = mechanism.ground
    if kind == "shaken":
        # rigid in all but the direction of shaking
        support = mechanism.body("base", mass=1, **_rest(space, 1.0, 0 * up))
        zero, axis = (0,) * dim, tuple(along)
        mechanism.add(Prismatic("guide", mechanism.ground, support, zero, zero, axis, axis))
        way = shaking * (1 - sympy.cos(rate * uqmbd.t))
        mechanism.add(PositionDriver("shaker", mechanism.ground, support, zero, zero, axis, way))
    height = 0.1
    for k in range(blocks):
        body = mechanism.body(f"b{k}", mass=masses[k], **_rest(space, masses[k], up * height * (k + 0.5)))
        top = up * height / 2 if k else 0 * up
        for i, foot in enumerate(_feet(space, rng, legs)):
            law = {"restitution": 0, "friction": mu[k]}
            place = tuple(foot - up * height / 2)
            mechanism.add(PlaneImpact(f"c{k}{i}", support, body, tuple(top), place, tuple(up), **law))
        if slope[k] or wave[k]:
            force = slope[k] * uqmbd.t + wave[k] * sympy.sin(rate * uqmbd.t)
            level = rng.uniform(-0.5, 0.5) * height
            mechanism.add(PointForce(f"F{k}", body, tuple(level * up), tuple(x * force for x in along.tolist())))
        support = body
    return Stack(
        mechanism,
        masses,
        limits,
        lambda now: slope * now + wave * np.sin(rate * now),
        lambda now: (shaking * rate * np.sin(rate * now), shaking * rate**2 * np.cos(rate * now)),
        along,
    )


def _rest(space, mass, position):
    """Start at rest, and the inertia of a block."""
    found = {"position": tuple(position), "velocity": (0,) * len(position)}
    if space is uqmbd.Planar:
        found |= {"inertia": 0.1 * mass, "angular_velocity": 0}
    elif space is uqmbd.Spatial:
        found |= {"inertia": (0.1 * mass,) * 3, "angular_velocity": (0, 0, 0)}
    return found


def _feet(space, rng, legs):
    """Places of feet from the middle of a block, wide enough that it does not tip."""
    if space is uqmbd.Translational:
        return [np.zeros(2)]
    if space is uqmbd.Planar:
        return [np.array([x, 0.0]) for x in (-rng.uniform(3, 4), rng.uniform(3, 4), *rng.uniform(-1, 1, legs - 2))]
    angles = 2 * np.pi * np.arange(legs) / legs + rng.uniform(0, 0.5, legs)
    return [rng.uniform(2, 3) * np.array([np.cos(a), np.sin(a), 0.0]) for a in angles]


def sliding_stack(stack, times):
    """Displacements (T, block) of a stack from rest.

    Between two events the modes of the contacts are known.  After each, all combinations of sticking, and sliding to
    either side, of the contacts without sliding are tried a short time later: accelerations are unique.
    """
    masses, limits, loads, base = stack.masses, stack.limits, stack.loads, stack.base
    count, time = len(masses), float(times[0])
    lower = np.eye(count) - np.eye(count, k=-1)  # sliding = lower @ velocities, less that of the base
    matrix = lower @ np.diag(1 / masses) @ lower.T

    def relative(velocities, now, order=0):
        found = lower @ velocities
        found[0] -= base(now)[order]
        return found

    def solved(modes, now):
        """Accelerations and friction: modes are 0 (sticks) or the sense of sliding."""
        stuck, friction = np.flatnonzero(np.array(modes) == 0), -limits * np.array(modes, dtype=float)
        right = -relative((loads(now) + lower.T @ friction) / masses, now, 1)
        friction[stuck] = np.linalg.solve(matrix[np.ix_(stuck, stuck)], right[stuck])
        return (loads(now) + lower.T @ friction) / masses, friction

    def decided(velocities, now):
        known = [None if abs(w) < SLOW else int(np.sign(w)) for w in relative(velocities, now)]
        best, least = None, np.inf
        for modes in itertools.product(*[(0, 1, -1) if x is None else (x,) for x in known]):
            a, friction = solved(modes, now + AHEAD)
            rate, wrong = relative(a, now + AHEAD, 1), 0.0
            for k in (k for k, x in enumerate(known) if x is None):
                wrong = max(wrong, -modes[k] * rate[k] * masses[k] if modes[k] else abs(friction[k]) - limits[k])
            if wrong < least:
                best, least = modes, wrong
        assert least < 1e-8 * max(1.0, limits.max())
        return best

    velocities, positions, found, at = np.zeros(count), np.zeros(count), np.zeros((len(times), count)), 0
    for _ in range(400):
        modes = decided(velocities, time)
        sliding = np.where(np.array(modes) == 0, 0.0, relative(velocities, time))
        sliding[0] += base(time)[0]
        velocities = np.linalg.solve(lower, sliding)
        run = _until_event(stack, solved, relative, modes, (time + AHEAD, positions, velocities), times)
        while at < len(times) and times[at] < time + AHEAD:
            found[at], at = positions, at + 1
        if len(run.t):
            found[at : at + len(run.t)], at = run.y[:count].T, at + len(run.t)
        if run.status == 0:
            return found
        k = next(k for k in range(count) if len(run.t_events[k]))
        time, (positions, velocities) = float(run.t_events[k][0]), np.split(run.y_events[k][0], 2)
    raise AssertionError("the reference does not end")


def _until_event(stack, solved, relative, modes, start, times):
    """Integrate until a contact changes."""
    begin, positions, velocities = start
    count = len(positions)

    def rate(now, y):
        return np.concatenate([y[count:], solved(modes, now)[0]])

    def guards(k):
        def guard(now, y):
            if modes[k] == 0:
                return stack.limits[k] * (1 + 1e-9) - abs(solved(modes, now)[1][k])
            return modes[k] * relative(y[count:], now)[k]

        guard.terminal, guard.direction = True, -1
        return guard

    # away from the zero of what has just changed
    y = np.concatenate([positions, velocities])
    a = rate(begin - AHEAD / 2, y)[count:]
    y += AHEAD * np.concatenate([velocities + a * AHEAD / 2, a])
    found = scipy.integrate.solve_ivp(
        rate, (begin, float(times[-1])), y, "DOP853", times[times >= begin], events=[guards(k) for k in range(count)],
        rtol=1e-11, atol=1e-12, max_step=(times[-1] - times[0]) / 50,
    )  # fmt: skip
    assert found.status >= 0
    return found
