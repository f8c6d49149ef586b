"""Clearance of two bodies: the smallest distance of their shapes over the motion."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy

import uqmbd
from uqmbd.shapes import BodyShape
from uqmbd.typing import Array
from uqmbd_geometry.distances import Solid, contains, distance, solid_of

__all__ = ["clearance", "is_clearance"]

RESOLVED = 1e-4
"""Distance, relative to the size of the shapes, by which another minimum may be below the returned one."""

FINE = 1e-7
"""Precision of the time of a minimum, relative to the interval that contains it."""

SPEED = 1.2
"""Bound of the speed in an interval, relative to the largest speed at its `PLACES`."""

PLACES = np.linspace(0.0, 1.0, 9)
"""Relative positions in an interval at which speeds are computed."""

ROUNDS = 40
"""Largest number of bisections of an interval."""


@dataclass(frozen=True, eq=False)
class Side:
    """One body in a clearance: its shapes, and the expressions that the motion contains."""

    shapes: tuple[BodyShape, ...]
    dimension: int  # dimension of the space; 0: fixed in the world
    turns: bool
    # parameters of the shapes; NaN: a random parameter, whose value is in the motion
    fixed: tuple[tuple[float, ...], ...]

    @property
    def coordinates(self) -> int:
        """Number of coordinates among the expressions."""
        turning = {2: 2, 3: 4}.get(self.dimension, 0) if self.turns else 0
        return self.dimension + turning

    @property
    def random(self) -> int:
        """Number of random parameters of the shapes."""
        return int(np.isnan(np.concatenate(self.fixed)).sum())


@dataclass(frozen=True, eq=False)
class Pair:
    """The two bodies of a clearance."""

    sides: tuple[Side, Side]
    digest: str  # of the shapes, and of the form of the expressions


def clearance(body_a: Any, body_b: Any) -> sympy.Expr:
    """Return the smallest distance of two bodies over the motion, for outputs and requirements.

    Parameters
    ----------
    body_a : Body
        Body with shapes (`uqmbd.shapes`, or a mesh by `read_mesh` or `from_mesh`).
    body_b : Body or uqmbd.shapes.BodyShape
        Another body with shapes, or a shape that is fixed in the world.

    Returns
    -------
    SymPy expression
        Scalar quantity, m: the smallest distance of a shape of `body_a` from a shape of `body_b`, at all times between
        the first and the last output time. It is 0 if they touch at any time, or if one encloses the other.

    Raises
    ------
    uqmbd.StudyError
        If a body has no shape, or python-fcl is not installed.

    Notes
    -----
    Use sampling methods: the quantity is not a smooth function of the inputs. The check of a study warns about methods
    with polynomials. A minimum is found within 1e-4 of the size of the shapes, and then refined. The surface of a mesh
    counts, not the curved surface that it approximates. The distance of a cylinder from a mesh is accurate to about
    1e-5 of their size, and all other distances to rounding errors.

    Examples
    --------
    >>> import uqmbd, uqmbd_geometry
    >>> from uqmbd.shapes import Sphere
    >>> mechanism = uqmbd.Mechanism("balls", uqmbd.Translational())
    >>> one = mechanism.body("one", mass=1, velocity=(1, 0), shape=Sphere(0.1))
    >>> two = mechanism.body("two", mass=1, position=(1, 0.5), shape=Sphere(0.1))
    >>> mechanism.output("gap", uqmbd_geometry.clearance(one, two), units="m")
    >>> float(uqmbd.simulate(mechanism, [0, 2])["gap"].round(9))
    0.3
    """
    try:
        import fcl  # noqa: F401
    except ImportError:
        raise uqmbd.StudyError("clearance: python-fcl is not installed; install uqmbd[geometry].") from None
    expressions: list[sympy.Expr] = []
    sides = (_side(body_a, "body_a", expressions), _side(body_b, "body_b", expressions))
    if not sides[0].dimension:
        raise uqmbd.StudyError("clearance: body_a is fixed in the world; expected a body with shapes.")
    names = [getattr(body, "name", repr(body)) for body in (body_a, body_b)]
    digest = _digest(sides)
    label = f"clearance({', '.join(names)})"
    units = ["" if k else "m" for k in range(len(expressions))]
    declared = _clearance.with_data(uqmbd.extend.SummaryData(Pair(sides, digest), digest, label), units[1:])
    found: sympy.Expr = declared(*expressions)
    return found


def is_clearance(part: Any) -> bool:
    """Return whether a part of an expression is a clearance."""
    return getattr(getattr(part, "declared", None), "__name__", "") == _clearance.__name__


def _side(body: Any, name: str, expressions: list[sympy.Expr]) -> Side:
    """Return one side, and add its coordinates and random numbers to the expressions."""
    shapes = (body,) if isinstance(body, BodyShape) else getattr(body, "shapes", ())
    if not shapes or not all(isinstance(one, BodyShape) for one in shapes):
        shown = getattr(body, "name", repr(body))
        raise uqmbd.StudyError(
            f"clearance: {name} is {shown!r}, which has no shape; give shape= in mechanism.body, such as "
            "uqmbd.shapes.Box((0.1, 0.2, 0.3))."
        )
    dimension, turns = 0, False
    if not isinstance(body, BodyShape):
        dimension, turns = body.space.dimension, body.space.turns
        expressions += [body.position[k] for k in range(dimension)]
        expressions += list(body.quaternion) if turns and dimension > 1 else []
    fixed = []
    for shape in shapes:
        numbers = []
        for value in shape.expressions:
            if value.is_number:
                numbers.append(float(value))
            else:
                numbers.append(float("nan"))
                expressions.append(value)
        fixed.append(tuple(numbers))
    return Side(tuple(shapes), dimension, turns and dimension > 1, tuple(fixed))


def _digest(sides: Sequence[Side]) -> str:
    """Return a hash of the shapes and of the form of the expressions."""
    found = hashlib.sha256()
    for side in sides:
        found.update(repr((side.dimension, side.turns, side.fixed)).encode())
        for shape in side.shapes:
            found.update(type(shape).__name__.encode() + np.asarray(shape.rotation, dtype=float).tobytes())
            for name in ("vertices", "faces"):
                found.update(np.ascontiguousarray(getattr(shape, name, np.zeros(0))).tobytes())
    return found.hexdigest()


class _Motion:
    """Poses of the two bodies in one realisation, and the distance of their solids."""

    def __init__(self, motion: uqmbd.extend.MotionPolynomials, pair: Pair) -> None:
        self.motion, self.pair = motion, pair
        begin = motion.at(motion.begin[:1])[:, 0]
        self.solids: list[list[Solid]] = []
        self.columns: list[slice] = []
        place = 0
        for side in pair.sides:
            self.columns.append(slice(place, place + side.coordinates))
            place += side.coordinates
            numbers = iter(begin[place : place + side.random].tolist())
            place += side.random
            values = [[next(numbers) if np.isnan(x) else x for x in one] for one in side.fixed]
            self.solids.append([solid_of(shape, x) for shape, x in zip(side.shapes, values, strict=True)])
        self.reach = [max(solid.reach for solid in solids) for solids in self.solids]

    def invalid(self) -> str:
        """Return the reason why the shapes have no distance: a random length that is not positive."""
        for solids in self.solids:
            if any(not (solid.lengths > 0).all() for solid in solids):
                return "a length of its shapes is not positive"
        return ""

    def poses(self, times: Array) -> list[tuple[Array, Array]]:
        """Return rotations (T, 3, 3) and positions (T, 3) of both bodies."""
        values = self.motion.at(times)
        return [_pose(side, values[columns]) for side, columns in zip(self.pair.sides, self.columns, strict=True)]

    def distances(self, times: Array) -> Array:
        """Return the smallest distance of two solids at times (T,), m."""
        (one, p), (two, q) = self.poses(times)
        return np.array(
            [
                min(distance(a, b, (one[k], p[k]), (two[k], q[k])) for a in self.solids[0] for b in self.solids[1])
                for k in range(len(times))
            ]
        )

    def enclosed(self) -> bool:
        """Return whether a solid encloses another solid at the start."""
        (one, p), (two, q) = self.poses(self.motion.begin[:1])
        return any(contains(a, b, (one[0], p[0]), (two[0], q[0])) for a in self.solids[0] for b in self.solids[1])

    def speeds(self, low: Array, high: Array) -> Array:
        """Return a bound of the rate of the distance in intervals (N,), m/s."""
        times = (low[:, None] + (high - low)[:, None] * PLACES).ravel()
        rates = self.motion.at(times, derivative=1)
        total = np.zeros(len(times))
        for side, columns, reach in zip(self.pair.sides, self.columns, self.reach, strict=True):
            own = rates[columns]
            total += np.linalg.norm(own[: side.dimension], axis=0)
            total += 2 * np.linalg.norm(own[side.dimension :], axis=0) * reach  # |omega| = 2 |e'|
        return np.asarray(SPEED * total.reshape(len(low), -1).max(axis=1))


def _pose(side: Side, values: Array) -> tuple[Array, Array]:
    """Return rotations and positions in space from coordinates (coordinate, T)."""
    count, d = values.shape[1], side.dimension
    position = np.zeros((count, 3))
    position[:, :d] = values[:d].T
    rotation = np.tile(np.eye(3), (count, 1, 1))
    if side.turns:
        e = values[d:] / np.linalg.norm(values[d:], axis=0)
        if d == 2:
            cosine, sine = e[0] ** 2 - e[1] ** 2, 2 * e[0] * e[1]
            rotation[:, :2, :2] = np.moveaxis(np.array([[cosine, -sine], [sine, cosine]]), -1, 0)
        else:
            w, x, y, z = e
            rotation = np.moveaxis(
                np.array(
                    [
                        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
                    ]
                ),
                -1,
                0,
            )
    return rotation, position


@uqmbd.extend.summary(polynomials=True, power=1)
def _clearance(motion: uqmbd.extend.MotionPolynomials, pair: Pair) -> float | str:
    """Return the smallest distance over a motion, or the reason why there is none."""
    key = (pair.digest, motion.begin.tobytes(), motion.coefficients.tobytes())
    if key not in _LATEST:
        if len(_LATEST) >= REMEMBERED:
            _LATEST.clear()
        _LATEST[key] = _smallest(motion, pair)
    return _LATEST[key]


_LATEST: dict[tuple[str, bytes, bytes], float | str] = {}
"""Cache of the latest results: an output and a requirement may compute the same clearance in sequence."""

REMEMBERED = 8
"""Largest number of results in the cache."""


def _smallest(motion: uqmbd.extend.MotionPolynomials, pair: Pair) -> float | str:
    """Return the smallest distance over a motion, by bisection with bounds of its rate, and refinement."""
    moving = _Motion(motion, pair)
    if reason := moving.invalid():
        return reason
    if moving.enclosed():
        return 0.0
    low, high = motion.begin.copy(), motion.end.copy()
    times = np.append(motion.begin, motion.end[-1])
    values = moving.distances(times)
    at_low, at_high = values[:-1], values[1:]
    allowed = RESOLVED * sum(moving.reach)
    speed = moving.speeds(low, high)
    for _ in range(ROUNDS):
        best = float(values.min())
        if best <= 0:
            return 0.0
        least = 0.5 * (at_low + at_high - speed * (high - low))
        some = least < best - allowed
        low, high, at_low, at_high, speed = (x[some] for x in (low, high, at_low, at_high, speed))
        if not len(low):
            break
        middle = 0.5 * (low + high)
        at_middle = moving.distances(middle)
        times, values = np.concatenate([times, middle]), np.concatenate([values, at_middle])
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        at_low, at_high = np.concatenate([at_low, at_middle]), np.concatenate([at_middle, at_high])
        speed = np.concatenate([speed, speed])
    return _refined(moving, times, values)


def _refined(moving: _Motion, times: Array, values: Array) -> float:
    """Return the minimum between the neighbours of the best time, by bounded minimisation."""
    from scipy.optimize import minimize_scalar

    order = np.argsort(times)
    times, values = times[order], values[order]
    k = int(values.argmin())
    low, high = float(times[max(k - 1, 0)]), float(times[min(k + 1, len(times) - 1)])
    if not high > low:
        return float(values.min())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = minimize_scalar(
            lambda x: float(moving.distances(np.array([x]))[0]),
            bounds=(low, high),
            method="bounded",
            options={"xatol": FINE * (high - low)},
        )
    return max(0.0, min(float(values.min()), float(found.fun)))
