"""Impacts of rigid bodies: Newton's law of restitution with Coulomb friction of the impulses.

Bodies that approach each other at the same time collide simultaneously. Bodies that approach as a result collide next,
at the same instant, until no bodies approach. An impact thus propagates through a row of balls.

References
----------
.. [1] F. Pfeiffer, C. Glocker, Multibody Dynamics with Unilateral Contacts, Wiley 1996.
"""

from __future__ import annotations

import numpy as np

from uqmbd.dynamics.contact.coulomb import Collision, Touch, solutions
from uqmbd.dynamics.contact.evaluator import ContactQuantities
from uqmbd.typing import Array

__all__ = ["impact"]


BLOWS = 200
"""Largest number of consecutive collisions at an instant; after them, the impact is without restitution."""
FED = 1e-12
"""Energy, relative to impulses times speeds, that counts as zero."""


def impact(contacts: ContactQuantities, closed: list[int], approach: float) -> tuple[Array, set[int]] | None:
    """Return the jump of velocities (coordinate,) in an impact and the hit contacts; None if no impulses exist.

    `contacts` belong to one state right before the impact; `closed` are the events with closed gaps. Bodies with a
    relative speed below `approach`, m/s, do not approach each other.

    Newton's law can add energy if friction stops or turns the sliding, or have no solution; then the impact is without
    restitution.  The first result of `solutions` that adds no energy is used.
    """
    total = np.zeros(contacts.speed.shape[1])
    before, hit = contacts.speed[0].copy(), set[int]()
    for blow in range(BLOWS + 1):
        active = [k for k in closed if before[contacts.normal(k)] < -approach]
        if not active:
            break
        last = blow == BLOWS
        earlier = float(np.abs(total * np.diag(contacts.delassus[0])).max(initial=0.0))
        worked = float(np.abs(total) @ np.abs(contacts.speed[0]))
        impulse = _collision_impulses(
            contacts, closed if last else active, before, (earlier, worked), restitution=not last
        )
        if impulse is None:
            return None
        before = before + contacts.delassus[0] @ impulse
        total += impulse
        hit |= {k for k in closed if impulse[contacts.normal(k)] > 0}
    jump: Array = contacts.answer[0, : contacts.coordinates] @ total
    return jump, hit


def _collision_impulses(
    contacts: ContactQuantities, active: list[int], before: Array, so_far: tuple[float, float], *, restitution: bool
) -> Array | None:
    """Return impulses of one collision of the `active` contacts, which never add energy."""
    law, (earlier, worked) = contacts.law[0], so_far
    touches = tuple(
        Touch(contacts.normal(k), tuple(contacts.tangents(k)), float(law[k, 1]))
        if contacts.has_friction(k)
        else Touch(contacts.normal(k))
        for k in active
    )
    back = np.maximum(0.0, [-law[k, 0] * before[contacts.normal(k)] for k in active])
    for rebound in (back, np.zeros(len(active))) if restitution and back.any() else (np.zeros(len(active)),):
        collision = Collision(contacts.delassus[0], before, touches, rebound, earlier)
        for impulse in solutions(collision):
            if collision.added_energy(impulse) <= FED * max(collision.exchanged_energy(impulse), worked):
                return impulse
    return None
