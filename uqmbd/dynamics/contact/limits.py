"""Choice of slipping contacts if friction reaches its limit in several contacts at the same time.

At the limit, sticking and slipping have equal forces and accelerations; their rates differ. For each contact at
its limit, let r be the rate of the reserve of friction. Let a be the rate of the acceleration along the direction of
the impending sliding::

    r >= 0,  a >= 0,  r a = 0

These conditions are a linear complementarity problem for all contacts at their limit.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from uqmbd.dynamics.contact.evaluator import ContactQuantities
from uqmbd.dynamics.contact.persistent import (
    ContactModes,
    ContactMotion,
    contact_motion,
    heading_of,
    persistent_touches,
    spread_of,
)
from uqmbd.dynamics.contact.redundant import AT_LIMIT, forces_valid_longest, motionless_combinations, reserves
from uqmbd.dynamics.linear import lemke
from uqmbd.typing import Array

__all__ = ["contacts_at_limit", "most_durable_forces", "slipping_together"]


RESTS = 1e-7
"""Acceleration along a surface that counts as zero, relative to the accelerations that the contact forces cause."""
NOISE = 1e-13
"""Relative noise in changes of accelerations."""
SLIPS = 1e-6
"""Least relevant change of an acceleration, relative to the largest change."""
TURNS = 4
"""Number of steps of Newton's method for the directions of sliding."""
SINGULAR = 1e-11
"""Relative size of a singular value that counts as zero."""


def contacts_at_limit(contacts: ContactQuantities, lasting: ContactModes, force: Array) -> list[int]:
    """Return the sticking contacts with friction at its limit, at one state with forces (direction,), N."""
    touches = persistent_touches(contacts, lasting)
    rooms = zip(lasting.modes, touches, reserves(touches, force).tolist(), strict=True)
    return [k for k, x, room in rooms if x.tangents and room <= AT_LIMIT * x.friction * force[x.normal]]


def most_durable_forces(
    contacts: ContactQuantities,
    ahead: ContactQuantities,
    lasting: ContactModes,
    motion: ContactMotion,
    span: float,
) -> ContactModes:
    """Choose internal forces of redundant sticking contacts that remain admissible longest under changing loads.

    The arguments are those of `slipping_together`; `span` is the time until `ahead`, s.
    """
    if lasting.internal is None or span <= 0:
        return lasting
    alone = lasting._replace(internal=None)
    rate = (contact_motion(ahead, alone).force[0] - contact_motion(contacts, alone).force[0]) / span
    ways = motionless_combinations(contacts.delassus[0], spread_of(contacts, lasting))
    force = forces_valid_longest(persistent_touches(contacts, lasting), motion.force[0], rate, ways)
    return lasting._replace(internal=lasting.internal + force - motion.force[0])


def slipping_together(
    contacts: ContactQuantities,
    ahead: ContactQuantities,
    lasting: ContactModes,
    motion: ContactMotion,
    limited: Sequence[int],
    forced: Collection[int],
) -> dict[int, Array] | None:
    """Return the slipping contacts among those at their limit, and their directions (tangent,), at one state.

    `ahead` are the contacts a short time later with the present motion.  The contacts `limited` stick so far; the
    contacts `forced` slip in any case.  The result contains at least one contact, or is None if no combination
    satisfies the laws.
    """
    force = motion.force[0]
    headings = {k: heading_of(force[contacts.tangents(k)]) for k in limited}
    slips = _slips(contacts, ahead, lasting, headings, forced, force)
    if slips is None:
        return None
    return _turned(contacts, lasting, {k: headings[k] for k in slips}, force)


def _slips(
    contacts: ContactQuantities,
    ahead: ContactQuantities,
    lasting: ContactModes,
    headings: dict[int, Array],
    forced: Collection[int],
    force: Array,
) -> list[int] | None:
    """Return the slipping contacts among contacts with `headings`, at least one."""
    every = sorted(headings)
    free = [k for k in every if k not in forced]
    if not free or len(every) == 1:
        return every
    now, later = (_Rates.of(x, lasting, headings, free) for x in (contacts, ahead))
    size = np.abs(now.along) @ np.abs(contacts.delassus[0]) @ np.abs(force)
    change = later.rate - now.rate
    # two evaluations of an acceleration differ by rounding, which Lemke's method must not treat as a change
    change[np.abs(change) <= NOISE * size] = 0.0
    offset = np.where(np.abs(now.rate) <= RESTS * size, 0.0, now.rate) + change
    # scale by the diagonal of the response, so that SLIPS has the same meaning for light and heavy bodies
    units = 1 / np.sqrt(np.maximum(np.abs(np.diag(now.response)), 1e-300))
    if not (np.isfinite(offset).all() and np.isfinite(now.response).all()):
        return None
    largest = float(np.abs(units * offset).max())
    if largest == 0.0:  # without changes, the limit and slipping are equivalent for all contacts
        return every
    offset, response = units * offset / largest, units[:, None] * now.response * units
    # complementarity: a free contact has either a reserve of friction or an acceleration along its heading
    reserve = lemke(response, offset)
    if reserve is None:
        return None
    after = offset + response @ reserve
    slips = {k for k, a in zip(free, after.tolist(), strict=True) if a > SLIPS}
    return sorted({*forced, *slips}) or every


def _turned(
    contacts: ContactQuantities, lasting: ContactModes, headings: dict[int, Array], force: Array
) -> dict[int, Array]:
    """Rotate headings so that contacts begin to slide along them.

    Friction of redundant contacts is not unique; a small rotation of a heading uses little of its reserve.
    """
    for _ in range(TURNS):
        now = _Rates.of(contacts, lasting, headings, ())
        turned = dict[int, Array]()
        for k, d in headings.items():
            most = float(contacts.law[0, k, 1]) * float(force[contacts.normal(k)])
            across = now.across.get(k, 0.0)
            if len(d) == 2 and abs(across) < most:
                new = most * d - across * np.array([-d[1], d[0]])
                turned[k] = new / np.linalg.norm(new)
            else:
                turned[k] = d
        headings = turned
    return headings


class _Rates(NamedTuple):
    """Accelerations of C contacts along their headings, if all contacts with headings slip.

    Fields are `rate` (C,), its `response` (C, C) to reserves of friction, and directions `along` (C, direction).
    `across` is the friction across the heading of a contact in three dimensions; it prevents sliding across the
    heading.
    """

    rate: Array
    response: Array
    along: Array
    across: dict[int, float]

    @classmethod
    def of(
        cls, contacts: ContactQuantities, lasting: ContactModes, headings: dict[int, Array], free: Sequence[int]
    ) -> _Rates:
        """Compute the accelerations along the headings of the contacts `free`, at one state."""
        slipping = ContactModes({**lasting.modes, **dict.fromkeys(headings, "slip")}, {**lasting.headings, **headings})
        matrix, unit = contacts.delassus[0], np.eye(contacts.speed.shape[1])
        columns = list(spread_of(contacts, slipping).T)
        rows, more, turning = list[Array](), list[Array](), list[int]()
        for k, mode in slipping.modes.items():
            tangents = contacts.tangents(k)
            rows.append(unit[contacts.normal(k)])
            if k in headings:
                columns[len(rows) - 1][tangents] = -contacts.law[0, k, 1] * headings[k]
                if len(tangents) == 2:
                    turning.append(k)
                    more.append(np.zeros(len(unit)))
                    more[-1][tangents] = -headings[k][1], headings[k][0]
            elif mode == "stick" and contacts.has_friction(k):
                rows += list(unit[tangents])
        along = np.zeros((len(free), len(unit)))
        for row, k in enumerate(free):
            along[row, contacts.tangents(k)] = headings[k]
        held, spread = np.array(rows + more), np.column_stack(columns + more)
        natural = contacts.bias[0] + contacts.slope[0] @ contacts.free[0, : contacts.coordinates]
        inner, right = held @ matrix @ spread, held @ np.column_stack([natural, matrix @ along.T])
        # absolute values do not cancel: the scale of a row stays positive where its forces have no effect
        units = 1 / np.sqrt(np.maximum(np.einsum("hd,de,he->h", np.abs(held), np.abs(matrix), np.abs(held)), 1e-300))
        if not (np.isfinite(inner).all() and np.isfinite(right).all()):
            return cls(np.full(len(free), np.nan), np.full((len(free), len(free)), np.nan), along, {})
        # redundant contacts make the matrix singular: use the forces of least norm
        inverse = np.linalg.pinv(units[:, None] * inner * units, rcond=SINGULAR)
        found = -units[:, None] * (inverse @ (units[:, None] * right))
        rates = along @ (np.column_stack([natural, matrix @ along.T]) + matrix @ spread @ found)
        across = dict(zip(turning, found[len(rows) :, 0].tolist(), strict=True))
        return cls(rates[:, 0], rates[:, 1:], along, across)
