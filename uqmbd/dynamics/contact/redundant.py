"""Forces of redundant contacts with the largest reserve to the limits of contact and friction.

Contact forces of a table on four legs, or of a disc wedged in a corner, are not unique. The bodies stay at rest while
at least one choice of forces satisfies the laws of contact and friction. Forces far from the limits of these laws
remain valid longest. The chosen forces therefore maximise the least reserve of all contacts. An interior-point method
with a logarithmic barrier solves this second-order cone problem [1]_. SciPy has no such method; the number of unknowns
is small.

References
----------
.. [1] S. Boyd, L. Vandenberghe, Convex Optimization, Cambridge University Press 2004, sections 11.3 and 11.6.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uqmbd.dynamics.contact.coulomb import Touch
from uqmbd.typing import Array

__all__ = ["AT_LIMIT", "forces_valid_longest", "reserves", "forces_with_largest_reserve", "motionless_combinations"]


HELD = 1 + 1e-9
"""Largest friction of a sticking contact, relative to its limit, as in the driver."""
AT_LIMIT = 3e-9
"""Reserve of friction, relative to its limit, that counts as zero."""
EXACT = 1e-11
"""Error of a reserve, relative to the size of the contact forces."""
SINGULAR = 1e-9
"""Relative size of a singular value that counts as zero."""
LARGEST = 1e3
"""Largest ratio of internal forces to the least forces."""
LONGEST = 10.0
"""Largest time over which forces must stay admissible, relative to the time in which they change by their size."""
NEARLY = 1e3
"""Ratio of the time of admissible forces to the optimality gap, its largest loss, above which the search ends."""
CENTRED = 1e-3
"""Square of the Newton decrement that counts as zero."""
FASTER = 10.0
"""Factor on the weight of the objective between barrier problems."""
NEWTON = 60
"""Largest number of steps for one barrier problem."""


def reserves(touches: Sequence[Touch], force: Array) -> Array:
    """Return the reserve of each contact (touch,), N: friction to its limit, or the normal force without tangents."""
    return np.array(
        [
            HELD * touch.friction * force[touch.normal] - float(np.linalg.norm(force[list(touch.tangents)]))
            if touch.tangents
            else force[touch.normal]
            for touch in touches
        ]
    )


def motionless_combinations(matrix: Array, spread: Array) -> Array:
    """Return a basis (direction, N) of the combinations of columns of `spread` (direction, column) without motion.

    `matrix` (direction, direction) contains rates per force.
    """
    units = 1 / np.sqrt(np.maximum(np.abs(np.diag(matrix)), 1e-300))
    size = np.linalg.norm(spread / units[:, None], axis=0)
    scaled = spread / np.where(size > 0, size, 1.0)
    _, values, right = np.linalg.svd(units[:, None] * matrix @ scaled)
    rank = int(np.sum(values > SINGULAR * values.max(initial=0.0)))
    return np.asarray(scaled @ right[rank:].T)


def forces_with_largest_reserve(touches: Sequence[Touch], least: Array, ways: Array) -> Array:
    """Return forces (direction,) in N, inside or nearest to the friction cones, with the largest least reserve.

    The touches have tangents if they stick.  The result is `least` (direction,) in N with the correct motion, plus a
    combination of `ways` (direction, N), which cause no motion (see `motionless_combinations`).
    """
    largest = float(np.abs(least).max(initial=0.0))
    if not (ways.shape[1] and largest > 0 and math.isfinite(largest) and np.isfinite(ways).all()):
        return least
    ways = ways * (largest / np.abs(ways).max(axis=0))
    sizes = np.maximum(np.abs(least[[x.normal for x in touches]]), 1e-6 * largest)
    # the reserve of contacts with unique forces cannot increase
    moved = [np.abs(ways[[x.normal, *x.tangents]]).max() > SINGULAR * largest for x in touches]
    begin, slope = _cones(touches, least, ways, sizes)
    slope[:, 0, -1] = -_factors(touches)
    barrier = _Barrier(begin[moved], slope[moved])
    x = np.zeros(ways.shape[1] + 1)
    x[-1] = barrier.least() - 1.0
    weight = 1.0
    while True:
        x = barrier.centred(x, weight)
        gap, room = barrier.parameter / weight, float(x[-1])
        if room > gap or room < -gap - AT_LIMIT or gap < EXACT:
            return np.asarray(least + ways @ x[:-1])
        weight *= FASTER


def forces_valid_longest(touches: Sequence[Touch], force: Array, rate: Array, ways: Array) -> Array:
    """Return forces (direction,) in N that stay in the friction cones longest at a `rate` (direction,) in N/s.

    The touches have tangents if they stick.  The result is `force` (direction,) in N plus a combination of `ways`
    (direction, N), which cause no motion.
    """
    largest, fastest = float(np.abs(force).max(initial=0.0)), float(np.abs(rate).max(initial=0.0))
    if not (ways.shape[1] and largest > 0 and fastest > 0 and np.isfinite([largest, fastest]).all()):
        return force
    ways = ways * (largest / np.abs(ways).max(axis=0))
    sizes = np.maximum(np.abs(force[[x.normal for x in touches]]), 1e-6 * largest)
    now, later = (_cones(touches, force, ways, sizes) for _ in range(2))
    later[1][:, :, -1] = _cones(touches, rate * (LONGEST * largest / fastest), ways, sizes)[0]
    barrier = _Barrier(np.concatenate([now[0], later[0]]), np.concatenate([now[1], later[1]]))
    x, weight = np.zeros(ways.shape[1] + 1), 1.0
    if not math.isfinite(barrier.value(x, weight)):
        return force
    while True:
        x = barrier.centred(x, weight)
        gap = barrier.parameter / weight
        if x[-1] > NEARLY * gap or gap < EXACT:
            return np.asarray(force + ways @ x[:-1])
        weight *= FASTER


@dataclass(frozen=True)
class _Barrier:
    """Barrier of C cones ``p >= |T|``, where ``(p, T) = begin + slope x``; the last unknown in x is the reserve."""

    begin: Array  # (C, 3)
    slope: Array  # (C, 3, unknown)

    @property
    def parameter(self) -> float:
        """Optimality gap times the weight of the objective."""
        return 2.0 * len(self.begin) + 3.0

    def least(self) -> float:
        """Return the reserve of all cones if the other unknowns are zero."""
        ratio = (self.begin[:, 0] - np.linalg.norm(self.begin[:, 1:], axis=1)) / -self.slope[:, 0, -1]
        return float(min(ratio.min(), 1.0))

    def value(self, x: Array, weight: float) -> float:
        """Return objective plus barrier; infinite outside the barrier."""
        cone = self.begin + self.slope @ x
        size = np.hypot(cone[:, 1], cone[:, 2])
        inside = cone[:, 0] - size
        top, ball = 1.0 - x[-1], LARGEST**2 - float(x[:-1] @ x[:-1])
        if not (inside > 0).all() or top <= 0 or ball <= 0:
            return math.inf
        product = inside * (cone[:, 0] + size)
        return float(-weight * x[-1] - np.log(product).sum() - math.log(top) - math.log(ball))

    def centred(self, x: Array, weight: float) -> Array:
        """Minimise objective plus barrier by Newton's method from an interior point."""
        sign, flat = np.array([1.0, -1.0, -1.0]), self.slope.reshape(-1, len(x))
        value = self.value(x, weight)
        for _ in range(NEWTON):
            cone = self.begin + self.slope @ x
            size = np.hypot(cone[:, 1], cone[:, 2])
            product = (cone[:, 0] - size) * (cone[:, 0] + size)
            rise = 2 * ((cone * sign)[:, None, :] @ self.slope)[:, 0] / product[:, None]
            gradient = -rise.sum(axis=0)
            hessian = rise.T @ rise - (flat * (2 / product[:, None] * sign).reshape(-1, 1)).T @ flat
            top, ball = 1.0 - x[-1], LARGEST**2 - float(x[:-1] @ x[:-1])
            gradient[-1] += 1 / top - weight
            hessian[-1, -1] += 1 / top**2
            out = 2 * x[:-1] / ball
            gradient[:-1] += out
            hessian[:-1, :-1] += np.outer(out, out) + 2 / ball * np.eye(len(out))
            try:
                step = -np.linalg.solve(hessian, gradient)
            except np.linalg.LinAlgError:
                break
            decrement = -float(gradient @ step)
            if not decrement > CENTRED:
                break
            length = 1.0 if decrement < 0.1 else 1 / (1 + math.sqrt(decrement))
            while not (new := self.value(x + length * step, weight)) < value and length > 1e-9:
                length *= 0.5
            if not new < value:
                break
            x, value = x + length * step, new
        return x


def _factors(touches: Sequence[Touch]) -> Array:
    """Return the width of the cone of each contact; 1 for a half-line, the cone of a contact without tangents."""
    return np.array([HELD * x.friction if x.tangents else 1.0 for x in touches])


def _cones(touches: Sequence[Touch], force: Array, ways: Array, sizes: Array) -> tuple[Array, Array]:
    """Return cones of contacts relative to their sizes: begin (C, 3), slope (C, 3, N + 1) with a zero last column."""
    begin, slope = np.zeros((len(touches), 3)), np.zeros((len(touches), 3, ways.shape[1] + 1))
    for row, touch in enumerate(touches):
        rows, places = [touch.normal, *touch.tangents], range(1 + len(touch.tangents))
        begin[row, places], slope[row, places, :-1] = force[rows] / sizes[row], ways[rows] / sizes[row]
    begin[:, 0] *= _factors(touches)
    slope[:, 0] *= _factors(touches)[:, None]
    return begin, slope
