"""Check that velocities in parameter values do not occur in constraints or potential energies."""

from __future__ import annotations

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.components import (
    Component,
    Constraint,
    Local,
    Potential,
    StateSymbol,
    flatten,
    frames_of,
    pairs_of,
)
from uqmbd.mechanism.expressions import t
from uqmbd.mechanism.geometry import Space

__all__ = ["RATES", "require_holonomic"]

RATES = ("v", "angular_velocity")
"""Quantities of bodies that are velocities."""


def require_holonomic(where: str, component: Component, space: Space) -> None:
    """Raise if a velocity in the parameter values of a component occurs in a constraint or a potential energy.

    The `uqmbd.StudyError` names the arguments that contain velocities.  Velocities are allowed in forces. A constraint
    with velocities is not holonomic, and an energy with velocities is not a potential energy.  The terms are evaluated
    only if the values contain velocities.
    """
    guilty = {
        key: sorted(map(str, rates))
        for key, value in component.values.items()
        if key in component.parameters() and (rates := _rates(*flatten(value)))
    }
    if not guilty:
        return
    try:
        found = _place(component, space)
    except Exception:  # the derivation of the equations reports errors of the terms with all details
        return
    if found:
        text = " and ".join(f"{key}, which contains {', '.join(rates)}," for key, rates in guilty.items())
        raise StudyError(
            f"{where}: {found} depends on {text} but it may depend only on random variables, positions and time, not "
            "on velocities. To prescribe a speed, use a driver. For an equation that is linear in velocities, "
            "define a component with a uqmbd.extend.VelocityConstraint."
        )


def _place(component: Component, space: Space) -> str:
    """Return the term that contains a velocity as text: "a constraint" or "a potential energy", or empty if none."""
    frames = frames_of(component)
    values = {
        key: sympy.Matrix(value) if isinstance(value, tuple) and value else value
        for key, value in component.values.items()
    }
    local = Local(space, frames, values, t, pairs_of(component))
    for term in component.terms(local):
        if isinstance(term, Constraint) and _rates(*flatten(term.equations), named=local):
            return f"the constraint {term.label!r}" if term.label else "a constraint"
        if isinstance(term, Potential) and _rates(term.energy, named=local):
            return "a potential energy"
    return ""


def _rates(*values: object, named: Local | None = None) -> set[sympy.Symbol]:
    """Return the velocities in expressions, including velocities in named quantities."""
    found: set[sympy.Symbol] = set()
    for value in values:
        for symbol in value.free_symbols if isinstance(value, sympy.Basic) else ():
            if isinstance(symbol, StateSymbol) and symbol.quantity in RATES:
                found.add(symbol)
            elif named is not None and symbol in named.quantities and named.quantities[symbol][0] == "rate":
                found.add(symbol)
    return found
