"""Forces of persistent contacts that the laws of motion, contact and friction do not determine.

The motion of a table on four legs is unique, but the forces on the legs are not: forces without a resultant may be
added while all contacts are pressed and friction suffices. The forces are determined if the laws allow only one set of
forces, as for a wedge at the limit of friction.
"""

from __future__ import annotations

import numpy as np

from uqmbd.dynamics.contact.evaluator import ContactQuantities
from uqmbd.dynamics.contact.persistent import ContactModes, ContactMotion, persistent_touches, spread_of
from uqmbd.dynamics.contact.redundant import forces_with_largest_reserve, motionless_combinations, reserves
from uqmbd.typing import Array

__all__ = ["undetermined_forces"]


ROOM = 1e-6
"""Least reserve to the laws, relative to the largest force, for which the forces have a range of values."""
MOVED = 1e-9
"""Part of a combination of forces, relative to its largest force, that counts as zero."""


def undetermined_forces(contacts: ContactQuantities, lasting: ContactModes, motion: ContactMotion) -> Array:
    """Return N combinations of forces (direction, N), in newtons, that may be added to the forces of one state.

    The largest force of each combination equals the largest force of the state. N is zero if the forces are determined.
    """
    force = motion.force[0]
    # without any load, the limits of dry friction are the scale of its forces
    largest = contacts.size_of(force) or float(np.abs(force).max(initial=0.0))
    none = np.zeros((len(force), 0))
    if not (largest > 0 and np.isfinite(force).all() and np.isfinite(contacts.delassus[0]).all()):
        return none
    ways = motionless_combinations(contacts.delassus[0], spread_of(contacts, lasting))
    if not ways.shape[1]:
        return none
    ways = ways * (largest / np.abs(ways).max(axis=0))
    ways[np.abs(ways) <= MOVED * largest] = 0.0
    touches = persistent_touches(contacts, lasting)
    moved = [bool(ways[[x.normal, *x.tangents]].any()) for x in touches]
    room = reserves(touches, forces_with_largest_reserve(touches, force, ways))[moved].min(initial=np.inf)
    return ways if room > ROOM * largest else none
