"""Test the units of parameters against the terms of a component: energies in J, power in W, sums of equal units."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import sympy

from uqmbd.errors import StudyError
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
    coordinates_of,
)
from uqmbd.mechanism.expressions import flatten, mismatches, t, units_of
from uqmbd.units import PURE, TABLE, read_units

__all__ = ["check_units"]


class _Stated(sympy.Dummy):
    """Symbol of a number with stated units."""

    units: str = ""

    def _sympystr(self, printer: Any) -> str:
        return str(self.name)


def check_units(title: str, component: Component, space: Space) -> None:
    """Check the units of terms of a component in a mechanism with this space.

    Raise AssertionError if a dimension is wrong. The test omits terms without a parameter in other units than m, such
    as a term with an implicit stiffness of one. It also omits powers with a parameter as exponent, which affects the
    units of their factor, and components with a law of the user. A state without stated units has the units of its
    rate times seconds, which do not show whether a term contains implicit numbers.
    """
    declared = component.parameters()
    options = [component.values.get(key) for key, parameter in declared.items() if parameter.kind == "option"]
    if not all(option is None or isinstance(option, (str, bool, int, float)) for option in options):
        return
    values = {key: _symbols(key, x, declared.get(key)) for key, x in component.values.items()}
    frames = {
        role: Frame(space, _rotated(body.q, "1"), _rotated(body.v, "1/s")) if isinstance(body, Body) else Frame(space)
        for role, body in component.attached.items()
    }
    own = coordinates_of(component)
    pairs = {}
    for name, declared_coordinate in () if own is None else own.declared.items():
        units = declared_coordinate.units
        pairs[name] = _stated(name, units), _stated(f"{name}'", "1/s" if units == "1" else f"{units}/s")
    local = Local(space, frames, values, t, pairs)
    terms, _ = component.stated(local)
    states = {symbol: _stated(name, local.units[name]) for name, symbol in local.states.items()}
    named = _named(title, local, states)
    declared_states = {symbol for symbol, state in states.items() if state.units}
    for term in terms:  # a state without stated units has the units of its rate times seconds
        if isinstance(term, Auxiliary) and not states[term.state].units:
            units = units_of(as_symbolic(term.rate).xreplace(named) * _SECOND, exact=True)
            states[term.state] = _stated(states[term.state].name, units)
    named = _named(title, local, states)
    for term in terms:
        for what, expression, units in _requirements(term, states):
            inserted = expression.xreplace(named)
            symbols = expression.free_symbols | _within(expression, local)
            stated = [states[s] for s in symbols & declared_states]
            stated += [x for pair in pairs.values() for x in pair if x in symbols]
            if _is_explicit(inserted, symbols | set(stated), [*values.values(), *stated]):
                _require(title, what, inserted, units)


def _named(title: str, local: Local, states: dict[sympy.Symbol, _Stated]) -> dict[sympy.Basic, sympy.Basic]:
    """Return symbols with units for auxiliary states and named quantities."""
    named: dict[sympy.Basic, sympy.Basic] = dict(states)
    for symbol, (kind, expression) in local.quantities.items():
        expression = expression.xreplace(named)
        _require(title, f"the named quantity {symbol.name!r}", expression, "")
        units = units_of(expression, exact=True)
        if units and kind == "rate":
            units = "1/s" if units == "1" else f"({units})/s" if "/" in units else f"{units}/s"
        named[symbol] = _stated(str(symbol.name), units)
    return named


def _requirements(term: object, states: dict[sympy.Symbol, _Stated]) -> Iterator[tuple[str, sympy.Expr, str]]:
    """Yield, for each part of a term, its name, its expression, and its required units."""
    match term:
        case Auxiliary(state, rate, initial):
            yield (
                f"the rate of the state {states[state].name!r}, times seconds,",
                as_symbolic(rate) * _SECOND,
                (states[state].units),
            )
            yield f"the initial value of the state {states[state].name!r}", as_symbolic(initial), states[state].units
        case Potential(energy):
            yield "the potential energy of a Potential", as_symbolic(energy), "J"
        case Kinetic(energy):
            yield "the kinetic energy of a Kinetic", as_symbolic(energy), "J"
        case VirtualWork(force, velocity):
            for f, v in zip(flatten(force), flatten(velocity), strict=True):
                yield "force times velocity of a VirtualWork", as_symbolic(f) * as_symbolic(v), "W"
        case Constraint(equations, _):
            for equation in flatten(equations):
                yield "a constraint", as_symbolic(equation), ""


def _within(expression: sympy.Expr, local: Local) -> set[Any]:
    """Return the symbols in the definitions of named quantities of an expression."""
    found: set[Any] = set()
    left = [s for s in expression.atoms(sympy.Symbol) if s in local.quantities]
    while left:
        for symbol in local.quantities[left.pop()][1].atoms(sympy.Symbol) - found:
            found.add(symbol)
            if symbol in local.quantities:
                left.append(symbol)
    return found


def _is_explicit(term: sympy.Expr, symbols: set[Any], values: Any) -> bool:
    """Return whether parameters and states show that a term contains no implicit number with units.

    This is so if one of them has units other than m and 1, or is a factor of the term or of its reciprocal.
    """
    plain = {TABLE["m"].dimension, PURE}
    for x in symbols & {x for value in values for x in flatten(value) if isinstance(x, _Stated)}:
        unit = read_units(x.units)
        if unit is not None and (unit.dimension not in plain or _is_factor(x, term)):
            return True
    return False


def _is_factor(symbol: _Stated, term: sympy.Expr) -> bool:
    """Return whether a term vanishes with a symbol, or with its reciprocal."""
    return any(_vanishes(x, symbol) for x in (term, term.xreplace({symbol: 1 / symbol})))


def _vanishes(term: sympy.Expr, symbol: _Stated) -> bool:
    try:
        return bool(term.xreplace({symbol: sympy.S.Zero}) == 0)
    except StudyError:  # with this value, the corners of a step are equal or not finite
        return False


def _require(title: str, what: str, expression: sympy.Expr, units: str) -> None:
    given = sorted(
        {(str(s.name).partition("[")[0], s.units) for s in expression.free_symbols if isinstance(s, _Stated)}
    )
    stated = f"The declared units are {', '.join(f'{name} in {own}' for name, own in given if own)}."
    if all(power.exp.is_number for power in expression.atoms(sympy.Pow)):
        wrong = mismatches(f"{title}: {what}", expression, units, exact=True)
        assert not wrong, f"{wrong[0].text} {stated}"


def _symbols(key: str, value: Any, parameter: Any) -> Any:
    """Return symbols for a value of a parameter; values that `prepare` adds have unknown units."""
    if value is None or (parameter is not None and parameter.kind == "option"):
        return value
    units = parameter.units if parameter is not None else ""
    if isinstance(value, tuple):
        return sympy.Matrix([_stated(f"{key}[{k}]", units) for k in range(len(value))]) if value else ()
    return _stated(key, units)


def _rotated(symbols: Sequence[Any], units: str) -> list[Any]:
    """Return coordinates or velocities of a body; assign `units` to quaternions, which have no units in studies."""
    return [x if x.units else _stated(x.name, units) for x in symbols]


def _stated(name: str, units: str) -> _Stated:
    symbol = _Stated(name, real=True)
    symbol.units = units
    return symbol


_SECOND = _stated("s", "s")
"""One second, the factor of rates."""
