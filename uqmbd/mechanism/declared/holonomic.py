"""Constraints and potentials contain no velocities: values of a user that contain some are refused at once."""

from __future__ import annotations

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.bodies import Body, StateSymbol
from uqmbd.mechanism.components import Component, Constraint, Local, Potential, flatten
from uqmbd.mechanism.expressions import t
from uqmbd.mechanism.geometry import Frame, Space

__all__ = ["RATES", "require_holonomic"]

RATES = ("v", "angular_velocity")
"""Quantities of bodies that are velocities."""


def require_holonomic(where: str, component: Component, space: Space) -> None:
    """Raise where a velocity among the values of a component enters a constraint or a potential energy.

    The `uqmbd.StudyError` names the arguments that contain velocities.  Velocities belong to forces: a constraint that
    contains them is not holonomic, and an energy that contains them is no potential.  The terms are evaluated only if
    there are velocities among the values.
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
    except Exception:  # errors of the terms are reported completely when the terms are derived
        return
    if found:
        told = " and ".join(f"{key}, which contains {', '.join(rates)}," for key, rates in guilty.items())
        raise StudyError(
            f"{where}: {told} enters {found}; there a number may depend on random variables, positions and time, not "
            "on velocities. To prescribe a speed, use a driver; a force may depend on velocities. An equation that is "
            "linear in velocities is a uqmbd.extend.VelocityConstraint, a term of a component."
        )


def _place(component: Component, space: Space) -> str:
    """Return where a velocity occurs: in a constraint, a potential energy, or neither (empty)."""
    frames = {
        role: Frame(space, body.q, body.v) if isinstance(body, Body) else Frame(space)
        for role, body in component.attached.items()
    }
    values = {
        key: sympy.Matrix(value) if isinstance(value, tuple) and value else value
        for key, value in component.values.items()
    }
    local = Local(space, frames, values, t)
    for term in component.terms(local):
        if isinstance(term, Constraint) and _rates(*flatten(term.equations), named=local):
            return f"the constraint {term.label!r}" if term.label else "a constraint"
        if isinstance(term, Potential) and _rates(term.energy, named=local):
            return "a potential energy"
    return ""


def _rates(*values: object, named: Local | None = None) -> set[sympy.Symbol]:
    """Return the velocities that expressions contain, those within named quantities included."""
    found: set[sympy.Symbol] = set()
    for value in values:
        for symbol in value.free_symbols if isinstance(value, sympy.Basic) else ():
            if isinstance(symbol, StateSymbol) and symbol.quantity in RATES:
                found.add(symbol)
            elif named is not None and symbol in named.quantities and named.quantities[symbol][0] == "rate":
                found.add(symbol)
    return found
