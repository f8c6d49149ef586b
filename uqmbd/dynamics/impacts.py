"""Impacts of rigid bodies: Newton's law of restitution, with Coulomb friction of the impulses.

Bodies that approach each other at the same time collide at the same time; those that this makes approach each other
collide next, in the same instant (so a row of balls hands on a blow), until none do.

References
----------
.. [1] F. Pfeiffer, C. Glocker, Multibody Dynamics with Unilateral Contacts, Wiley 1996.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics.contacts import ROUNDS, Contacts, Mode, complementary, spread_solution

__all__ = ["impact"]

Array = NDArray[np.float64]

BLOWS = 200
"""Most collisions in a row in one instant; after that, the impact is without restitution."""


def impact(contacts: Contacts, closed: list[int], approach: float) -> tuple[Array, set[int]]:
    """Jump of the velocities in an impact, shape (coordinate,), and the contacts that take part.

    Parameters
    ----------
    contacts : Contacts
        Of one state, right before.
    closed : list of int
        Events whose gaps are closed.
    approach : float
        Speed, m/s, below which bodies do not approach each other.

    Notes
    -----
    Newton's law can feed in energy where friction turns the direction of sliding; there the impact is taken to be
    without restitution, and if need be without friction.
    """
    total = np.zeros(contacts.speed.shape[1])
    before, hit = contacts.speed[0].copy(), set[int]()
    for blow in range(BLOWS + 1):
        active = [k for k in closed if before[contacts.normal(k)] < -approach]
        if not active:
            break
        last = blow == BLOWS
        impulse = _blow(contacts, closed if last else active, before, 0.0 if last else 1.0)
        before = before + contacts.delassus[0] @ impulse
        total += impulse
        hit |= {k for k in closed if impulse[contacts.normal(k)] > 0}
    jump: Array = contacts.answer[0, : contacts.coordinates] @ total
    return jump, hit


def _blow(contacts: Contacts, active: list[int], before: Array, restitution: float) -> Array:
    """Impulses of one collision of the `active` contacts, which never feeds in energy."""
    for e, friction in ((restitution, 1.0), (0.0, 1.0), (restitution, 0.0)):
        impulse = _impulses(contacts, active, before, e, friction)
        if impulse is None:
            continue
        after = before + contacts.delassus[0] @ impulse
        if 0.5 * impulse @ (before + after) <= 1e-13 * (abs(impulse) @ abs(before)):
            return impulse
    impulse = np.zeros(len(before))
    normals = [contacts.normal(k) for k in active]
    impulse[normals] = complementary(contacts.delassus[0][np.ix_(normals, normals)], before[normals])
    return impulse


def _impulses(
    contacts: Contacts, active: list[int], before: Array, restitution: float, friction: float
) -> Array | None:
    """Impulses in all directions; None: no set of contacts and modes satisfies all laws."""
    law = contacts.law[0]
    pushing = list(active)
    modes: dict[int, tuple[Mode, Array]] = {}
    for k in active:
        rubs = contacts.rubs(k) and friction > 0
        modes[k] = ("stick" if rubs else "slip", np.zeros(len(contacts.tangents(k))))
    for _ in range(ROUNDS):
        rows: list[int] = []
        right: list[float] = []
        coupled = {}
        for k in pushing:
            n, tangents = contacts.normal(k), contacts.tangents(k)
            rows.append(n)
            right.append(-(1 + restitution * law[k, 0]) * before[n] if before[n] < 0 else -before[n])
            mode, direction = modes[k]
            if mode == "stick":
                rows += tangents
                right += [-before[j] for j in tangents]
            elif friction > 0 and direction.any():
                coupled[n] = (tangents, (law[k, 1] * direction)[None, :])
        impulse = spread_solution(contacts.delassus, np.array([right]), rows, coupled)[0]
        if not np.isfinite(impulse).all():
            return None
        change = _revised(contacts, pushing, active, modes, impulse, before)
        if change is None:
            return np.asarray(impulse)
        pushing = change
    return None


def _revised(
    contacts: Contacts,
    pushing: list[int],
    active: list[int],
    modes: dict[int, tuple[Mode, Array]],
    impulse: Array,
    before: Array,
) -> list[int] | None:
    """Change modes, or the contacts that push, where a law is not satisfied; None: all are."""
    size = abs(impulse).max(initial=0.0)
    if pushing and impulse[contacts.normal(worst := min(pushing, key=lambda k: impulse[contacts.normal(k)]))] < 0:
        return [k for k in pushing if k != worst]
    for k in pushing:
        tangents = contacts.tangents(k)
        if modes[k][0] == "stick" and tangents:
            along, most = impulse[tangents], contacts.law[0, k, 1] * impulse[contacts.normal(k)]
            if np.linalg.norm(along) > most * (1 + 1e-9) + 1e-15 * size:
                sliding = before[tangents]
                fast = np.linalg.norm(sliding)
                moving = fast > 1e-12 * abs(before).max()
                modes[k] = ("slip", -sliding / fast if moving else along / np.linalg.norm(along))
                return pushing
    after = before + contacts.delassus[0] @ impulse
    for k in active:
        if k not in pushing and after[contacts.normal(k)] < -1e-12 * abs(before).max(initial=0.0):
            return [*pushing, k]
    return None
