"""Where the energy goes: potentials and constraints that do not depend on time neither make nor lose any."""

from __future__ import annotations

from typing import Any

import numpy as np

from uqmbd.compiled import Kernel, cached
from uqmbd.dynamics import BlockSymbols, Instance, derive
from uqmbd.testing.components.bench import Bench
from uqmbd.typing import Array

__all__ = ["check_energy", "is_timeless"]


STEP = 1e-5
"""Of central differences along the motion, s."""


def is_timeless(derived: BlockSymbols) -> bool:
    """Return whether time is in no potential and no constraint, nor a state that changes at rest, which is a clock.

    A drive of given speed has such a state, or a constraint between velocities that does not hold at rest; it may do
    work, as may what depends on time.
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
    """Compare the power of a component's forces with the change of its potential at a random state.

    A step along the motion, with the rates of coordinates and auxiliary states, gives the change of the potential V and
    the constraints phi. The generalised force of a potential must have the power ``-dV/dt``; the power of a reaction,
    ``lambda (dpsi/dv) v``, must vanish with ``dphi/dt``. Both hold by derivation, unless an auxiliary state in them has
    a rate that is not linear in the velocities. Components that depend on time (`is_timeless`) are not checked. Raise
    AssertionError with the actual and the expected power.
    """
    derived = derive(bench.instance.type)
    if not derived.s or not is_timeless(derived):
        return  # without auxiliary states there is nothing that could go wrong; what depends on time may do work
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
            f"{bench.title}: energy is not conserved: {what} feeds in a power of {worst:.3g} (of a reaction of one, if "
            "a constraint). Is the rate of each auxiliary state linear in the velocities? If the component is a motor "
            "or a damper by intention, say so: conservative=False."
        )


def _kernel(instance: Instance) -> Kernel:
    """Potential, constraints, rates of states, force of the potential, gradient of the constraints."""
    derived = derive(instance.type)

    def make() -> Kernel:
        arguments = [x for *_, x in derived.arguments("initial")] + derived.p
        rows = [x for row in derived.d for x in row]
        return derived.kernel(arguments, [derived.potential, *derived.phi, *derived.g, *derived.potential_force, *rows])

    result: Kernel = cached(("energy balance", instance.type.digest), make)
    return result
