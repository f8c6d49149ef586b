"""Recorded quantities: an expression, its units, and their properties."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.components import Component
from uqmbd.mechanism.declared.output import TURNS, Output
from uqmbd.mechanism.declared.scope import Described, require_known, unseen_numbers
from uqmbd.mechanism.expressions import check_dimensions, check_scalar, flatten, is_scalar, numbers, shown
from uqmbd.mechanism.geometry import Frame
from uqmbd.names import check_name, check_units, did_you_mean

__all__ = ["output_of", "require_recordable"]


def output_of(mechanism: Described, name: str, expression: Any, units: Any, *, angle: Any, over: Any) -> Output:
    """Return an output of a mechanism, or raise where something is wrong with it; see `Mechanism.output`."""
    where = f"output {check_name(name, 'output')!r}"
    if name in mechanism.outputs or name in mechanism.scalars:
        raise StudyError(f"{where}: there is an output of that name already; every output needs its own.")
    value = require_recordable(where, expression)
    if not value.free_symbols:
        raise StudyError(
            f"{where}: the expression is the constant {value}; it depends on nothing. "
            "Use a body's position, velocity, a reaction, ..."
        )
    require_known(mechanism, where, value, "output")
    if not isinstance(angle, bool):
        raise StudyError(f"{where}: angle is {shown(angle)}; expected True or False.")
    if angle and not (isinstance(units, str) and units in TURNS):
        raise StudyError(
            f"{where}: it is declared an angle, and its units are {units!r}; expected 'rad' or 'deg', which say "
            "how long a turn is. State the units, or leave angle=True out."
        )
    units = check_units(units, where)
    if is_scalar(value):
        check_scalar(where, value)
    check_dimensions(where, value, units, unseen_numbers(mechanism))
    if is_scalar(value):
        if angle:
            raise StudyError(f"{where}: it has no time over which to unwrap an angle; leave angle=True out.")
        if over is not None:
            raise StudyError(f"{where}: it has no time, and is no curve over another output; leave over= out.")
        return Output(name, value, units)
    beside = "" if over is None else drawn_over(where, over, mechanism.outputs, mechanism.scalars)
    return Output(name, value, units, TURNS[units] if angle else 0.0, beside)


def require_recordable(where: str, expression: Any) -> sympy.Expr:
    """Return a recordable expression, or raise with a replacement."""
    if isinstance(expression, Frame):
        name = getattr(expression, "name", "body")
        raise StudyError(
            f"{where}: the expression is {shown(expression)} itself; record one of its quantities, "
            f"e.g. {name}.position[0] or {name}.velocity[1]."
        )
    if isinstance(expression, Component):
        raise StudyError(
            f"{where}: the expression is {shown(expression)} itself; record a reaction of it, "
            f"e.g. {expression.name}.reaction_force[0]."
        )
    if callable(expression) and not isinstance(expression, sympy.Basic):
        name = getattr(expression, "__name__", "it")
        raise StudyError(
            f"{where}: the expression is the function {name}; record its result, e.g. body.{name}(...)[0]."
        )
    if isinstance(expression, sympy.logic.boolalg.Boolean) and not isinstance(expression, sympy.Expr):
        raise StudyError(f"{where}: the expression {expression} is true or false; expected one that is a number.")
    parts = flatten(expression)
    if len(parts) > 1:
        raise StudyError(
            f"{where}: the expression has {len(parts)} components; record them one by one, e.g. body.position[0]."
        )
    return numbers(where, "the expression", expression, 1, "in quantities of bodies and components")[0]


def drawn_over(where: str, over: Any, outputs: Mapping[str, Output], scalars: Mapping[str, Output]) -> str:
    """Return the name of the output that is the abscissa of another one; raise if it cannot be."""
    if isinstance(over, str) and over in outputs:
        return over
    if isinstance(over, str) and over in scalars:
        raise StudyError(f"{where}: over={over!r} is an output without a time; nothing is a curve over one number.")
    known = ", ".join(map(repr, outputs)) or "none so far"
    near = did_you_mean(over, outputs) if isinstance(over, str) else ""
    raise StudyError(
        f"{where}: over is {shown(over)}{f'{near} Expected' if near else '; expected'} the name of an output that is "
        f"recorded already, to be drawn over: {known}."
    )
