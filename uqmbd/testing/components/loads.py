"""Forces and constraints of a component at one state, and random states that satisfy the constraints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.compiled import Kernel, cached
from uqmbd.dynamics import Instance, derive
from uqmbd.testing.components.bench import Bench, norm_rows, random_coordinates
from uqmbd.typing import Array

__all__ = ["Loads", "feasible_state", "loads_at"]


@dataclass(frozen=True)
class Loads:
    """Forces and constraints of a component at one state."""

    force: Array  # (n,) generalised force of potentials and virtual work on the coordinates of its bodies
    gradient: Array  # (m, n) ``d psi / d v`` of its constraints: reactions are combinations of its rows
    violation: Array  # (m,) constraints of positions; zero for constraints only between velocities
    rate: Array  # (m,) rates of the constraints of positions, and constraints between velocities


def _kernel(instance: Instance) -> Kernel:
    derived = derive(instance.type)

    def make() -> Kernel:
        arguments = [x for *_, x in derived.arguments("initial")] + derived.p
        force = [a + b for a, b in zip(derived.potential_force, derived.work_force, strict=True)]
        rows = [x for row in derived.d for x in row]
        return derived.kernel(arguments, [*force, *rows, *derived.phi, *derived.psi])

    result: Kernel = cached(("loads and rates", instance.type.digest), make)
    return result


def loads_at(instance: Instance, q: Array, s: Array, v: Array, time: float, parameters: Array) -> Loads:
    """Return the loads at coordinates (n,), states (s,), velocities (n,), a time in s and parameters (parameter,)."""
    n, m = instance.type.coordinates, len(instance.type.constraints)
    found = _kernel(instance)(np.concatenate([q, s, v, [time], parameters])[None, :])[0]
    gradient, violation, rate = np.split(found[n:], [m * n, m * n + m])
    return Loads(found[:n], gradient.reshape(m, n), violation, rate)


def feasible_state(bench: Bench, parameters: Array, rng: np.random.Generator) -> tuple[Array, Array, Array, float]:
    """Return a random state of the bodies that satisfies the constraints (Gauss-Newton, several starts)."""
    instance, space, n = bench.instance, bench.case.mechanism.space, bench.instance.type.coordinates
    for _ in range(50):
        q = random_coordinates(instance, rng, 1)[0]
        s, v, time = rng.normal(size=len(instance.type.states)), rng.normal(size=n), rng.uniform(0.1, 1.0)
        for _ in range(50):
            found = loads_at(instance, q, s, v, time, parameters)
            if abs(found.violation).max(initial=0) < 1e-12 and _normalised(instance, q):
                return q, s, v, time
            rows, violation = [found.gradient], [found.violation]
            if space.turns:
                norms = norm_rows(instance, q)
                rows.append(2 * norms)
                violation.append(norms @ q - 1)
            q = q - np.linalg.lstsq(np.concatenate(rows), np.concatenate(violation), rcond=1e-10)[0]
    raise AssertionError(f"{bench.title}: the check found no state that satisfies its constraints.")


def _normalised(instance: Instance, q: Array) -> bool:
    """Return whether all quaternions have length one."""
    return bool(abs(norm_rows(instance, q) @ q - 1).max(initial=0.0) < 1e-12)
