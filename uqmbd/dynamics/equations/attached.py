"""Components that connect bodies, and components that exert forces on a body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate, combinations

from uqmbd.dynamics.equations.block import Instance
from uqmbd.mechanism import Mechanism, carrier_name

__all__ = ["acting", "first_coordinates", "links"]


def links(instances: Sequence[Instance], order: Mapping[str, int]) -> tuple[tuple[int, int], ...]:
    """Return pairs of bodies that components connect, by number; -1 is the ground."""
    found: set[tuple[int, int]] = set()
    for instance in instances:
        numbers = sorted({order.get(carrier_name(body), -1) for body in instance.component.attached.values()})
        found |= set(combinations(numbers, 2))
    return tuple(sorted(found))


def acting(instances: Sequence[Instance], order: Mapping[str, int]) -> tuple[tuple[str, ...], ...]:
    """Return names of the components with a potential or virtual work on each body, in the order of the bodies."""
    found: list[list[str]] = [[] for _ in order]
    for instance in instances:
        if not instance.type.owns and (instance.type.work or instance.type.potential != 0):
            for body in instance.bodies:
                found[order[body.name]].append(instance.component.name)
    return tuple(tuple(names) for names in found)


def first_coordinates(mechanism: Mechanism) -> dict[str, int]:
    """Return the index of the first coordinate of each body and of each component with coordinates, by name."""
    owners = mechanism.coordinate_owners()
    starts = accumulate((len(x.q) for x in owners), initial=0)
    return {owner.name: first for owner, first in zip(owners, starts, strict=False)}
