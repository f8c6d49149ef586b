"""Axes of vectors and moments: forces of a component rotate with the body or with the world, as declared."""

from __future__ import annotations

from typing import Any

import numpy as np

from uqmbd.dynamics import ParameterMap, instances_of
from uqmbd.mechanism import Space, flatten
from uqmbd.testing.components.bench import Bench, own_coordinates
from uqmbd.testing.components.loads import feasible_state, loads_at
from uqmbd.testing.components.motion import displaced, random_turn
from uqmbd.typing import Array

__all__ = ["check_axes"]


def check_axes(bench: Bench, rng: np.random.Generator) -> None:
    """Rotate bodies and vectors in world axes together; raise AssertionError if forces do not rotate with them.

    The virtual power of the forces is equal in both frames. Components without vectors and moments are not checked.
    """
    component, space = bench.case.component, bench.case.mechanism.space
    declared = {k: p for k, p in component.parameters().items() if p.kind in ("vector", "moment")}
    if not space.turns or not any(component.values.get(key) is not None for key in declared):
        return
    turn = random_turn(space, rng)
    rotation = np.array(space.rotation(list(turn)).tolist(), dtype=float)
    given = {**component.attached, **{k: component.values[k] for k in component.parameters()}}
    for key, parameter in declared.items():
        value = flatten(given[key]) if given[key] is not None else []
        if parameter.axes == "world" and len(value) == len(rotation):
            given[key] = tuple(sum(a * x for a, x in zip(row, value, strict=True)) for row in rotation.tolist())
    turned: Any = type(component)("turned", **{k: x for k, x in given.items() if x is not None})
    there = instances_of([bench.case.mechanism.add(turned)], space)[0]
    count = own_coordinates(bench.instance)
    others = ParameterMap.of(there.parameters, bench.case.mechanism.inputs.variables)(bench.inputs)
    for own, other in zip(bench.parameters(bench.inputs), others, strict=True):
        q, s, v, time = feasible_state(bench, own, rng)
        here = loads_at(bench.instance, q, s, v, time, own).force
        q, v, here = (displaced(space, turn, x, own=count) for x in (q, v, here))
        error = _size(loads_at(there, q, s, v, time, other).force - here)
        assert error < 1e-8 * (1 + _size(here)), (
            f"{bench.title}: its forces change by {error:.2g} when its bodies and its vectors in world "
            f"axes rotate together ({_listed(declared, space)}). Check p.BODY.direction(...): it may "
            "be missing or superfluous. A vector of uqmbd.Parameter(kind='vector') has components in "
            "world axes; with axes='body', in the axes of its body."
        )


def _size(x: Array) -> float:
    return float(np.abs(x).max(initial=0))


def _listed(declared: dict[str, Any], space: Space) -> str:
    """Name the vectors and moments with their axes."""
    return ", ".join(f"{key} in {p.axes} axes" for key, p in declared.items() if p.size(space))
