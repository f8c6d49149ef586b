"""Symbols for auxiliary states of components in outputs, requirements and summaries, with units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.components.coordinates import pairs_of
from uqmbd.mechanism.components.local import Local
from uqmbd.mechanism.components.terms import Auxiliary
from uqmbd.mechanism.expressions import as_symbolic, t
from uqmbd.mechanism.geometry import Frame, Space
from uqmbd.names import did_you_mean
from uqmbd.randomness import Symbol, Symbolic

__all__ = ["AuxiliarySymbol", "at_initial_values", "frames_of", "make_auxiliary_state"]


class HasStates(Protocol):
    """Component, with the attributes that auxiliary states need."""

    name: str
    settled: int
    values: dict[str, Any]
    read: set[str]

    @property
    def attached(self) -> Mapping[str, Any]: ...

    def stated(self, p: Local) -> Any: ...


class AuxiliarySymbol(Symbolic, Symbol):
    """Symbol of an auxiliary differential state of a component in output expressions."""

    component: HasStates
    state: str

    def __new__(cls, component: HasStates, state: str, units: str) -> AuxiliarySymbol:
        """Make a symbol for a state of a component, with units."""
        self: AuxiliarySymbol = sympy.Symbol.__xnew__(cls, f"{component.name}.{state}", real=True)
        self.component, self.state, self.units = component, state, units
        return self

    def __init__(self, *args: Any) -> None:
        """Accept the arguments of ``__new__``."""

    def _hashable_content(self) -> tuple[Any, ...]:
        return (*super()._hashable_content(), id(self.component))


def make_auxiliary_state(component: HasStates, name: object, space: Space) -> AuxiliarySymbol:
    """Return the symbol of a state that `Local.state` creates in the terms of an added component."""
    where = f"{type(component).__name__} {component.name!r}: state({name!r:.80})"
    if not component.settled:
        raise StudyError(f"{where}: the component has not been added to a mechanism; call mechanism.add(...) first.")
    local = Local(space, frames_of(component), component.values, t, pairs_of(component))
    read, component.read = component.read, set()
    try:
        component.stated(local)
    finally:
        component.read = read
    if not isinstance(name, str) or name not in local.states:
        near = did_you_mean(name, list(local.states)) if isinstance(name, str) else ""
        listed = ", ".join(map(repr, local.states)) or "none"
        raise StudyError(
            f"{where}: the component has no such auxiliary state{near or '.'} Its auxiliary states are: {listed}."
        )
    return AuxiliarySymbol(component, name, local.units[name])


def at_initial_values(expression: sympy.Expr, space: Space) -> sympy.Expr:
    """Replace auxiliary states by their initial values, as expressions in coordinates and random variables."""
    for symbol in sorted((s for s in expression.free_symbols if isinstance(s, AuxiliarySymbol)), key=str):
        expression = expression.xreplace({symbol: _initial_value(symbol, space)})
    return expression


def _initial_value(symbol: AuxiliarySymbol, space: Space) -> sympy.Expr:
    component = symbol.component
    local = Local(space, frames_of(component), component.values, t, pairs_of(component))
    read, component.read = component.read, set()
    try:
        terms, _ = component.stated(local)
    finally:
        component.read = read
    initial = {term.state: as_symbolic(term.initial) for term in terms if isinstance(term, Auxiliary)}
    found = initial[local.states[symbol.state]]
    named = {key: value for key, (kind, value) in local.quantities.items() if kind == "value"}
    for _ in range(len(named) + 1):
        found = found.xreplace(named)
    left = found.free_symbols & (set(local.quantities) | set(local.states.values()))
    if left:
        raise StudyError(
            f"{type(component).__name__} {component.name!r}: the initial value of {symbol} contains "
            f"{min(left, key=str)}; expected an expression in parameters, positions and velocities."
        )
    return found


def frames_of(component: HasStates) -> dict[str, Frame]:
    """Return the frames of a component's bodies, by argument name, in the symbols of the bodies."""
    return {role: Frame(body.space) if body.is_ground else body.in_terms() for role, body in component.attached.items()}
