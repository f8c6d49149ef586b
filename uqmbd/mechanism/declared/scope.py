"""Allowed symbols of expressions: random variables in all, time and states in laws, reactions in outputs."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from typing import Any, Literal, Protocol

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.bodies import Body, Ground
from uqmbd.mechanism.components import (
    AngleSymbol,
    AuxiliarySymbol,
    Component,
    CoordinateSet,
    ReactingComponent,
    ReactionSymbol,
    StateSymbol,
    unseen_in,
)
from uqmbd.mechanism.controller import Controller, HeldSymbol
from uqmbd.mechanism.declared.output import Output
from uqmbd.mechanism.expressions import (
    ExcitationSymbol,
    PathSymbol,
    ScalarSymbol,
    flatten,
    is_scalar,
    t,
    unknown_symbol,
)
from uqmbd.mechanism.geometry import Space
from uqmbd.randomness import RandomVariable
from uqmbd.units import Dimension

__all__ = [
    "Described",
    "Scope",
    "require_free",
    "require_known",
    "require_measured",
    "unseen_numbers",
]

Scope = Literal["number", "law", "start", "output"]
"""A number may contain random variables; a law also time, positions, angles and velocities; an output all symbols.

A start condition may contain the same symbols as a law, but has a separate error message."""


class Described(Protocol):
    """Mechanism, with the attributes that this package uses."""

    name: str
    bodies: dict[str, Body]
    components: dict[str, Component]
    ground: Ground
    space: Space
    controllers: dict[str, Controller]
    outputs: dict[str, Output]
    scalars: dict[str, Output]
    effective: dict[Hashable, frozenset[str]]

    @property
    def requirements(self) -> Mapping[str, object]:
        """Requirements by name."""


LAW_QUANTITIES = ("q", "v", "angular_velocity")


def require_known(mechanism: Described, where: str, value: Any, scope: Scope) -> None:
    """Raise `uqmbd.StudyError`, which names the symbol, if a value contains a symbol outside its allowed scope.

    The value is an expression or a vector of expressions; other values contain no symbols.
    """
    for part in flatten(value) if scope in ("number", "law") else ():
        if is_scalar(part):
            raise StudyError(
                f"{where}: the expression contains {part}, which is computed from the mechanism and is only "
                "permitted in outputs."
            )
    symbols = {s for part in flatten(value) if isinstance(part, sympy.Basic) for s in part.free_symbols}
    for symbol in sorted(symbols, key=str):
        if isinstance(symbol, (RandomVariable, ScalarSymbol)):
            continue
        if isinstance(symbol, (ExcitationSymbol, PathSymbol)):
            _require_scope(where, symbol, scope)
            continue
        if isinstance(symbol, StateSymbol):
            owner = symbol.owner.component if isinstance(symbol.owner, CoordinateSet) else symbol.owner
            members = mechanism.bodies if isinstance(owner, Body) else mechanism.components
            _require_member(members, owner, mechanism, f"{where}: the expression contains {symbol}")
        elif isinstance(symbol, AngleSymbol):
            members = mechanism.bodies if isinstance(symbol.owner, Body) else mechanism.components
            _require_member(members, symbol.owner, mechanism, f"{where}: the expression contains {symbol}")
        elif isinstance(symbol, (ReactionSymbol, AuxiliarySymbol)):
            _require_member(
                mechanism.components, symbol.component, mechanism, f"{where}: the expression contains {symbol}"
            )
        elif isinstance(symbol, HeldSymbol):
            # the controller may be added later
            known = mechanism.controllers.get(symbol.owner.name)
            if known is not None and known is not symbol.owner:
                raise StudyError(
                    f"{where}: the expression contains {symbol} of a controller {symbol.owner.name!r} that is not the "
                    f"controller of this name in mechanism {mechanism.name!r}; use the controller that was added."
                )
            if scope == "start":
                raise StudyError(
                    f"{where}: the expression contains {symbol}, but commands of a controller are not defined before "
                    "the start; use a position or velocity of a body."
                )
        elif symbol != t:
            raise StudyError(f"{where}: the expression contains {unknown_symbol(symbol)}")
        _require_scope(where, symbol, scope)


def unseen_numbers(mechanism: Described) -> Callable[[], set[Dimension]]:
    """Return the function `unseen` of `check_dimensions` for all bodies and components of a mechanism."""
    return unseen_in([*(body.terms for body in mechanism.bodies.values()), *mechanism.components.values()])


def require_free(mechanism: Described, name: str, where: str) -> None:
    """Raise if a body or component already has this name."""
    if name == "ground":
        raise StudyError(f"{where}: the name 'ground' is reserved; choose another name.")
    taken = mechanism.bodies.get(name) or mechanism.components.get(name) or mechanism.controllers.get(name)
    if taken is not None:
        kind = "body" if isinstance(taken, Body) else type(taken).__name__
        raise StudyError(
            f"{where}: the {kind} {name!r} has the same name; choose another name, because names of bodies and "
            "components must be unique."
        )


def require_measured(mechanism: Described, controller: Controller) -> None:
    """Raise if a controller measures an invalid expression."""
    for k, entry in enumerate(controller.measured):
        if not isinstance(entry, str):
            require_known(mechanism, f"{controller.where}: measured[{k}]", entry, "output")


def _require_scope(where: str, symbol: sympy.Symbol, scope: Scope) -> None:
    if scope == "number":
        raise StudyError(
            f"{where}: the expression contains {symbol}, which changes during the motion; expected only numbers and "
            "random variables."
        )
    late = isinstance(symbol, ReactionSymbol) or (
        isinstance(symbol, StateSymbol) and symbol.quantity not in LAW_QUANTITIES
    )
    if scope == "law" and late:
        raise StudyError(
            f"{where}: the expression depends on {symbol}; parameters may depend on random variables, positions, "
            "angles, velocities, angular velocities, auxiliary states, and time."
        )


def _require_member(
    members: Mapping[str, Any], owner: Body | ReactingComponent, mechanism: Described, what: str
) -> None:
    if members.get(owner.name) is owner:
        return
    # a component that was never added has no mechanism
    added = isinstance(owner, Body) or bool(getattr(owner, "settled", 0))
    kind = "body" if isinstance(owner, Body) else type(owner).__name__
    if owner.name in members and added:
        raise StudyError(
            f"{what}, but this {kind} {owner.name!r} belongs to another mechanism than {mechanism.name!r}, which has "
            "a different object with the same name."
        )
    if not isinstance(owner, Body):
        raise StudyError(
            f"{what}, but {owner.name!r} was not added to mechanism {mechanism.name!r}; call mechanism.add(...) first."
        )
    raise StudyError(f"{what}, but body {owner.name!r} is not in mechanism {mechanism.name!r}.")
