"""Persistent contacts: detection of the contacts, and their forces and accelerations.

The forces follow Signorini's and Coulomb's laws [1]_.  All closed contacts at a time are solved together; their number
is expected to be small.

References
----------
.. [1] F. Pfeiffer, C. Glocker, Multibody Dynamics with Unilateral Contacts, Wiley 1996.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from uqmbd.dynamics.contact.coulomb import EXACT, Collision, Touch, scaled_solution, solutions
from uqmbd.dynamics.contact.evaluator import ContactEvaluator, ContactQuantities
from uqmbd.dynamics.contact.redundant import AT_LIMIT, forces_with_largest_reserve, motionless_combinations, reserves
from uqmbd.typing import Array

__all__ = [
    "CLOSED",
    "ContactModes",
    "Mode",
    "PersistentContacts",
    "StateInContact",
    "contact_forces",
    "contact_motion",
    "heading_of",
    "persistent_touches",
    "persistent_contacts",
    "onto_contacts",
    "pressed",
    "spread_of",
    "states_in_contact",
    "with_internal",
]

Mode = Literal["stick", "slip"]

CLOSED = 1e-9
"""Gap, relative to the size of the mechanism, that counts as closed."""
RESTS = 1e-8
"""Acceleration along a surface, relative to accelerations without contacts, that counts as zero."""
UNMOVED = 1e-6
"""Internal forces, relative to all forces, that count as zero."""
CLEAR = 1e-6
"""Excess of friction over its limit, relative to the limit, that counts as zero where guards have just fallen."""
PRESSED = 1e-9
"""Normal force of a redundant contact, relative to the largest force, that counts as zero."""
UNSTABLE = 1e-9
"""Negative stiffness of a contact due to coupled bodies, relative to its own stiffness, that counts as zero."""
STILL = 1e-7
"""Speed in a persistent contact with projected velocities, relative to the mechanism's speed, that counts as zero."""


class ContactModes(NamedTuple):
    """Modes of persistent contacts (stick or slip), and headings of slipping contacts.

    For redundant contacts, `internal` forces (direction,), N, are added to the least forces; they cause no motion.
    """

    modes: dict[int, Mode]
    headings: dict[int, Array]
    internal: Array | None = None


@dataclass(frozen=True)
class ContactMotion:
    """Motion of T states with persistent contacts."""

    motion: Array  # (T, coordinate + multiplier): accelerations, then multipliers of the kept equations
    force: Array  # (T, direction): contact forces, N
    rate: Array  # (T, direction): rates of the relative velocities


def contact_forces(
    matrix: Array, right: Array, rows: list[int], coupled: Mapping[int, tuple[list[int], Array]]
) -> Array:
    """Solve for forces (T, direction) in `rows` from rates per force (T, direction, direction), `right` (T, len(rows)).

    The mapping `coupled` contains, for a normal direction, tangents and the ratios (T, tangent) of tangential to normal
    forces.
    """
    count, size = matrix.shape[:2]
    found = np.zeros((count, size))
    if not rows:
        return found
    spread = np.zeros((count, size, len(rows)))
    spread[:, rows, range(len(rows))] = 1.0
    for column, row in enumerate(rows):
        if row in coupled:
            tangents, share = coupled[row]
            spread[:, tangents, column] = share
    inner = matrix[:, rows, :] @ spread
    if len(rows) == 1:
        with np.errstate(all="ignore"):
            return np.asarray(spread[:, :, 0] * (right / inner[:, :, 0]))
    if not (np.isfinite(inner).all() and np.isfinite(right).all()):
        return np.full((count, size), np.nan)
    # solve each state separately: forces of redundant contacts must not depend on other states of the call
    units = 1 / np.sqrt(np.maximum(np.abs(np.diagonal(matrix, axis1=1, axis2=2)[:, rows]), 1e-300))
    return np.asarray((spread @ scaled_solution(inner, right, units)[:, :, None])[:, :, 0], dtype=float)


def contact_motion(contacts: ContactQuantities, lasting: ContactModes) -> ContactMotion:
    """Solve for accelerations and contact forces with given modes of the persistent contacts.

    Each sliding contact has a heading (tangent,) near its direction of sliding. Friction does not reverse when the
    speed passes zero, so that a smooth integration detects the zero.
    """
    free = contacts.bias + np.einsum("twn,tn->tw", contacts.slope, contacts.free[:, : contacts.coordinates])
    rows: list[int] = []
    coupled = {}
    for k, mode in lasting.modes.items():
        n, tangents = contacts.normal(k), contacts.tangents(k)
        rows.append(n)
        if not contacts.has_friction(k):
            continue
        if mode == "stick":
            rows += tangents
        else:
            direction = _direction(contacts.speed[:, tangents], lasting.headings[k])
            coupled[n] = (tangents, -contacts.law[:, k, 1:] * direction)
    force = contact_forces(contacts.delassus, -free[:, rows], rows, coupled)
    motion = contacts.free + np.einsum("tnw,tw->tn", contacts.answer, force)
    rate = free + np.einsum("tvw,tw->tv", contacts.delassus, force)
    return ContactMotion(motion, force if lasting.internal is None else force + lasting.internal, rate)


def _direction(sliding: Array, heading: Array) -> Array:
    """Return the direction of sliding (T, tangent), continued through zero."""
    if sliding.shape[1] == 1:
        return np.broadcast_to(heading, sliding.shape)
    fast = np.linalg.norm(sliding, axis=1, keepdims=True)
    forward = np.where((sliding @ heading)[:, None] < 0, -1.0, 1.0)
    with np.errstate(all="ignore"):
        return np.where(fast > 1e-12, forward * sliding / fast, heading)


def persistent_contacts(contacts: ContactQuantities, near: list[int], slow: float) -> PersistentContacts | None:
    """Return modes and motion of the contacts in `near` that persist at one state; None if no forces exist.

    The contacts `near` have zero gap and zero normal speed; sliding speeds up to `slow`, m/s, count as zero. The laws
    of accelerations and forces equal the laws of speeds and impulses without restitution. However, the direction of
    friction in a sliding contact is known. No forces satisfy the laws if friction wedges a sliding body. If several
    motions satisfy them (Painleve's paradox), the result is the limit of compliant contacts with growing stiffness.
    """
    headings: dict[int, Array] = {}
    for k in near:
        sliding = contacts.sliding(k)[0]
        if contacts.has_friction(k) and (fast := float(np.linalg.norm(sliding))) > slow:
            headings[k] = sliding / fast
    rows, columns, touches = list[int](), list[Array](), list[Touch]()
    unit = np.eye(contacts.speed.shape[1])
    for k in near:
        held = contacts.tangents(k) if contacts.has_friction(k) and k not in headings else []
        mu, tangents = float(contacts.law[0, k, 1]), range(len(rows) + 1, len(rows) + 1 + len(held))
        touches.append(Touch(len(rows), tuple(tangents), mu, bool(contacts.loads[contacts.normal(k)])))
        column = unit[contacts.normal(k)].copy()
        if k in headings:
            column[contacts.tangents(k)] = -mu * headings[k]
        rows += [contacts.normal(k), *held]
        columns += [column, *unit[held]]
    free = contacts.bias[0] + contacts.slope[0] @ contacts.free[0, : contacts.coordinates]
    spread = np.array(columns).reshape(len(rows), len(unit)).T
    problem = Collision(contacts.delassus[0][rows] @ spread, free[rows], tuple(touches), np.zeros(len(near)))
    if (solution := _lasting_solution(problem)) is None:
        return None
    force, several = solution
    after = problem.after(force)
    still = RESTS * float(np.abs(problem.before)[problem.free].max(initial=0.0))
    none = EXACT * problem.units * float(np.abs(force / problem.units)[problem.free].max(initial=0.0))
    modes, unloaded = dict[int, Mode](), dict[int, Mode]()
    for k, touch in zip(near, touches, strict=True):
        friction, along = force[list(touch.tangents)], after[list(touch.tangents)]
        stays = len(friction) > 0 and bool(np.linalg.norm(along) <= still)
        if force[touch.normal] <= none[touch.normal]:
            if after[touch.normal] > still:
                continue
            unloaded[k] = "stick" if stays else "slip"
            friction = -along
        else:
            modes[k] = "stick" if stays else "slip"
        if len(friction) and not stays:
            headings[k] = heading_of(friction)
    lasting = ContactModes(modes, {k: x for k, x in headings.items() if k in modes})
    found = with_internal(contacts, lasting)
    if not (modes and unloaded):
        return PersistentContacts(*found, several)
    # redundant contacts without load in this solution may also be loaded
    both: dict[int, Mode] = {k: (modes | unloaded)[k] for k in near if k in modes or k in unloaded}
    others = with_internal(contacts, ContactModes(both, {k: x for k, x in headings.items() if k in both}))
    moved = np.abs(others[1].rate - found[1].rate).max() > still
    return PersistentContacts(*(found if moved or not pressed(contacts, *others, CLEAR) else others), several)


def _lasting_solution(problem: Collision) -> tuple[Array, bool] | None:
    """Return the first stable forces (direction,) that satisfy the laws, and whether unstable forces also satisfy them.

    Forces are unstable if the stiffness of a compliant contact, coupled by the bodies, does not return the contact to
    them. If all forces are unstable, return the first forces. If none satisfy the laws, return None.
    """
    unstable: Array | None = None
    for force in solutions(problem):
        held = [j for x in problem.touches if force[x.normal] > 0 for j in (x.normal, *x.tangents)]
        units = np.sqrt(problem.units[held])
        restoring = units[:, None] * problem.matrix[np.ix_(held, held)] * units
        if not held or np.linalg.eigvals(restoring).real.min() > -UNSTABLE:
            return force, unstable is not None
        unstable = force if unstable is None else unstable
    return None if unstable is None else (unstable, False)


def pressed(contacts: ContactQuantities, lasting: ContactModes, motion: ContactMotion, part: float = 0.0) -> bool:
    """Return whether all persistent contacts are pressed, with sufficient friction for sticking, at one state.

    Friction may exceed its limit by a `part` of it.
    """
    touches, force = persistent_touches(contacts, lasting), motion.force[0]
    normals = force[[x.normal for x in touches]]
    most = -part * normals * [x.friction for x in touches]
    return bool((normals > PRESSED * contacts.size_of(force)).all() and (reserves(touches, force) >= most).all())


def with_internal(contacts: ContactQuantities, lasting: ContactModes) -> tuple[ContactModes, ContactMotion]:
    """Return the motion at one state with given modes, and internal forces if the laws require them.

    Forces of redundant contacts are not unique: a disc at rest in a corner may be wedged more or less. The least forces
    may be tensile or exceed the friction limit.  In this case, the forces with the largest reserve to the limits of the
    laws are used.
    """
    motion = contact_motion(contacts, lasting)
    touches = persistent_touches(contacts, lasting)
    least = motion.force[0]
    if len(touches) < 2 or not np.isfinite(least).all():
        return lasting, motion
    size = contacts.size_of(least)
    none = [AT_LIMIT * x.friction * least[x.normal] if x.tangents else PRESSED * size for x in touches]
    if (reserves(touches, least) > none).all():
        return lasting, motion
    columns = spread_of(contacts, lasting)
    found = forces_with_largest_reserve(touches, least, motionless_combinations(contacts.delassus[0], columns)) - least
    if not np.abs(found).max() > UNMOVED * size:
        return lasting, motion
    return lasting._replace(internal=found), replace(motion, force=motion.force + found)


def persistent_touches(contacts: ContactQuantities, lasting: ContactModes) -> list[Touch]:
    """Return the persistent contacts at one state, with tangents for sticking contacts."""
    return [
        Touch(contacts.normal(k), tuple(contacts.tangents(k)), float(contacts.law[0, k, 1]))
        if mode == "stick" and contacts.has_friction(k)
        else Touch(contacts.normal(k))
        for k, mode in lasting.modes.items()
    ]


def spread_of(contacts: ContactQuantities, lasting: ContactModes) -> Array:
    """Return a basis of forces (direction, unknown) of persistent contacts at one state, with friction of slip."""
    unit, columns = np.eye(contacts.speed.shape[1]), list[Array]()
    for k, mode in lasting.modes.items():
        column = unit[contacts.normal(k)].copy()
        columns.append(column)
        if not contacts.has_friction(k):
            continue
        tangents = contacts.tangents(k)
        if mode == "stick":
            columns += list(unit[tangents])
        else:
            direction = _direction(contacts.speed[:, tangents], lasting.headings[k])[0]
            column[tangents] = -contacts.law[0, k, 1] * direction
    return np.column_stack(columns)


def heading_of(friction: Array) -> Array:
    """Return the direction in which a contact starts to slide: opposite to its static friction."""
    size = float(np.linalg.norm(friction))
    return np.asarray(-friction / size) if size > 0 else np.eye(len(friction))[0]


class PersistentContacts(NamedTuple):
    """Modes and motion of persistent contacts; `several` states whether an unstable motion also satisfies the laws."""

    lasting: ContactModes
    motion: ContactMotion
    several: bool = False


class StateInContact(NamedTuple):
    """State with persistent contacts: its place among the states, contact quantities, modes and motion."""

    place: int
    contacts: ContactQuantities
    lasting: ContactModes
    motion: ContactMotion


def states_in_contact(
    evaluator: ContactEvaluator, times: Array, states: Array, blocks: Array
) -> Iterator[StateInContact]:
    """Yield the states (T, width) with persistent contacts.

    Persistent contacts have gaps and speeds that count as zero, and compressive forces.
    """
    model = evaluator.model
    bodies = np.array([k for k, (*_, count) in enumerate(model.events) if count], dtype=np.int64)
    if not len(bodies) or not len(states):
        return
    n = evaluator.n
    normals = np.array([evaluator.first[k] for k in bodies])
    size = np.maximum(1e-3, np.abs(states[:, :n]).max(axis=1).clip(max=1.0))
    fast = np.maximum(size, np.abs(states[:, -n:]).max(axis=1))
    with np.errstate(all="ignore"):
        seen = evaluator(times, states, blocks)
        # dry friction under load has a small negative gap
        gaps, loads = seen.guard[:, bodies], seen.loads[normals]
        closed = np.where(loads, gaps, np.abs(gaps)) <= CLOSED * size[:, None]
        closed &= np.abs(seen.speed[:, normals]) <= STILL * fast[:, None]
        for k in np.flatnonzero(closed.any(axis=1)).tolist():
            one = evaluator(times[k : k + 1], states[k : k + 1], blocks[k : k + 1])
            found = persistent_contacts(one, bodies[closed[k]].tolist(), float(STILL * fast[k]))
            if found is not None and found.lasting.modes:
                yield StateInContact(k, one, found.lasting, found.motion)


def onto_contacts(contacts: ContactQuantities, modes: Mapping[int, Mode]) -> tuple[Array, Array]:
    """Return corrections of coordinates and velocities (T, coordinate) that project states onto persistent contacts."""
    n = contacts.coordinates
    answer = contacts.answer[:, :n]
    if not modes:
        return np.zeros(answer.shape[:2]), np.zeros(answer.shape[:2])
    normals = [contacts.normal(k) for k in modes]
    held = [j for k, x in modes.items() for j in [contacts.normal(k), *(contacts.tangents(k) if x == "stick" else [])]]
    q = contact_forces(contacts.delassus, -contacts.guard[:, list(modes)], normals, {})
    v = contact_forces(contacts.delassus, -contacts.speed[:, held], held, {})
    return np.einsum("tnw,tw->tn", answer, q), np.einsum("tnw,tw->tn", answer, v)
