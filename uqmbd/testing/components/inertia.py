"""Kinetic energy of components: positive for all motions, and independent of the pose of the whole mechanism."""

from __future__ import annotations

import numpy as np

from uqmbd.compiled import Kernel, cached
from uqmbd.dynamics import Instance, derive
from uqmbd.testing.components.bench import Bench, own_coordinates
from uqmbd.testing.components.motion import displaced, random_turn
from uqmbd.typing import Array

__all__ = ["check_inertia"]

SMALLEST = 1e-9
"""Smallest eigenvalue of the matrix of inertia that counts as positive, relative to the largest."""


def check_inertia(bench: Bench, rng: np.random.Generator) -> None:
    """Check the kinetic energy of a component at random states.

    Each coordinate of the component must have inertia. A rigid displacement of the bodies must not change the energy of
    a component that acts only between bodies. No motion may have a negative kinetic energy. If the component has
    coordinates, only their motions are examined, because other terms may belong to the energy of a body. Raise
    AssertionError otherwise.
    """
    block, space = bench.instance.type, bench.case.mechanism.space
    own, moving = own_coordinates(bench.instance), block.own
    if block.kinetic == 0 and not moving:
        return
    state, parameters = bench.state(rng), bench.parameters(bench.inputs)
    s = state.get("s", np.zeros((len(parameters), 0)))
    turn, shift = random_turn(space, rng), rng.uniform(-1, 1, space.dimension)
    names = [x.name for one in bench.instance.sets[-1:] for x in one.q][:moving]
    for q, rest, v, row in zip(state["q"], s, state["v"], parameters, strict=True):
        energy, mass = _energy(bench.instance, q, rest, v, row)
        values, _ = np.linalg.eigh(mass[len(mass) - moving :, len(mass) - moving :] if moving else mass)
        most = max(float(np.abs(values).max(initial=0.0)), 1e-300)
        assert values.min(initial=0.0) > -SMALLEST * most, (
            f"{bench.title}: a motion of its coordinates has a negative kinetic energy: the smallest eigenvalue of its "
            f"matrix of inertia is {values.min():.3g}, the largest {values.max():.3g}. Check the signs of its Kinetic "
            "terms."
        )
        block_of_own = np.diag(mass)[len(mass) - moving :]
        idle = [name for name, x in zip(names, block_of_own, strict=True) if x <= SMALLEST * SMALLEST * most]
        assert not idle, (
            f"{bench.title}: its coordinate {idle[0]!r} has no kinetic energy; yield a uqmbd.Kinetic that contains its "
            "rate, or declare a state without inertia by p.state(name, units)."
        )
        if bench.case.free and bench.instance.bodies:
            moved = displaced(space, turn, q, shift, own), rest, displaced(space, turn, v, own=own)
            change = _energy(bench.instance, *moved, row)[0] - energy
            assert abs(change) < 1e-9 * (1 + abs(energy)), (
                f"{bench.title}: its kinetic energy changes by {change:.2g} J when the whole mechanism is translated "
                "and rotated; expected no change."
            )


def _energy(instance: Instance, q: Array, s: Array, v: Array, parameters: Array) -> tuple[float, Array]:
    """Return the kinetic energy, and the matrix of inertia (coordinate, coordinate)."""
    n = len(q)
    found = _kernel(instance)(np.concatenate([q, s, v, [0.0], parameters])[None, :])[0]
    return float(found[0]), found[1:].reshape(n, n)


def _kernel(instance: Instance) -> Kernel:
    derived = derive(instance.type)

    def make() -> Kernel:
        arguments = [x for *_, x in derived.arguments("initial")] + derived.p
        return derived.kernel(arguments, [derived.kinetic, *(x for row in derived.mass for x in row)])

    result: Kernel = cached(("kinetic energy and inertia", instance.type.digest), make)
    return result
