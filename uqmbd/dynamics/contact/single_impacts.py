"""Impacts with one contact each, for many states at once; most impacts are of this kind.

The laws, and the order of their solutions, are those of `uqmbd.dynamics.contact.impacts`. That module treats the
remaining cases: several contacts at once, and slipping contacts in three dimensions.
"""

from __future__ import annotations

import numpy as np

from uqmbd.dynamics.contact.coulomb import EXACT
from uqmbd.dynamics.contact.evaluator import ContactQuantities
from uqmbd.dynamics.contact.impacts import FED
from uqmbd.typing import Array, Index, Mask

__all__ = ["solve_single_impacts"]


def solve_single_impacts(contacts: ContactQuantities, events: Index) -> tuple[Array, Array, Mask]:
    """Solve for impulses (T, direction) at one approaching contact, `events` (T,), of each of T states.

    The states are those right before impact.  Return impulses, normal speeds after impact (T,), m/s, and a mask (T,) of
    the solved states.
    """
    first = np.array(contacts.first)
    tangents = first[events + 1] - first[events] - 1
    tangents[contacts.law[np.arange(len(events)), events, 1] <= 0] = 0
    impulse = np.zeros_like(contacts.speed)
    after, solved = np.zeros(len(events)), np.zeros(len(events), dtype=bool)
    for count, solve in enumerate((_smooth, _in_plane, _sticking)):
        some = np.flatnonzero(tangents == count)
        if len(some):
            directions = first[events[some]][:, None] + np.arange(1 + count)
            matrix = contacts.delassus[some[:, None, None], directions[:, :, None], directions[:, None, :]]
            before, law = contacts.speed[some[:, None], directions], contacts.law[some, events[some]]
            found, solved[some] = solve(matrix, before, law)
            impulse[some[:, None], directions] = found
            after[some] = before[:, 0] + np.sum(matrix[:, 0] * found, axis=1)
    return impulse, after, solved


def _smooth(matrix: Array, before: Array, law: Array) -> tuple[Array, Mask]:
    """Return impulses (T, 1) without friction, and a mask of valid impulses."""
    impulse = -(1 + law[:, :1]) * before / matrix[:, 0]
    return impulse, (law[:, 0] >= 0) & (law[:, 0] <= 1) & (impulse[:, 0] > 0) & np.isfinite(impulse[:, 0])


def _in_plane(matrix: Array, before: Array, law: Array) -> tuple[Array, Mask]:
    """Return impulses (T, 2) with friction in planar space: the first valid mode of stick, slip on, and slip back.

    If restitution has no valid mode, because it adds energy, the impact is without restitution.
    """
    found, solved = _with_restitution(matrix, before, law)
    rest = np.flatnonzero(~solved)
    if len(rest):
        plain = law[rest] * [0.0, 1.0]
        found[rest], solved[rest] = _with_restitution(matrix[rest], before[rest], plain)
    return found, solved


def _with_restitution(matrix: Array, before: Array, law: Array) -> tuple[Array, Mask]:
    """Return impulses (T, 2) in planar space with the given restitution, and a mask of valid ones."""
    (a, b), (c, d) = matrix.transpose(1, 2, 0)
    normal, along = before.T
    mu, sense = law[:, 1], np.copysign(1.0, before[:, 1])
    rebound = np.maximum(0.0, -law[:, 0] * normal)
    jump, determinant = rebound - normal, a * d - b * c
    candidates = [np.stack([(d * jump + b * along) / determinant, (-c * jump - a * along) / determinant], axis=1)]
    for share in (-mu * sense, mu * sense):
        push = jump / (a + b * share)
        candidates.append(np.stack([push, share * push], axis=1))
    found, solved = np.zeros_like(before), np.zeros(len(before), dtype=bool)
    for impulse in candidates:
        good = ~solved & _holds(matrix, before, mu, rebound, impulse)
        found[good], solved[good] = impulse[good], True
        if solved.all():
            break
    return found, solved


def _sticking(matrix: Array, before: Array, law: Array) -> tuple[Array, Mask]:
    """Return the impulses (T, 3) of sticking contacts with friction in three dimensions."""
    rebound = np.maximum(0.0, -law[:, 0] * before[:, 0])
    right = -before
    right[:, 0] += rebound
    impulse = np.full_like(right, np.nan)
    regular = np.abs(np.linalg.det(matrix)) > 1e-9 * np.abs(np.prod(np.diagonal(matrix, axis1=1, axis2=2), axis=1))
    if regular.any():
        impulse[regular] = np.linalg.solve(matrix[regular], right[regular][:, :, None])[:, :, 0]
    solved = _holds(matrix, before, law[:, 1], rebound, impulse)
    impulse[~solved] = 0.0
    return impulse, solved


def _holds(matrix: Array, before: Array, mu: Array, rebound: Array, impulse: Array) -> Mask:
    """Return whether impulses satisfy the laws and add no energy, see `Collision`."""
    after = before + np.sum(matrix * impulse[:, None, :], axis=2)
    answer = 1 / np.maximum(np.abs(np.diagonal(matrix, axis1=1, axis2=2)).max(axis=1), 1e-300)
    push = np.maximum(0.0, impulse[:, 0] - answer * (after[:, 0] - rebound))
    tried = impulse[:, 1:] - answer[:, None] * after[:, 1:]
    length = np.sqrt(np.sum(tried * tried, axis=1))
    most = mu * push
    factor = np.where(length <= most, 1.0, most / np.maximum(length, 1e-300))
    required_impulses = np.concatenate([push[:, None], tried * factor[:, None]], axis=1)
    size = np.maximum(np.abs(impulse).max(axis=1) / answer, np.maximum(np.abs(before[:, 0]), 1e-300))
    violation = np.abs(impulse - required_impulses).max(axis=1) / answer / size
    added_energy = 0.5 * np.sum(impulse * (before + after), axis=1)
    worked = np.sum(np.abs(impulse) * np.abs(before), axis=1)
    good: Mask = (
        (violation <= EXACT) & (added_energy <= FED * worked) & np.isfinite(impulse).all(axis=1) & (impulse[:, 0] > 0)
    )
    return good
