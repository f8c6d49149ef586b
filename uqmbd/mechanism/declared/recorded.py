"""Recorded quantities: expressions, units and properties of outputs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.components import Component
from uqmbd.mechanism.declared.output import TURNS, Output
from uqmbd.mechanism.declared.scope import Described, require_known, unseen_numbers
from uqmbd.mechanism.expressions import (
    check_dimensions,
    check_scalar,
    flatten,
    is_scalar,
    numbers,
    shown,
    unevaluated_process,
)
from uqmbd.mechanism.geometry import Frame
from uqmbd.names import check_name, check_units, did_you_mean

__all__ = ["output_of", "require_recordable"]


def output_of(mechanism: Described, name: str, expression: Any, units: Any, *, angle: Any, over: Any) -> Output:
    """Return an output of a mechanism, or raise if an argument is invalid; see `Mechanism.output`."""
    where = f"output {check_name(name, 'output')!r}"
    if name in mechanism.outputs or name in mechanism.scalars:
        raise StudyError(f"{where}: an output with this name exists already; choose another name.")
    value = require_recordable(where, expression)
    if not value.free_symbols:
        raise StudyError(
            f"{where}: the expression is the constant {value}. Expected an expression in quantities of the "
            "mechanism, such as a position, a velocity or a reaction."
        )
    require_known(mechanism, where, value, "output")
    if not isinstance(angle, bool):
        raise StudyError(f"{where}: angle is {shown(angle)}; expected True or False.")
    if angle and not (isinstance(units, str) and units in TURNS):
        raise StudyError(
            f"{where}: the output is declared as an angle, but its units are {units!r}; expected 'rad' or 'deg'. "
            "Correct the units, or omit angle=True."
        )
    units = check_units(units, where)
    if is_scalar(value):
        check_scalar(where, value)
    check_dimensions(where, value, units, unseen_numbers(mechanism))
    if is_scalar(value):
        if angle:
            raise StudyError(f"{where}: a scalar output cannot be unwrapped over time; omit angle=True.")
        if over is not None:
            raise StudyError(f"{where}: a scalar output is not a curve over another output; omit over=.")
        return Output(name, value, units)
    beside = "" if over is None else drawn_over(where, over, mechanism.outputs, mechanism.scalars)
    return Output(name, value, units, TURNS[units] if angle else 0.0, beside)


def require_recordable(where: str, expression: Any) -> sympy.Expr:
    """Return an expression that an output can record; otherwise raise an error that suggests a replacement."""
    if isinstance(expression, Frame):
        name = getattr(expression, "name", "body")
        raise StudyError(
            f"{where}: the expression is {shown(expression)} itself; record one of its quantities, "
            f"e.g. {name}.position[0] or {name}.velocity[1]."
        )
    if isinstance(expression, Component):
        raise StudyError(
            f"{where}: the expression is {shown(expression)} itself; record one of its reactions, e.g. "
            f"{expression.name}.reaction_force[0]."
        )
    if (process := unevaluated_process(expression)) is not None:
        raise StudyError(f"{where}: the expression is {process}.")
    if callable(expression) and not isinstance(expression, sympy.Basic):
        name = getattr(expression, "__name__", "it")
        raise StudyError(
            f"{where}: the expression is the function {name}; record its result, e.g. body.{name}(...)[0]."
        )
    if isinstance(expression, sympy.logic.boolalg.Boolean) and not isinstance(expression, sympy.Expr):
        raise StudyError(
            f"{where}: the expression {expression} is a relation or condition; expected an expression "
            "with numeric values."
        )
    parts = flatten(expression)
    if len(parts) > 1:
        raise StudyError(
            f"{where}: the expression has {len(parts)} components; record them one by one, e.g. body.position[0]."
        )
    return numbers(where, "the expression", expression, 1, "in quantities of bodies and components")[0]


def drawn_over(where: str, over: Any, outputs: Mapping[str, Output], scalars: Mapping[str, Output]) -> str:
    """Return the name of the output on the horizontal axis of another output's plot; raise if it is invalid."""
    if isinstance(over, str) and over in outputs:
        return over
    if isinstance(over, str) and over in scalars:
        raise StudyError(f"{where}: over={over!r} is a scalar output; expected an output over time for a curve.")
    known = ", ".join(map(repr, outputs)) or "none"
    near = did_you_mean(over, outputs) if isinstance(over, str) else ""
    raise StudyError(
        f"{where}: over is {shown(over)}{f'{near} Expected' if near else '; expected'} the name of an existing "
        f"output for the horizontal axis: {known}."
    )
