"""Do the units of a component's parameters fit its terms: energies in J, work in W, sums of one dimension."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import sympy

from uqmbd.mechanism import (
    Auxiliary,
    Body,
    Component,
    Constraint,
    Frame,
    Kinetic,
    Local,
    Potential,
    Space,
    VirtualWork,
    as_symbolic,
)
from uqmbd.mechanism.expressions import flatten, mismatches, t, units_of
from uqmbd.units import read_units

__all__ = ["check_units"]


class _Stated(sympy.Dummy):
    """Symbol of a number whose units are stated."""

    units: str = ""

    def _sympystr(self, printer: Any) -> str:
        return str(self.name)


def check_units(title: str, component: Component, space: Space) -> None:
    """Check the units of terms of a component in a mechanism with this space.

    Raise AssertionError if a dimension is wrong. The test omits terms in which no parameter has other units than m (a
    stiffness of one is not written). It omits powers whose exponent is a parameter (the units of their factor depend on
    it), and components with a law of the user. A state without stated units is in the units of its rate, times seconds.
    """
    declared = component.parameters()
    options = [component.values.get(key) for key, parameter in declared.items() if parameter.kind == "option"]
    if not all(option is None or isinstance(option, (str, bool, int, float)) for option in options):
        return
    values = {key: _symbols(key, x, declared.get(key)) for key, x in component.values.items()}
    frames = {
        role: Frame(space, body.q, body.v) if isinstance(body, Body) else Frame(space)
        for role, body in component.attached.items()
    }
    local = Local(space, frames, values, t)
    terms, _ = component.stated(local)
    states = {symbol: _stated(name, local.units[name]) for name, symbol in local.states.items()}
    named = _named(title, local, states)
    for term in terms:  # a state without stated units has those of its rate times seconds
        if isinstance(term, Auxiliary) and not states[term.state].units:
            units = units_of(as_symbolic(term.rate).xreplace(named) * _SECOND)
            states[term.state] = _stated(states[term.state].name, units)
    named = _named(title, local, states)
    for term in terms:
        for what, expression, units in _claims(term, states):
            inserted = expression.xreplace(named)
            symbols = expression.free_symbols | _within(expression, local)
            if _tells(symbols | {states[s] for s in symbols & set(states)}, [*values.values(), *states.values()]):
                _require(title, what, inserted, units)


def _named(title: str, local: Local, states: dict[sympy.Symbol, _Stated]) -> dict[sympy.Basic, sympy.Basic]:
    """Return symbols with units for auxiliary states and named quantities."""
    named: dict[sympy.Basic, sympy.Basic] = dict(states)
    for symbol, (kind, expression) in local.quantities.items():
        expression = expression.xreplace(named)
        _require(title, f"what is named {symbol.name!r}", expression, "")
        units = units_of(expression)
        if units and kind == "rate":
            units = "1/s" if units == "1" else f"({units})/s" if "/" in units else f"{units}/s"
        named[symbol] = _stated(str(symbol.name), units)
    return named


def _claims(term: object, states: dict[sympy.Symbol, _Stated]) -> Iterator[tuple[str, sympy.Expr, str]]:
    """Yield what a term holds, what it is, and in what it has to be."""
    match term:
        case Auxiliary(state, rate, initial):
            yield (
                f"the rate of the state {states[state].name!r}, times seconds,",
                as_symbolic(rate) * _SECOND,
                (states[state].units),
            )
            yield f"the initial value of the state {states[state].name!r}", as_symbolic(initial), states[state].units
        case Potential(energy):
            yield "the energy of a Potential", as_symbolic(energy), "J"
        case Kinetic(energy):
            yield "the energy of a Kinetic", as_symbolic(energy), "J"
        case VirtualWork(force, velocity):
            for f, v in zip(flatten(force), flatten(velocity), strict=True):
                yield "force times velocity of a VirtualWork", as_symbolic(f) * as_symbolic(v), "W"
        case Constraint(equations, _):
            for equation in flatten(equations):
                yield "a constraint", as_symbolic(equation), ""


def _within(expression: sympy.Expr, local: Local) -> set[Any]:
    """Return the symbols of what named quantities in an expression stand for."""
    found: set[Any] = set()
    left = [s for s in expression.atoms(sympy.Symbol) if s in local.quantities]
    while left:
        for symbol in local.quantities[left.pop()][1].atoms(sympy.Symbol) - found:
            found.add(symbol)
            if symbol in local.quantities:
                left.append(symbol)
    return found


def _tells(symbols: set[Any], values: Any) -> bool:
    """Whether there is a parameter with units that are neither lengths nor pure numbers: else a number is left out."""
    own = {x for value in values for x in flatten(value) if isinstance(x, _Stated) and x.units}
    plain = {unit.dimension for x in ("m", "1") if (unit := read_units(x)) is not None}
    return any((unit := read_units(x.units)) is not None and unit.dimension not in plain for x in own & symbols)


def _require(title: str, what: str, expression: sympy.Expr, units: str) -> None:
    given = sorted(
        {(str(s.name).partition("[")[0], s.units) for s in expression.free_symbols if isinstance(s, _Stated)}
    )
    stated = f"Stated are {', '.join(f'{name} in {own}' for name, own in given if own)}."
    if all(power.exp.is_number for power in expression.atoms(sympy.Pow)):
        wrong = mismatches(f"{title}: {what}", expression, units)
        assert not wrong, f"{wrong[0].text} {stated}"


def _symbols(key: str, value: Any, parameter: Any) -> Any:
    """Return symbols for a value of a parameter; what `prepare` adds has units that nobody states."""
    if value is None or (parameter is not None and parameter.kind == "option"):
        return value
    units = parameter.units if parameter is not None else ""
    if isinstance(value, tuple):
        return sympy.Matrix([_stated(f"{key}[{k}]", units) for k in range(len(value))]) if value else ()
    return _stated(key, units)


def _stated(name: str, units: str) -> _Stated:
    symbol = _Stated(name, real=True)
    symbol.units = units
    return symbol


_SECOND = _stated("s", "s")
"""One second, by which rates are multiplied."""
