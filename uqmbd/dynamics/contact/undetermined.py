"""Forces of persistent contacts that the laws of motion, contact and friction do not determine.

The motion of a table on four legs is unique, but the forces on the legs are not: forces without a resultant may be
added while all contacts are pressed and friction suffices. The forces are determined if the laws allow only one set of
forces, as for a wedge at the limit of friction. Contacts that share no such forces are examined separately: a wedge at
its limit does not determine the forces on the legs of a table next to it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph

from uqmbd.dynamics.contact.evaluator import ContactQuantities
from uqmbd.dynamics.contact.persistent import ContactModes, ContactMotion, persistent_touches, spread_of
from uqmbd.dynamics.contact.redundant import forces_with_largest_reserve, motionless_combinations, reserves
from uqmbd.typing import Array

__all__ = ["undetermined_forces"]


ROOM = 1e-6
"""Least reserve of forces to the limits of contact laws, relative to the largest force, for a range of forces."""
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
    touches, free = persistent_touches(contacts, lasting), [none]
    for part in _independent(ways, contacts.first):
        scaled = part * (largest / np.abs(part).max(axis=0))
        scaled[np.abs(scaled) <= MOVED * largest] = 0.0
        moved = [bool(scaled[[x.normal, *x.tangents]].any()) for x in touches]
        room = reserves(touches, forces_with_largest_reserve(touches, force, scaled))[moved].min(initial=np.inf)
        if room > ROOM * largest:
            free.append(scaled)
    return np.column_stack(free)


def _independent(ways: Array, first: Sequence[int]) -> Iterator[Array]:
    """Yield bases (direction, N) of combinations of forces that share no contact; events have directions `first`."""
    basis = np.linalg.qr(ways / np.abs(ways).max(axis=0))[0]
    projector = basis @ basis.T
    owner = np.repeat(np.arange(len(first) - 1), np.diff(first))
    rows, columns = np.nonzero(np.abs(projector) > MOVED)
    links = scipy.sparse.coo_array((np.ones(len(rows)), (owner[rows], owner[columns])), shape=(len(first) - 1,) * 2)
    count, labels = scipy.sparse.csgraph.connected_components(links, directed=False)
    for label in range(count):
        left, sizes, _ = np.linalg.svd(projector[:, labels[owner] == label], full_matrices=False)
        if (whole := sizes > 0.5).any():  # a singular value of a projector is zero or one
            yield left[:, whole]
