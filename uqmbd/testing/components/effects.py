"""Effects of parameters and auxiliary states on computed quantities."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uqmbd.mechanism import Component, coordinates_of, effective_parameters, random_variables
from uqmbd.testing.components.bench import Bench
from uqmbd.typing import Array

__all__ = ["check_effects"]

STATES = 10
"""Number of random states for the search for an effect of a parameter."""

STEPS = 0.01, 10.0
"""Changes of an auxiliary state for the search for an effect; a counter of turns only has an effect in large steps."""


def check_effects(bench: Bench, rng: np.random.Generator, given: set[str]) -> None:
    """Require an effect of each random parameter and of each auxiliary state that no output records."""
    component, space, names = bench.case.component, bench.case.mechanism.space, bench.case.mechanism.inputs.names
    own = coordinates_of(component)
    values = () if own is None else (x for one in own.declared.values() for x in (one.initial, one.rate))
    stated = {variable.name for value in values for variable in random_variables(value)}
    idle, still = set(names) - stated, set(range(len(bench.instance.type.states)))
    if not space.turns:  # points, axes and radii of bodies that cannot rotate may have no effect
        declared = component.parameters()
        effective = effective_parameters(component, space)
        idle = {k for k in idle & effective if declared[k].kind in ("scalar", "vector") and not declared[k].about}
    for _ in range(STATES):  # some parameters, such as those of a contact, only have an effect in some states
        state = bench.state(rng)
        idle &= _without_effect(bench, state, names)
        still = {k for k in still if not _state_acts(bench, state, k)}
    assert not idle, (
        f"{bench.title}: parameter {min(idle)!r} has no effect; use it in terms(), or delete its declaration."
    )
    if space.turns:
        missing = _numeric(component, given) - set(names)
        assert not missing, f"{bench.title}: parameter {min(missing)!r} is declared, but no term contains its value."
    for k in still:
        name = bench.instance.type.states[k]
        assert component.state(name).units, (
            f"{bench.title}: no force, constraint, event or other state depends on the auxiliary state {name!r}. Use "
            f"it or delete it. If outputs record it, declare its units with p.state({name!r}, units)."
        )


def _without_effect(bench: Bench, state: dict[str, Array], names: Sequence[str]) -> set[str]:
    """Return the names of inputs without effect in a state."""

    def everything(inputs: Array) -> Array:
        kinds = ("residual", "position", "initial", "contact")
        return np.concatenate([bench.evaluate(kind, state, bench.parameters(inputs)) for kind in kinds], axis=1)

    before, found = everything(bench.inputs), set[str]()
    for column, name in enumerate(names):
        changed = bench.inputs.copy()
        changed[:, column] += 0.01
        if np.allclose(everything(changed), before, rtol=1e-9, atol=0):
            found.add(name)
    return found


def _state_acts(bench: Bench, state: dict[str, Array], index: int) -> bool:
    """Return whether a quantity other than the rate of an auxiliary state depends on this state."""
    parameters = bench.parameters(bench.inputs)
    for step in STEPS:
        moved = {**state, "s": state["s"].copy()}
        moved["s"][:, index] += step
        for kind in ("residual", "contact"):
            others = np.array([target != ("s", index) for target in bench.kernel(kind)[1]], dtype=bool)
            before, after = (bench.evaluate(kind, x, parameters)[:, others] for x in (state, moved))
            if not np.allclose(after, before, rtol=1e-9, atol=0, equal_nan=True):
                return True
    return False


def _numeric(component: Component, given: set[str]) -> set[str]:
    """Return the parameters with random values."""
    return {
        key
        for key, parameter in component.parameters().items()
        if parameter.kind != "option" and parameter.example is None and key not in given and key in component.given
    }
