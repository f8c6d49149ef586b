"""Inputs and commands that change outputs of a motion directly, at the time at which a program sets them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.portable.commands import MotionCommand, measured_expressions
from uqmbd.mechanism import (
    AngleSymbol,
    AuxiliarySymbol,
    HeldSymbol,
    Mechanism,
    StateSymbol,
    as_symbolic,
    random_variables,
    t,
)
from uqmbd.randomness import RandomVariable
from uqmbd.typing import Array

__all__ = ["Dependencies", "dependencies_of", "nearby_values", "without_effect"]

Dependencies = tuple[tuple[str, ...], ...]
"""Names of inputs and commands for each output, then for each measured expression."""


def dependencies_of(
    mechanism: Mechanism,
    ensemble: Ensemble,
    held: Sequence[str],
    commands: Sequence[MotionCommand],
    moving: Sequence[int],
) -> tuple[Dependencies, Dependencies]:
    """Return the inputs and commands that change each output directly: during the motion, and at its start.

    Inputs that move constraints change all outputs, because the state is projected onto the moved constraints.
    """
    model = ensemble.model
    everything = frozenset((*held, *(x.name for x in commands)))
    moved = {model.inputs[k] for k in moving}
    during = [everything & (_names(x, everything) | moved) for x in _expressions(mechanism, model)]
    first = moved | _starting(ensemble, held)
    if any(loop.law is not None for loop in model.controls):
        first |= everything  # the first sample of a law is taken at the start
    return _sorted(during), _sorted([x | first for x in during])


def without_effect(mechanism: Mechanism, ensemble: Ensemble) -> list[str]:
    """Return the inputs that change no equation, output or law: they change the start only, or nothing."""
    model = ensemble.model
    if any(loop.law is not None for loop in model.controls):
        return []
    seen = {variable.name for variable in random_variables(tuple(_expressions(mechanism, model)))}
    parameters = model.parameters(nearby_values(ensemble, model.inputs))[:, : model.block_parameters]
    same = np.all(parameters[1:] == parameters[0], axis=1).tolist()
    return [name for name, one in zip(model.inputs, same, strict=True) if one and name not in seen]


def _expressions(mechanism: Mechanism, model: Model) -> list[Any]:
    """Return the expressions of outputs, then those that controllers measure; None: unknown."""
    by_name: dict[str, Any] = {output.name: output.expression for output in mechanism.observed()}
    found = [by_name.get(name) for name in model.outputs.names]
    for _, which, number in measured_expressions(model):
        found.append(mechanism.controllers[model.controls[which].name].measured[number])
    return found


def _sorted(found: Sequence[frozenset[str]]) -> Dependencies:
    return tuple(tuple(sorted(names)) for names in found)


def _names(expression: Any, everything: frozenset[str]) -> frozenset[str]:
    """Return the inputs and commands in an expression; all of them if it contains accelerations or reactions."""
    found = set[str]()
    pending = list(as_symbolic(expression).free_symbols) if expression is not None else [None]
    while pending:
        symbol = pending.pop()
        if isinstance(symbol, RandomVariable):
            found.add(symbol.name)
        elif isinstance(symbol, HeldSymbol):
            names = [*symbol.owner.commands, *symbol.owner.states]
            found.add(f"{symbol.owner.name}.{names[symbol.index]}")
        elif isinstance(symbol, AngleSymbol):
            whole = symbol.angle.whole
            pending += [s for x in (symbol.angle.cosine, symbol.angle.sine) for s in whole(x).free_symbols]
        elif isinstance(symbol, StateSymbol) and symbol.quantity in ("q", "v"):
            continue
        elif isinstance(symbol, StateSymbol) and symbol.quantity == "angular_velocity":
            pending += symbol.owner.expand(symbol).free_symbols
        elif symbol != t and not isinstance(symbol, AuxiliarySymbol):
            return everything
    return frozenset(found)


def _starting(ensemble: Ensemble, held: Sequence[str]) -> frozenset[str]:
    """Return the inputs that change the start of the motion; all of them if contacts may be closed there."""
    model = ensemble.model
    if not held or any(directions for *_, directions in model.events):
        return frozenset(held)
    start = Ensemble(model, nearby_values(ensemble, held)).start
    states = np.concatenate([start.q, start.s, start.v], axis=1)
    same = start.ok & np.all(states == states[0], axis=1)
    return frozenset(name for name, one in zip(held, same[1:].tolist(), strict=True) if not one)


def nearby_values(ensemble: Ensemble, held: Sequence[str]) -> Array:
    """Return values near the means, then the same values with one changed input a row (1 + held, input).

    Coefficients of an input that vanish at the means do not vanish there.
    """
    columns = [ensemble.model.inputs.index(name) for name in held]
    values = np.repeat(ensemble.values[:1], len(held) + 1, axis=0)
    for k, column in enumerate(columns):
        size = max(1e-3, 1e-3 * abs(float(values[0, column])))
        values[:, column] += 0.37 * (k + 1) * size
        values[k + 1, column] += size
    return values
