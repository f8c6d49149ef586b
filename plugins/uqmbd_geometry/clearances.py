"""Clearance of two bodies: the smallest distance of their shapes over the motion."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy

import uqmbd
from uqmbd.extend import typechecked
from uqmbd.typing import Array
from uqmbd_geometry.distances import Solid, contains, distance, solid_of
from uqmbd_geometry.pairs import Pair, Side, pair_of

__all__ = ["clearance", "clearance_over_time", "instant_of"]

INSIDE = 1e-9
"""Distance of a time from the simulated interval, relative to its length, that counts as zero."""

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
class Instants:
    """The two bodies of a series of distances, and its times, s."""

    pair: Pair
    times: tuple[float, ...]
    digest: str  # of the bodies and the times


@typechecked
def clearance(body_a: Any, body_b: Any) -> sympy.Expr:
    """Return the smallest distance of two bodies over the motion, for outputs and requirements.

    Parameters
    ----------
    body_a : Body
        Body with shapes (`uqmbd.shapes`, or a mesh by `read_mesh` or `from_mesh`).
    body_b : Body or uqmbd.shapes.BodyShape
        Another body with shapes, or a shape that is fixed to the ground.

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
    Only methods that sample the inputs compute the quantity, because it is not a smooth function of the inputs; other
    methods refuse it. A minimum is found within 1e-4 of the size of the shapes, and then refined. The surface of a mesh
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
    expressions, pair, label = pair_of("clearance", body_a, body_b)
    found: sympy.Expr = _declared(_clearance, pair, pair.digest, label, len(expressions))(*expressions)
    return found


@typechecked
def clearance_over_time(body_a: Any, body_b: Any, times: Any) -> uqmbd.extend.OutputSeries:
    """Return the distance of two bodies at given times, for outputs: reports draw it over time.

    Parameters
    ----------
    body_a, body_b : Body, or uqmbd.shapes.BodyShape for `body_b`
        Bodies with shapes, as for `clearance`.
    times : sequence of float
        Increasing times, s. A realisation that does not reach a time fails.

    Returns
    -------
    uqmbd.extend.OutputSeries
        Distances, m, over the axis ``instant``, s. A distance is 0 if the bodies touch, or if one encloses the other.

    Raises
    ------
    uqmbd.StudyError
        If a body has no shape, the times do not increase, or python-fcl is not installed.

    Notes
    -----
    Only methods that sample the inputs compute distances, as for `clearance`. The smallest of these distances may
    exceed `clearance`, which also includes the times between them.

    Examples
    --------
    >>> import numpy as np, uqmbd, uqmbd_geometry
    >>> from uqmbd.shapes import Sphere
    >>> mechanism = uqmbd.Mechanism("balls", uqmbd.Translational())
    >>> one = mechanism.body("one", mass=1, velocity=(1, 0), shape=Sphere(0.1))
    >>> series = uqmbd_geometry.clearance_over_time(one, Sphere(0.1, position=(3, 0, 0)), [0, 1, 2])
    >>> mechanism.output("gap", series, units="m")
    >>> found = uqmbd.simulate(mechanism, [0, 2])
    >>> [round(float(found[f"gap at {t} s"]), 9) for t in (0, 1, 2)]
    [2.8, 1.8, 0.8]
    """
    where = "clearance_over_time"
    expressions, pair, label = pair_of(where, body_a, body_b)
    try:
        instants = tuple(np.asarray(times, dtype=float).ravel().tolist())
    except (TypeError, ValueError):
        raise uqmbd.StudyError(f"{where}: times is {times!r:.80}; expected a sequence of times in s.") from None
    if not instants or not np.isfinite(instants).all() or not (np.diff(instants) > 0).all():
        raise uqmbd.StudyError(f"{where}: times is {times!r:.80}; expected at least one finite time, increasing, in s.")
    digest = pair.digest + hashlib.sha256(repr(instants).encode()).hexdigest()
    data = Instants(pair, instants, digest)
    quantities = [
        _declared(_at_instant, data, digest, f"{label} at {one:g} s", len(expressions))(*expressions, k)
        for k, one in enumerate(instants)
    ]
    return uqmbd.extend.OutputSeries(quantities, instants, "instant", "s")


def instant_of(part: Any) -> float | None:
    """Return the time of a distance at a time, s; None for other parts of expressions."""
    data = getattr(getattr(part, "declared", None), "data", ())
    numbers = getattr(part, "numbers", ())
    return data[0].times[int(numbers[0])] if numbers and data and isinstance(data[0], Instants) else None


def _declared(function: Any, data: Any, digest: str, label: str, count: int) -> Any:
    """Return a summary with its data and label; its further arguments are numbers without a unit."""
    units = ["" if k else "m" for k in range(count)]
    return function.with_data(uqmbd.extend.SummaryData(data, digest, label), units[1:])


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
                return "a dimension of the shapes is not positive"
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

    def enclosed(self, time: float) -> bool:
        """Return whether a solid encloses another solid at a time, s."""
        (one, p), (two, q) = self.poses(np.array([time]))
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


@uqmbd.extend.summary(polynomials=True, power=1, smooth=False)
def _clearance(motion: uqmbd.extend.MotionPolynomials, pair: Pair) -> float | str:
    """Return the smallest distance over a motion, or the reason why there is none."""
    found: float | str = _remembered(pair.digest, motion, lambda: _smallest(motion, pair))
    return found


@uqmbd.extend.summary(polynomials=True, power=1, smooth=False)
def _at_instant(motion: uqmbd.extend.MotionPolynomials, data: Instants, number: float) -> float | str:
    """Return the distance at a time of the series, by the number of the time; or the reason why there is none."""
    found: Array | str = _remembered(data.digest, motion, lambda: _distances(motion, data))
    if isinstance(found, str):
        return found
    distance = float(found[int(number)])
    return distance if np.isfinite(distance) else f"the motion does not include the time {data.times[int(number)]:g} s"


def _remembered(digest: str, motion: uqmbd.extend.MotionPolynomials, compute: Callable[[], Any]) -> Any:
    """Return a result from the cache, or compute the result."""
    key = (digest, motion.begin.tobytes(), motion.coefficients.tobytes())
    if key not in _LATEST:
        if len(_LATEST) >= REMEMBERED:
            _LATEST.clear()
        _LATEST[key] = compute()
    return _LATEST[key]


_LATEST: dict[tuple[str, bytes, bytes], Any] = {}
"""Cache of the latest results: outputs and requirements may compute the same distances in sequence."""

REMEMBERED = 8
"""Largest number of results in the cache."""


def _distances(motion: uqmbd.extend.MotionPolynomials, data: Instants) -> Array | str:
    """Return the distances at the times of a series, NaN outside the motion; or the reason why there are none."""
    moving = _Motion(motion, data.pair)
    if reason := moving.invalid():
        return reason
    times = np.array(data.times)
    slack = INSIDE * float(motion.end[-1] - motion.begin[0])
    inside = (times >= motion.begin[0] - slack) & (times <= motion.end[-1] + slack)
    found = np.full(len(times), np.nan)
    seen = np.clip(times[inside], motion.begin[0], motion.end[-1])
    values = moving.distances(seen)
    # a surface may be inside another surface without touching it
    found[inside] = [0.0 if moving.enclosed(float(t)) else x for t, x in zip(seen, values, strict=True)]
    return found


def _smallest(motion: uqmbd.extend.MotionPolynomials, pair: Pair) -> float | str:
    """Return the smallest distance over a motion, by bisection with bounds of its rate, and refinement."""
    moving = _Motion(motion, pair)
    if reason := moving.invalid():
        return reason
    if moving.enclosed(float(motion.begin[0])):
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
