"""Impacts of rigid bodies: Newton's law of restitution, with Coulomb friction of the impulses.

Bodies that approach each other at the same time collide at the same time; those that this makes approach each other
collide next, in the same instant (so a row of balls hands on a blow), until none do.

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
"""Most collisions in a row in one instant; after that, the impact is without restitution."""
FED = 1e-12
"""Energy that is none, over impulses times speeds."""


def impact(contacts: ContactQuantities, closed: list[int], approach: float) -> tuple[Array, set[int]] | None:
    """Jump of the velocities (coordinate,) in an impact, and the contacts that take part; None: no impulses do.

    Contacts are those of one state, right before; `closed` are the events whose gaps are closed; below the speed
    `approach`, m/s, bodies do not approach each other.

    Newton's law can feed in energy where friction stops or turns the sliding, or have no solution; there the impact is
    taken to be without restitution.  Of several solutions it is the first of `solutions` that feeds in no energy.
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
        impulse = _blow(contacts, closed if last else active, before, (earlier, worked), restitution=not last)
        if impulse is None:
            return None
        before = before + contacts.delassus[0] @ impulse
        total += impulse
        hit |= {k for k in closed if impulse[contacts.normal(k)] > 0}
    jump: Array = contacts.answer[0, : contacts.coordinates] @ total
    return jump, hit


def _blow(
    contacts: ContactQuantities, active: list[int], before: Array, so_far: tuple[float, float], *, restitution: bool
) -> Array | None:
    """Impulses of one collision of the `active` contacts, which never feeds in energy."""
    law, (earlier, worked) = contacts.law[0], so_far
    touches = tuple(
        Touch(contacts.normal(k), tuple(contacts.tangents(k)), float(law[k, 1]))
        if contacts.rubs(k)
        else Touch(contacts.normal(k))
        for k in active
    )
    back = np.maximum(0.0, [-law[k, 0] * before[contacts.normal(k)] for k in active])
    for wanted in (back, np.zeros(len(active))) if restitution and back.any() else (np.zeros(len(active)),):
        collision = Collision(contacts.delassus[0], before, touches, wanted, earlier)
        for impulse in solutions(collision):
            if collision.fed(impulse) <= FED * max(collision.worked(impulse), worked):
                return impulse
    return None
