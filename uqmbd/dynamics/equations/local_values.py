"""Values of a component's parameters in the local symbols of its block."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import sympy

from uqmbd.dynamics.equations.counted_angles import CountedAngle
from uqmbd.dynamics.equations.expressions import TIME, plain
from uqmbd.errors import StudyError
from uqmbd.mechanism import (
    AngleSymbol,
    AttachedFrame,
    AuxiliarySymbol,
    Body,
    Component,
    CoordinateSet,
    ExcitationSymbol,
    HeldSymbol,
    PathSymbol,
    StateSymbol,
    angles_in,
    as_symbolic,
    flatten,
    t,
)
from uqmbd.randomness import RandomVariable

__all__ = ["bodies_of", "foreign_states", "localise", "symbols_of"]


def symbols_of(letter: str, count: int) -> list[sympy.Symbol]:
    """Return local symbols of a letter."""
    return [sympy.Symbol(f"_{letter}{k}", real=True) for k in range(count)]


def bodies_of(component: Component) -> tuple[list[Body], list[CoordinateSet]]:
    """Return the attached bodies of a component and bodies in its parameters, and coordinates of other components."""
    owners: dict[int, Body | CoordinateSet] = {}
    for body in component.attached.values():
        if isinstance(body, Body):
            owners.setdefault(id(body), body)
        elif isinstance(body, AttachedFrame):
            owners.setdefault(id(body.body), body.body)
    expressions = [x for frame in component.attached.values() if isinstance(frame, AttachedFrame) for x in frame.q]
    for value in (expressions, *component.values.values()):
        for part in flatten(value):
            for symbol in sorted(getattr(part, "free_symbols", ()), key=str):
                moving = sorted(symbol.states, key=str) if isinstance(symbol, AngleSymbol) else [symbol]
                for state in moving:
                    if isinstance(state, StateSymbol):
                        owners.setdefault(id(state.owner), state.owner)
    found = list(owners.values())
    return [x for x in found if isinstance(x, Body)], [x for x in found if isinstance(x, CoordinateSet)]


def foreign_states(component: Component) -> tuple[HeldSymbol | AuxiliarySymbol, ...]:
    """Return the states of controllers and other components in parameters, each once; controller values come first."""
    found: dict[HeldSymbol | AuxiliarySymbol, None] = {}
    for value in component.values.values():
        for part in flatten(value):
            symbols = sorted(getattr(part, "free_symbols", ()), key=str)
            found |= dict.fromkeys(s for s in symbols if isinstance(s, (HeldSymbol, AuxiliarySymbol)))
    return tuple(sorted(found, key=lambda s: isinstance(s, AuxiliarySymbol)))


class LocalValues(NamedTuple):
    """Values of a component in local symbols."""

    values: dict[str, Any]
    frames: dict[str, tuple[sympy.Expr, ...]]
    """Coordinates of attached frames, by the name of the body argument."""
    counted: list[CountedAngle]
    parameters: list[sympy.Expr]
    pattern: tuple[Any, ...]
    """Key that is equal for components of one class with the same terms."""


def localise(
    component: Component, owners: Sequence[Body | CoordinateSet], held: tuple[HeldSymbol | AuxiliarySymbol, ...]
) -> LocalValues:
    """Replace numbers by parameter symbols; keep zeros, ones, options and functions of time or state.

    Coefficients and paths of excitations are parameters, too. The local coordinates are those of `owners`, in order.
    """
    parameters: list[sympy.Expr] = []
    angles = angles_in(component.values.values())
    local: dict[sympy.Basic, sympy.Expr] = {t: TIME, **dict(zip(held, symbols_of("h", len(held)), strict=True))}
    local |= {symbol: sympy.Symbol(f"_a{k}", real=True) for k, symbol in enumerate(angles)}
    for letter, symbols in (("q", [x for one in owners for x in one.q]), ("v", [x for one in owners for x in one.v])):
        local |= {symbol: sympy.Symbol(f"_{letter}{k}", real=True) for k, symbol in enumerate(symbols)}

    def symbol_for(expression: sympy.Expr) -> sympy.Symbol:
        parameters.append(expression)
        return sympy.Symbol(f"_p{len(parameters) - 1}", real=True)

    def place(entry: Any) -> sympy.Expr:
        entry = as_symbolic(entry)
        if entry.is_number:
            number = float(entry)
            return sympy.Integer(int(number)) if number in (0.0, 1.0) else symbol_for(entry)
        foreign = [s for s in entry.free_symbols if not isinstance(s, RandomVariable)]
        if not foreign:
            return symbol_for(entry)
        mapping = dict(local)
        for symbol in sorted(entry.free_symbols, key=str):
            if isinstance(symbol, (RandomVariable, ExcitationSymbol, PathSymbol)):
                mapping[symbol] = symbol_for(symbol)
            elif isinstance(symbol, StateSymbol) and symbol not in mapping:
                if symbol.quantity != "angular_velocity":
                    raise StudyError(
                        f"{type(component).__name__} {component.name!r}: a parameter depends on {symbol}; "
                        "parameters may depend on positions, velocities and time."
                    )
                mapping[symbol] = symbol.owner.expand(symbol).xreplace(local)
        return plain(entry).xreplace(mapping)

    values: dict[str, Any] = {}
    pattern: list[Any] = []
    declared = component.parameters()
    for name, value in component.values.items():
        if value is None or (name in declared and declared[name].kind == "option"):
            values[name] = value
            pattern.append((name, _identity(value)))
            continue
        if isinstance(value, tuple):
            values[name] = sympy.Matrix([place(x) for x in value]) if value else ()
        else:
            values[name] = place(value)
        pattern.append((name, tuple(values[name]) if isinstance(value, tuple) else values[name]))
    counted: list[CountedAngle] = []
    for symbol in angles:
        angle = symbol.angle
        constants = {k: place(x) for k, x in angle.constants.items()}
        cosine, sine, rate = (place(as_symbolic(x).xreplace(constants)) for x in (angle.cosine, angle.sine, angle.rate))
        counted.append(CountedAngle(local[symbol], angle, cosine, sine, rate, place(angle.near)))
        pattern.append(counted[-1].pattern)
    frames = {
        role: tuple(place(x) for x in frame.q)
        for role, frame in component.attached.items()
        if isinstance(frame, AttachedFrame)
    }
    pattern += frames.items()
    return LocalValues(values, frames, counted, parameters, tuple(pattern))


def _identity(option: Any) -> Any:
    """Return the identity of an option: only equal options share the terms of a component.

    The identity contains the type, because 1 equals True. Objects other than plain data compare by their memory
    address, because different objects may have the same text.
    """
    if isinstance(option, (list, tuple)):
        return type(option), *map(_identity, option)
    if isinstance(option, Mapping):
        return type(option), *((_identity(key), _identity(value)) for key, value in option.items())
    if isinstance(option, (str, bytes, bool, int, float, complex, type, sympy.Basic)) or option is None:
        return type(option), repr(option) if isinstance(option, float) else option
    return type(option), id(option)
