"""Impulses of a collision that satisfy Newton's law of restitution and Coulomb's law of friction.

For each colliding contact, let N and T be the normal and the tangential impulse. Let n and s be the speeds after the
collision across and along the surface (n0 before it)::

    N >= 0,  n + e n0 >= 0,  N (n + e n0) = 0
    |T| <= mu N,  and where s is not zero: T = -mu N s / |s|

so that friction opposes the sliding *after* the collision [1]_.  The laws may have several solutions or, with
restitution, no solution.  Without restitution they have at least one solution [2]_, which never adds energy.

References
----------
.. [1] F. Pfeiffer, C. Glocker, Multibody Dynamics with Unilateral Contacts, Wiley 1996.
.. [2] D. E. Stewart, J. C. Trinkle, International Journal for Numerical Methods in Engineering 39 (1996) 2673-2691.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqmbd.dynamics.linear import lemke
from uqmbd.typing import Array, Mask

__all__ = ["EXACT", "Collision", "Touch", "scaled_solution", "solutions"]


EXACT = 1e-10
"""Largest violation of the laws, relative to the size of impulses."""
SINGULAR = 1e-11
"""Relative size of a singular value that counts as zero."""
MOST_MODES = 64
"""Largest number of combinations of modes for enumeration."""
FACETS = (12, 33, 120)
"""Numbers of facets of friction pyramids, for the initial values of the iteration."""
NEWTON = 40
"""Largest number of steps of an iteration."""


@dataclass(frozen=True)
class Touch:
    """Contact in a collision."""

    normal: int  # index of its normal direction
    tangents: tuple[int, ...] = ()  # indices of its tangential directions; empty without friction
    friction: float = 0.0  # coefficient of friction
    given: bool = False  # whether the normal impulse is prescribed, as for dry friction with a given limit


@dataclass(frozen=True)
class Collision:
    """Simultaneous collision of contacts."""

    matrix: Array  # (direction, direction): jumps of the speeds, m/s, per impulse, N s
    before: Array  # (direction,): speeds, m/s
    touches: tuple[Touch, ...]
    rebound: Array  # (touch,): least normal speeds after the collision, m/s
    # largest jump of a speed, m/s, in earlier collisions at the same instant; its rounding error remains in
    # the speeds
    earlier: float = 0.0

    @cached_property
    def units(self) -> Array:
        """Return a unit of impulse for each direction, shape (direction,), because masses may differ widely.

        The unit is the approximate impulse for a change of the speed by 1 m/s.
        """
        found = np.full(len(self.before), float(self.answers.max(initial=1.0)))
        for touch, answer in zip(self.touches, self.answers, strict=True):
            found[[touch.normal, *touch.tangents]] = answer
        return found

    @cached_property
    def free(self) -> Mask:
        """Mask (direction,): false for normal directions with a given limit of dry friction.

        Such limits may be much larger than all forces.
        """
        found = np.ones(len(self.before), dtype=bool)
        found[[x.normal for x in self.touches if x.given]] = False
        return found

    @cached_property
    def answers(self) -> Array:
        """Return the approximate impulse per speed of each contact, shape (touch,)."""
        diagonal = np.abs(np.diag(self.matrix))
        largest = np.array([diagonal[[x.normal, *x.tangents]].max() for x in self.touches])
        return np.asarray(1 / np.maximum(largest, 1e-300))

    def after(self, impulse: Array) -> Array:
        """Return the speeds after impulses, m/s, shape (direction,)."""
        return np.asarray(self.before + self.matrix @ impulse)

    def added_energy(self, impulse: Array) -> float:
        """Return the energy that impulses add, J."""
        return float(0.5 * impulse @ (self.before + self.after(impulse)))

    def exchanged_energy(self, impulse: Array) -> float:
        """Return the size of the energies that impulses exchange, J."""
        return float(np.abs(impulse) @ np.abs(self.before))

    def required_impulses(self, impulse: Array) -> Array:
        """Compute the speeds after the given impulses, and return the impulses that the laws require at these speeds.

        A solution remains unchanged.
        """
        after, found = self.after(impulse), np.zeros_like(impulse)
        for touch, rebound, answer in zip(self.touches, self.rebound, self.answers, strict=True):
            n, t = touch.normal, list(touch.tangents)
            found[n] = max(0.0, impulse[n] - answer * (after[n] - rebound))
            if t:
                tried = impulse[t] - answer * after[t]
                size, most = float(np.linalg.norm(tried)), touch.friction * found[n]
                found[t] = tried if size <= most else tried * (most / size)
        return found

    def violation(self, impulse: Array) -> float:
        """Return the violation of the laws, relative to the speeds and impulses; all are converted to speeds."""
        if not np.isfinite(impulse).all():
            return math.inf
        size = max(self.earlier, float(np.abs(impulse / self.units).max(initial=0.0)))
        size = max(size, *(abs(float(self.before[x.normal])) for x in self.touches), 1e-300)
        return float((np.abs(impulse - self.required_impulses(impulse)) / self.units).max(initial=0.0)) / size


def solutions(collision: Collision) -> Iterator[Array]:
    """Yield impulses (direction,) that satisfy the laws, always in the same order.

    For few contacts in planar space, and for one contact in three dimensions, all solutions are returned. The modes of
    each contact determine the order of solutions: stick, slip on, slip back, no impulse. For more contacts, an
    iteration finds solutions.
    """
    touches = collision.touches
    plane = all(len(x.tangents) <= 1 for x in touches)
    count = math.prod(4 if x.tangents else 2 for x in touches)
    if plane and count <= MOST_MODES:
        candidates = _in_plane(collision)
    elif len(touches) == 1:
        candidates = _one_in_space(collision)
    else:
        candidates = _iterated(collision)
    for impulse in candidates:
        if collision.violation(impulse) <= EXACT:
            yield impulse


def scaled_solution(matrix: Array, right: Array, units: Array) -> Array:
    """Solve for the impulses (..., N) of least norm in their units; contacts may be redundant (four table legs)."""
    inner = matrix * units[..., :, None] * units[..., None, :]
    return np.asarray(units * (np.linalg.pinv(inner, rcond=SINGULAR) @ (units * right)[..., None])[..., 0])


def _with_modes(collision: Collision, held: list[int], spread: Array, right: Array) -> Array:
    """Return impulses ``spread x`` with speed jumps `right` in the directions `held`."""
    inner = collision.matrix[held] @ spread
    if len(held) == 1:
        return np.asarray(spread[:, 0] * (right[0] / inner[0, 0] if inner[0, 0] else np.inf))
    return np.asarray(spread @ scaled_solution(inner, right, np.sqrt(collision.units[held])))


def _in_plane(collision: Collision) -> Iterator[Array]:
    """Yield candidates for all combinations of modes of contacts with at most one tangent."""
    size = len(collision.before)
    modes = [("stick", "on", "back", "open") if x.tangents else ("push", "open") for x in collision.touches]
    for chosen in itertools.product(*modes):
        held, right, columns = list[int](), list[float](), list[Array]()
        for touch, rebound, mode in zip(collision.touches, collision.rebound, chosen, strict=True):
            if mode == "open":
                continue
            column = np.zeros(size)
            column[touch.normal] = 1.0
            held.append(touch.normal)
            right.append(rebound - collision.before[touch.normal])
            columns.append(column)
            if mode == "stick":
                along = np.zeros(size)
                along[touch.tangents[0]] = 1.0
                held.append(touch.tangents[0])
                right.append(-collision.before[touch.tangents[0]])
                columns.append(along)
            elif mode in ("on", "back"):
                sense = math.copysign(1.0, collision.before[touch.tangents[0]])
                column[touch.tangents[0]] = -touch.friction * (sense if mode == "on" else -sense)
        if not held:
            yield np.zeros(size)
            continue
        yield _with_modes(collision, held, np.column_stack(columns), np.array(right))


def _one_in_space(collision: Collision) -> Iterator[Array]:
    """Yield candidates for one contact with two tangents.

    The angle a of the slip direction satisfies an equation of second order in cos(a) and sin(a).
    The equation is of fourth order in exp(i a).
    """
    (touch,), size = collision.touches, len(collision.before)
    n, t = touch.normal, list(touch.tangents)
    needed = float(collision.rebound[0] - collision.before[n])
    directions = [n, *t]
    stick = np.zeros(size)
    right = np.array([needed, *(-collision.before[t])])
    inner_matrix = collision.matrix[np.ix_(directions, directions)]
    stick[directions] = scaled_solution(inner_matrix, right, np.sqrt(collision.units[directions]))
    yield stick
    sliding, mu = collision.before[t], touch.friction
    inner, across, along = collision.matrix[n, n], collision.matrix[n, t], collision.matrix[np.ix_(t, t)]

    def turned(angle: float) -> float:
        """Return the component of the sliding perpendicular to the direction.

        It is multiplied by the denominator of the normal impulse.
        """
        d = np.array([math.cos(angle), math.sin(angle)])
        slide = sliding * (inner - mu * across @ d) + needed * (across - mu * along @ d)
        return float(d[0] * slide[1] - d[1] * slide[0])

    samples = np.array([turned(2 * np.pi * k / 5) for k in range(5)])
    harmonics = np.fft.fft(samples) / 5
    if not np.isfinite(harmonics).all():
        return
    roots = np.roots([harmonics[2], harmonics[1], harmonics[0], harmonics[4], harmonics[3]])
    first = math.atan2(sliding[1], sliding[0])
    angles = [math.remainder(float(np.angle(z)) - first, 2 * math.pi) for z in roots if abs(abs(z) - 1) < 1e-3]
    for offset in sorted(angles, key=abs):
        turn = np.exp(1j * (first + offset))
        for _ in range(3):  # roots of a polynomial have fewer correct digits
            value, rate = (
                (harmonics[0] + 2 * harmonics[1] * turn + 2 * harmonics[2] * turn**2).real,
                (2j * harmonics[1] * turn + 4j * harmonics[2] * turn**2).real,
            )
            turn *= np.exp(-1j * value / rate) if abs(value) < abs(rate) else 1.0
        d = np.array([turn.real, turn.imag])
        divisor = float(inner - mu * across @ d)
        impulse = np.zeros(size)
        impulse[n] = needed / divisor if divisor else np.inf
        impulse[t] = -mu * impulse[n] * d
        yield impulse
    yield np.zeros(size)


def _iterated(collision: Collision) -> Iterator[Array]:
    """Yield impulses that the laws leave unchanged, by Newton's method."""
    yield _improved(collision, _all_hit(collision))
    for facets in FACETS:
        if (impulse := _on_pyramids(collision, facets)) is not None:
            yield _improved(collision, impulse)


def _all_hit(collision: Collision) -> Array:
    """Return the impulses if all contacts are hit and stick."""
    found = np.zeros(len(collision.before))
    held = [j for x in collision.touches for j in (x.normal, *x.tangents)]
    jump = -collision.before
    jump[[x.normal for x in collision.touches]] += collision.rebound
    found[held] = scaled_solution(collision.matrix[np.ix_(held, held)], jump[held], np.sqrt(collision.units[held]))
    return found


def _on_pyramids(collision: Collision, facets: int) -> Array | None:
    """Return impulses for friction pyramids, from a linear complementarity problem; exact in planar space."""
    size, count = len(collision.before), len(collision.touches)
    columns, owner, rebound = list[Array](), list[int](), list[float]()
    for k, (touch, least) in enumerate(zip(collision.touches, collision.rebound, strict=True)):
        column = np.zeros(size)
        column[touch.normal] = 1.0
        columns.append(column)
        owner.append(-1)
        rebound.append(least)
        for direction in _facets(collision.before[list(touch.tangents)], facets):
            column = np.zeros(size)
            column[list(touch.tangents)] = direction
            columns.append(column)
            owner.append(k)
            rebound.append(0.0)
    spread, owners = np.column_stack(columns), np.array(owner)
    share = (owners[:, None] == np.arange(count)).astype(float)
    normals = np.flatnonzero(owners < 0)
    limit = -share.T
    limit[range(count), normals] = [x.friction for x in collision.touches]
    # units of impulses for which the matrix has a size of about one
    unit = 1 / float(collision.answers.mean())
    inner = np.block([[spread.T @ collision.matrix @ spread / unit, share], [limit, np.zeros((count, count))]])
    offset = np.concatenate([spread.T @ collision.before - rebound, np.zeros(count)])
    fast = float(np.abs(offset).max(initial=0.0))
    found = lemke(inner, offset / fast) if fast > 0 else np.zeros(len(offset))
    return None if found is None else np.asarray(spread @ found[: len(owners)]) * (fast / unit)


def _facets(sliding: Array, count: int) -> Array:
    """Return directions of friction, shape (facet, tangent); the first is opposite to the sliding."""
    if len(sliding) < 2:
        return np.array([[-1.0], [1.0]])[:, : len(sliding)] if len(sliding) else np.zeros((0, 0))
    angles = math.atan2(sliding[1], sliding[0]) + np.pi + 2 * np.pi * np.arange(count) / count
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _improved(collision: Collision, impulse: Array) -> Array:
    """Improve impulses by Newton's method.

    If a step gives no improvement, try shorter steps, and then a fixed-point step.
    """
    units = collision.units
    rest = impulse - collision.required_impulses(impulse)
    for _ in range(NEWTON):
        if not np.isfinite(rest).all() or collision.violation(impulse) <= 1e-3 * EXACT:
            break
        slope = _slope(collision, impulse) * units / units[:, None]
        step = -units * (np.linalg.pinv(slope, rcond=SINGULAR) @ (rest / units))
        for length in (1.0, 0.5, 0.25, 0.1):
            new = impulse + length * step
            new_rest = new - collision.required_impulses(new)
            if np.linalg.norm(new_rest / units) < (1 - 0.1 * length) * np.linalg.norm(rest / units):
                break
        else:
            new = impulse - rest / len(collision.touches)
            new_rest = new - collision.required_impulses(new)
        impulse, rest = new, new_rest
    return impulse


def _slope(collision: Collision, impulse: Array) -> Array:
    """Return the derivative of ``impulse - required_impulses(impulse)``, shape (direction, direction)."""
    found, after = np.eye(len(impulse)), collision.after(impulse)
    for touch, rebound, answer in zip(collision.touches, collision.rebound, collision.answers, strict=True):
        n, t = touch.normal, list(touch.tangents)
        tried = impulse[n] - answer * (after[n] - rebound)
        if tried <= 0:
            continue
        found[n] = answer * collision.matrix[n]
        if not t:
            continue
        along, most = impulse[t] - answer * after[t], touch.friction * tried
        size = float(np.linalg.norm(along))
        if size <= most:
            found[t] = answer * collision.matrix[t]
            continue
        direction = along / size
        moved = np.eye(len(impulse)) - answer * collision.matrix
        across = np.eye(len(t)) - np.outer(direction, direction)
        found[t] -= touch.friction * np.outer(direction, moved[n]) + (most / size) * across @ moved[t]
    return found
