"""Outputs: the named scalars that a study records."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.components import Component
from uqmbd.mechanism.expressions import flatten, numbers, shown
from uqmbd.mechanism.geometry import Frame
from uqmbd.names import did_you_mean

__all__ = ["TURNS", "Output", "drawn_over", "recorded"]

TURNS = {"rad": 2 * math.pi, "deg": 360.0}
"""Length of a turn in the units that an angle may have."""


@dataclass(frozen=True)
class Output:
    """A named scalar that a study records at every time.

    Attributes
    ----------
    name, units : str
    expression : expression
    turn : float
        Length of a turn of an angle, else 0.
    over : str
        Name of the output over which it is drawn, too; empty: over time alone.
    """

    name: str
    expression: sympy.Expr
    units: str
    turn: float = 0.0
    over: str = ""


def recorded(where: str, expression: Any) -> sympy.Expr:
    """Return what an output records, or say what to write instead."""
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
            f"{where}: the expression is the function {name}; record what it returns, e.g. body.{name}(...)[0]."
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
    """Return the name of the output over which another one is to be drawn, or say why it cannot be."""
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
