"""Conservation of energy by potentials and constraints that do not depend on time."""

from __future__ import annotations

from typing import Any

import numpy as np

from uqmbd.compiled import Kernel, cached
from uqmbd.dynamics import BlockSymbols, Instance, derive
from uqmbd.testing.components.bench import Bench
from uqmbd.typing import Array

__all__ = ["check_energy", "is_timeless"]


STEP = 1e-5
"""Step of central differences along the motion, s."""


def is_timeless(derived: BlockSymbols) -> bool:
    """Return whether potentials and constraints contain neither time nor a state that changes at rest (a clock).

    A drive with a prescribed speed has such a state, or a constraint between velocities that is violated at rest. A
    drive, and components that depend on time, may do work.
    """
    between = [e for e, holonomic in zip(derived.psi, derived.holonomic, strict=True) if not holonomic]
    if any(derived.t in e.free_symbols for e in (derived.potential, *derived.phi, *between, *derived.g)):
        return False
    rng = np.random.default_rng(0)
    at_rest: dict[Any, float] = dict.fromkeys(derived.v, 0)
    for rate in (*derived.g, *between):
        e = rate.subs(at_rest)
        values = {x: rng.uniform(0.1, 0.9) for x in sorted(e.free_symbols, key=str)}
        if abs(float(e.subs(values))) > 1e-12:
            return False
    return True


def check_energy(bench: Bench, rng: np.random.Generator) -> None:
    """Compare the power of the forces of a component with the change of its potential at a random state.

    A step along the motion, with the rates of coordinates and auxiliary states, gives the change of the potential V and
    the constraints phi. The generalised force of a potential must have the power ``-dV/dt``; the power of a reaction,
    ``lambda (dpsi/dv) v``, must vanish with ``dphi/dt``. The derivation guarantees both, unless they contain an
    auxiliary state with a rate that is not linear in the velocities. Components that depend on time (`is_timeless`) are
    not checked. Raise AssertionError with the actual and the expected power.
    """
    derived = derive(bench.instance.type)
    if not derived.s or not is_timeless(derived):
        return  # without auxiliary states no error is possible; components that depend on time may do work
    n, m = len(derived.q), len(derived.phi)
    state, parameters = bench.state(rng), bench.parameters(bench.inputs)
    q, s, v = (state.get(letter, np.zeros((len(parameters), 0))) for letter in "qsv")

    def evaluate(q: Array, s: Array) -> Array:
        return _kernel(bench.instance)(
            np.ascontiguousarray(np.concatenate([q, s, v, np.zeros((len(q), 1)), parameters], axis=1))
        )

    here = evaluate(q, s)
    rates = here[:, 1 + m : 1 + m + len(derived.s)]
    change = (evaluate(q + STEP * v, s + STEP * rates) - evaluate(q - STEP * v, s - STEP * rates)) / (2 * STEP)
    rest = here[:, 1 + m + len(derived.s) :]
    powers = {"a potential": (rest[:, :n] * v).sum(axis=1) + change[:, 0]}
    gradient = rest[:, n:].reshape(len(rest), m, n)
    for k in (k for k in range(m) if derived.holonomic[k]):
        powers[f"constraint {k}"] = change[:, 1 + k] - (gradient[:, k] * v).sum(axis=1)
    for what, power in powers.items():
        worst = abs(power).max()
        assert worst < 1e-5 * (1 + abs(here).max()), (
            f"{bench.title}: energy is not conserved: {what} contributes a power of {worst:.3g} W (of a constraint: "
            "per unit reaction). Make the rate of each auxiliary state linear in the velocities. If the component "
            "is a motor or a damper, pass conservative=False."
        )


def _kernel(instance: Instance) -> Kernel:
    """Compile potential, constraints, rates of states, force of the potential, and gradient of the constraints."""
    derived = derive(instance.type)

    def make() -> Kernel:
        arguments = [x for *_, x in derived.arguments("initial")] + derived.p
        rows = [x for row in derived.d for x in row]
        return derived.kernel(arguments, [derived.potential, *derived.phi, *derived.g, *derived.potential_force, *rows])

    result: Kernel = cached(("energy balance", instance.type.digest), make)
    return result
