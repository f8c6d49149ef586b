"""Trees of hinges and slides of which some follow others, and their motion from equations in the independent joints.

The reference knows nothing of uqmbd: geometric Jacobians, complex steps, and an integrator of SciPy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import uqmbd
from uqmbd_drivers import PositionDriver, RotationDriver
from uqmbd_joints import Prismatic, Revolute

Array = NDArray[Any]
GRAVITY = np.array([0.4, -9.81, 0.7])


@dataclass(frozen=True)
class Law:
    """Position of a joint: a polynomial without mixed terms in positions of others.

    Attributes
    ----------
    constant : float
    terms : tuple of (joint, coefficients)
        Coefficients of the first power, the second one and so on.
    """

    constant: float
    terms: tuple[tuple[int, tuple[float, ...]], ...]

    def __call__(self, positions: Sequence[Any]) -> Any:
        """Evaluate for numbers or expressions."""
        return self.constant + sum(c * positions[j] ** (k + 1) for j, cs in self.terms for k, c in enumerate(cs))

    def slopes(self, positions: Array) -> dict[int, Any]:
        """Derivatives by the positions that it depends on."""
        return {j: sum((k + 1) * c * positions[j] ** k for k, c in enumerate(cs)) for j, cs in self.terms}


@dataclass(frozen=True)
class Link:
    """A body and the joint before it.

    Attributes
    ----------
    parent : int
        Number of the link before; -1: the ground.
    kind : str
        ``hinge`` or ``slide``.
    point_i, axis_i : array
        Place and axis of the joint in the parent's frame.
    point_j : array
        Place of the joint in the frame of the link, whose origin is its centre of mass.
    turn : array
        Rotation matrix from the link to the parent where the position of the joint is zero.
    mass, inertia : float, array
    law : Law or None
        What its position follows.
    """

    parent: int
    kind: str
    point_i: Array
    axis_i: Array
    point_j: Array
    turn: Array
    mass: float
    inertia: Array
    law: Law | None = None

    @property
    def axis_j(self) -> Array:
        """The axis in the frame of the link."""
        return self.turn.T @ self.axis_i


@dataclass(frozen=True)
class Tree:
    """Links, parents first; positions and speeds of the independent joints at the start."""

    links: tuple[Link, ...]
    begin: Array
    speeds: Array
    planar: bool
    order: tuple[int, ...] = field(default=())

    @property
    def free(self) -> list[int]:
        """Numbers of the independent joints."""
        return [k for k, link in enumerate(self.links) if link.law is None]

    def positions(self, u: Array) -> tuple[Array, Array]:
        """Positions of all joints (joint,), and their derivatives by those of the independent ones."""
        count, free = len(self.links), self.free
        p, slopes = np.zeros(count, dtype=u.dtype), np.zeros((count, len(free)), dtype=u.dtype)
        p[free], slopes[free, range(len(free))] = u, 1
        pending = [k for k in range(count) if k not in free]
        while pending:
            known = [k for k in pending if not any(j in pending for j, _ in self.links[k].law.terms)]
            assert known, "joints follow each other in a circle"
            for k in known:
                p[k] = self.links[k].law(p)
                slopes[k] = sum(d * slopes[j] for j, d in self.links[k].law.slopes(p).items())
            pending = [k for k in pending if k not in known]
        return p, slopes

    def places(self, p: Array) -> tuple[list[Array], list[Array], list[Array], list[Array]]:
        """Centres of mass and rotation matrices of all links, axes and anchors of all joints, in the world."""
        centres, turns, axes, anchors = [], [], [], []
        for link, position in zip(self.links, p, strict=True):
            origin, frame = (np.zeros(3), np.eye(3)) if link.parent < 0 else (centres[link.parent], turns[link.parent])
            axis, anchor = frame @ link.axis_i, origin + frame @ link.point_i
            turn = link.turn
            if link.kind == "hinge":
                turn = about(link.axis_i, position) @ turn
            else:
                anchor = anchor + axis * position
            turns.append(frame @ turn)
            centres.append(anchor - turns[-1] @ link.point_j)
            axes.append(axis)
            anchors.append(anchor)
        return centres, turns, axes, anchors

    def inertia(self, u: Array) -> tuple[Array, Any]:
        """Mass matrix in the independent joints, and the potential energy."""
        p, slopes = self.positions(u)
        centres, turns, axes, anchors = self.places(p)
        mass, energy = np.zeros((len(u), len(u)), dtype=u.dtype), 0.0
        for k, link in enumerate(self.links):
            moved, turned = (np.zeros((3, len(self.links)), dtype=u.dtype) for _ in range(2))
            m = k
            while m >= 0:
                if self.links[m].kind == "hinge":
                    moved[:, m], turned[:, m] = np.cross(axes[m], centres[k] - anchors[m]), axes[m]
                else:
                    moved[:, m] = axes[m]
                m = self.links[m].parent
            v, w = moved @ slopes, turned @ slopes
            mass = mass + link.mass * v.T @ v + w.T @ (turns[k] @ link.inertia @ turns[k].T) @ w
            energy = energy - link.mass * self.gravity @ centres[k]
        return mass, energy

    @property
    def gravity(self) -> Array:
        """In the plane without its third component."""
        return GRAVITY * ([1, 1, 0] if self.planar else [1, 1, 1])

    def motion(self, times: Array) -> Array:
        """Positions of all joints at times, shape (T, joint)."""
        count, h = len(self.free), 1e-30

        def rates(_: float, state: Array) -> Array:
            u, du = state[:count], state[count:]
            by = []
            for k in range(count):
                step = u.astype(complex)
                step[k] += 1j * h
                mass, energy = self.inertia(step)
                by.append((mass.imag / h, energy.imag / h))
            change = sum(x * m for x, (m, _) in zip(du, by, strict=True))
            force = [du @ m @ du / 2 - e for m, e in by] - change @ du
            return np.concatenate([du, np.linalg.solve(self.inertia(u)[0], force)])

        begin = np.concatenate([self.begin, self.speeds])
        found = solve_ivp(rates, times[[0, -1]], begin, t_eval=times, rtol=1e-10, atol=1e-12, method="DOP853")
        return np.array([self.positions(u)[0] for u in found.y[:count].T])

    def mechanism(self, laws: Mapping[int, Law] | None = None, *, by_joints: bool = False) -> uqmbd.Mechanism:
        """The same for uqmbd, drawn where it starts: joints are declared in `order`, drivers as soon as they can be.

        Parameters
        ----------
        laws : mapping, optional
            Laws by joint, in place of those of the links: with random coefficients, say.
        by_joints : bool
            Whether the start is stated by positions and speeds of the independent joints, or by velocities of bodies.
        """
        laws = laws or {k: link.law for k, link in enumerate(self.links) if link.law is not None}
        d = 2 if self.planar else 3
        space = uqmbd.Planar if self.planar else uqmbd.Spatial
        mechanism = uqmbd.Mechanism("tree", space(gravity=tuple(self.gravity[:d])))
        p, slopes = self.positions(self.begin)
        centres, turns, axes, anchors = self.places(p)
        velocities, spins = self.velocities(slopes @ self.speeds, centres, axes, anchors)
        bodies: dict[int, Any] = {-1: mechanism.ground}
        angles = {-1: 0.0}
        for k, link in enumerate(self.links):
            about: dict[str, Any] = {"position": tuple(centres[k][:d])}
            if self.planar:
                hinge = link.kind == "hinge"
                angle = angles[link.parent] + self.shift(k) + (p[k] if hinge else 0.0)
                angles[k] = angle
                spin = spins[k][2]
                about["angle"] = angle
                about["inertia"] = link.inertia[2, 2]
            else:
                x, y, z, w = Rotation.from_matrix(turns[k]).as_quat()
                spin = tuple(turns[k].T @ spins[k])
                about["quaternion"] = (w, x, y, z)
                i = link.inertia
                about["inertia"] = (i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2])
            if not by_joints:
                about |= {"velocity": tuple(velocities[k][:d]), "angular_velocity": spin}
            bodies[k] = mechanism.body(f"body{k}", mass=link.mass, **about)
        joints: dict[int, Any] = {}
        pending = list(self.order) or list(range(len(self.links)))
        drivers = [k for k in pending if k in laws]
        while pending or drivers:  # a driver is declared as soon as what it follows is there
            known = set(joints)
            ready = [k for k in drivers if all(j in known for j, _ in laws[k].terms)]
            if ready:
                self._follow(mechanism, ready[0], laws[ready[0]], bodies, joints)
                drivers.remove(ready[0])
                continue
            k = pending.pop(0)
            joints[k] = mechanism.add(self._joint(k, bodies))
            mechanism.output(f"joint{k}", self._position(k, joints), units=self._units(k))
        for k, position, speed in zip(self.free, self.begin, self.speeds, strict=True) if by_joints else ():
            mechanism.start(self._position(k, joints), position)
            mechanism.start(joints[k].speed, speed)
        return mechanism

    def velocities(self, rates: Array, centres: Any, axes: Any, anchors: Any) -> tuple[list[Array], list[Array]]:
        """Velocities of the centres, and angular velocities, world axes, from the rates of all joints."""
        moved, turned = [], []
        for k in range(len(self.links)):
            v, w, m = np.zeros(3), np.zeros(3), k
            while m >= 0:
                if self.links[m].kind == "hinge":
                    v, w = v + np.cross(axes[m], centres[k] - anchors[m]) * rates[m], w + axes[m] * rates[m]
                else:
                    v = v + axes[m] * rates[m]
                m = self.links[m].parent
            moved.append(v)
            turned.append(w)
        return moved, turned

    def _ends(self, k: int) -> dict[str, Any]:
        d, link = 2 if self.planar else 3, self.links[k]
        ends = {"point_i": tuple(link.point_i[:d]), "point_j": tuple(link.point_j[:d])}
        if not self.planar or link.kind == "slide":
            ends |= {"axis_i": tuple(link.axis_i[:d]), "axis_j": tuple(link.axis_j[:d])}
        return ends

    def _joint(self, k: int, bodies: dict[int, Any]) -> Any:
        kind = Revolute if self.links[k].kind == "hinge" else Prismatic
        return kind(f"joint{k}", bodies[self.links[k].parent], bodies[k], **self._ends(k))

    def _units(self, k: int) -> str:
        return "rad" if self.links[k].kind == "hinge" else "m"

    def shift(self, k: int) -> float:
        """Angle of uqmbd, zero where the joint frames coincide, at position zero of a hinge, rad.

        The frames coincide where link j is turned against its parent by the smallest rotation from axis j to axis i.
        In space angles start within half a turn.
        """
        link = self.links[k]
        if self.planar:
            return float(np.arctan2(link.turn[1, 0], link.turn[0, 0]))
        left = Rotation.from_matrix(link.turn @ smallest(link.axis_i, link.axis_j))
        angle = float(left.as_rotvec() @ link.axis_i)
        start = self.positions(self.begin)[0][k]
        return angle - 2 * np.pi * float(np.round((angle + start) / (2 * np.pi)))

    def _position(self, k: int, joints: dict[int, Any]) -> Any:
        return joints[k].angle - self.shift(k) if self.links[k].kind == "hinge" else joints[k].displacement

    def _follow(self, mechanism: uqmbd.Mechanism, k: int, law: Law, bodies: Any, joints: Any) -> None:
        link = self.links[k]
        value = law({j: self._position(j, joints) for j, _ in law.terms})
        ends, pair = self._ends(k), (bodies[link.parent], bodies[k])
        if link.kind == "hinge":
            axes = {key: x for key, x in ends.items() if key.startswith("axis")}
            mechanism.add(RotationDriver(f"driver{k}", *pair, angle=value + self.shift(k), **axes))
        else:
            del ends["axis_j"]
            mechanism.add(PositionDriver(f"driver{k}", *pair, **ends, displacement=value))


def about(axis: Array, angle: Any) -> Array:
    """Rotation matrix of a turn about a unit axis, by Rodrigues' formula; the angle may be complex."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def smallest(start: Array, end: Array) -> Array:
    """Matrix of the smallest rotation that takes one unit vector to another."""
    across = np.cross(start, end)
    sine = np.linalg.norm(across)
    return about(across / sine, np.arctan2(sine, start @ end)) if sine else np.eye(3)


def random_tree(seed: int, *, planar: bool, plain: bool = False) -> Tree:
    """A tree of two to five links, at least one of which follows another one.

    Parameters
    ----------
    seed : int
    planar : bool
    plain : bool
        Whether the axes of a joint have equal components in both frames.
    """
    random = np.random.default_rng(seed)
    count = int(random.integers(2, 6))
    kinds = random.choice(["hinge", "slide"], count, p=[0.7, 0.3])
    # who follows whom has nothing to do with who carries whom
    rank = random.permutation(count)
    follows = [bool(rank[k] and random.random() < 0.6) for k in range(count)]
    if not any(follows):
        follows[int(np.argmax(rank))] = True
    links = []
    for k in range(count):
        law = None
        if follows[k]:
            others = [j for j in range(count) if rank[j] < rank[k]]
            chosen = random.choice(others, size=min(len(others), int(random.integers(1, 3))), replace=False)
            degree = int(random.integers(1, 4))
            scale = np.array([1.0, 0.3, 0.1])[:degree]
            terms = tuple((int(j), tuple(map(float, random.uniform(-1.2, 1.2, degree) * scale))) for j in chosen)
            law = Law(float(random.uniform(-0.4, 0.4)), terms)
        axis, turn = np.array([0.0, 0.0, 1.0]), np.eye(3)
        if planar:
            turn = about(axis, random.uniform(-3, 3)) if kinds[k] == "slide" or not plain else turn
            if kinds[k] == "slide":
                axis = np.append(_unit(random, 2), 0.0)
        else:
            axis = _unit(random, 3)
            turn = about(axis, random.uniform(-1, 1)) if plain else Rotation.random(random_state=random).as_matrix()
        size = random.uniform(0.2, 1)
        frame = np.eye(3) if planar else Rotation.random(random_state=random).as_matrix()
        moments = size * np.array([1.0, *random.uniform(0.6, 1.2, 2)]) * 0.1
        flat = [1, 1, 0] if planar else [1, 1, 1]
        links.append(
            Link(
                parent=int(random.integers(-1, k)),
                kind=str(kinds[k]),
                point_i=random.uniform(-0.5, 0.5, 3) * flat,
                axis_i=axis,
                point_j=random.uniform(-0.5, 0.5, 3) * flat,
                turn=turn,
                mass=float(size),
                inertia=frame @ np.diag(moments) @ frame.T,
                law=law,
            )
        )
    free = count - sum(follows)
    order = tuple(map(int, random.permutation(count)))
    return Tree(tuple(links), random.uniform(-0.6, 0.6, free), random.uniform(-1, 1, free), planar, order)


def _unit(random: np.random.Generator, size: int) -> Array:
    vector = random.standard_normal(size)
    return np.asarray(vector / np.linalg.norm(vector))
