"""Expressions before the derivation: functions are written out, and meaningless symbols are refused."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism import (
    WITHOUT_DERIVATIVE,
    Component,
    StateSymbol,
    as_symbolic,
    describe_foreign_part,
    foreign_part,
    random_variables,
    shown,
    step,
    t,
    too_large,
)
from uqmbd.randomness import RandomVariable

__all__ = ["TIME", "plain", "require_derivatives", "require_velocities", "settled_expression"]

TIME = sympy.Symbol("_t", real=True)
"""Time in blocks."""


SMALLEST = 1e-290
"""Size of the numbers that keep all their digits, and of their inverses."""


def plain(expression: Any) -> sympy.Expr:
    """Write functions that have no derivative everywhere as piecewise expressions, which have."""
    value = as_symbolic(expression)
    if value.has(step):
        value = value.replace(lambda e: isinstance(e, step), lambda e: e.doit())
    if value.has(sympy.Abs, sympy.Max, sympy.Min, sympy.sign, sympy.Heaviside):
        kinds = (sympy.Abs, sympy.Max, sympy.Min, sympy.sign, sympy.Heaviside)
        value = value.replace(lambda e: isinstance(e, kinds), _piecewise)
    if value.has(sympy.ITE):  # SymPy's way to compare a piecewise expression
        value = value.replace(sympy.ITE, lambda a, b, c: sympy.Or(sympy.And(a, b), sympy.And(sympy.Not(a), c)))
    if value.has(sympy.exp) and any(_extreme(x) for x in value.atoms(sympy.Float)):
        value = value.replace(lambda e: isinstance(e, sympy.Mul) and _extreme(e.args[0]), _with_exponent)
    result: sympy.Expr = value
    return result


def _extreme(value: sympy.Basic) -> bool:
    """Return whether a number is not finite in double precision, or nearly so."""
    return isinstance(value, sympy.Float) and value != 0 and not SMALLEST < abs(value) < 1 / SMALLEST


def _with_exponent(e: sympy.Mul) -> sympy.Expr:
    """Write ``c exp(x)`` as ``exp(log(c) + x)``: SymPy takes numbers out of exponents, where they leave the range."""
    factor, *others = e.args
    grows = next((x for x in others if isinstance(x, sympy.exp)), None)
    if grows is None:
        return e
    others.remove(grows)
    # a float would be taken out again
    exponent = grows.args[0] + sympy.Rational(float(sympy.log(abs(factor))))
    return sympy.Mul(sympy.sign(factor), *others, sympy.exp(exponent))


def _piecewise(e: sympy.Expr) -> sympy.Expr:
    x = e.args[0]
    if isinstance(e, sympy.Abs):
        return sympy.Piecewise((x, x >= 0), (-x, True))
    if isinstance(e, sympy.sign):
        return sympy.Piecewise((1, x > 0), (-1, x < 0), (0, True))
    if isinstance(e, sympy.Heaviside):
        return sympy.Piecewise((1, x > 0), (0, True))
    best = e.args[0]
    for other in e.args[1:]:
        keep = best >= other if isinstance(e, sympy.Max) else best <= other
        best = sympy.Piecewise((best, keep), (other, True))
    return best


def settled_expression(
    where: str,
    component: Component,
    expression: Any,
    named: Mapping[sympy.Basic, sympy.Expr],
    known: set[sympy.Symbol],
) -> sympy.Expr:
    """Return an expression of `Component.terms` in local symbols.

    Named quantities are replaced by their local symbols `named`; all local symbols are `known`.  Raises
    `uqmbd.StudyError`, with advice, if the expression contains anything else.
    """
    try:
        value = as_symbolic(expression)
    except StudyError:
        value = None
    if not isinstance(value, sympy.Expr):
        raise StudyError(
            f"{where}: terms() holds {shown(expression)}, which is no expression; expected one in what p offers."
        )
    if value.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo, sympy.I):
        raise StudyError(f"{where}: terms() holds {shown(value)}, which is not a finite real number.")
    if (large := too_large(value)) is not None:
        raise StudyError(f"{where}: terms() holds {shown(large)}, which a number of 64 bits cannot hold.")
    value = plain(value).xreplace(named) if named else plain(value)
    if (foreign := foreign_part(value)) is not None:
        raise StudyError(f"{where}: in an expression of its terms {describe_foreign_part(foreign)}")
    strangers = sorted(value.free_symbols - known, key=str)
    if strangers:
        raise StudyError(f"{where}: {_stranger(component, strangers[0])}")
    return value


def _stranger(component: Component, symbol: sympy.Symbol) -> str:
    """Return a message on what to write in terms instead of a symbol without meaning there."""
    if symbol == t:
        return "terms() uses uqmbd.t; there the time is p.time."
    if isinstance(symbol, StateSymbol):
        roles = [role for role, body in component.attached.items() if body is symbol.owner]
        write = f"p.{roles[0]}" if roles else "an argument of the component, named in `bodies`, as p.body"
        return f"terms() uses {symbol} of body {symbol.owner.name!r} itself; write {write}."
    holders = [key for key, value in component.values.items() if symbol in random_variables(value)]
    if isinstance(symbol, RandomVariable) and holders:
        return (
            f"terms() uses the random variable {symbol} of its option {holders[0]!r}; declare it as a number, "
            f"{holders[0]} = uqmbd.Parameter(units, description), and write p.{holders[0]}."
        )
    if isinstance(symbol, RandomVariable):
        return (
            f"terms() uses the random variable {symbol} itself; declare a uqmbd.Parameter, write p.NAME for it, and "
            "give the random variable where the component is made."
        )
    return (
        f"terms() uses the symbol {symbol}, which means nothing there; expected what p offers: bodies, parameters, "
        "states and time."
    )


def require_derivatives(where: str, expressions: list[sympy.Expr], changing: set[sympy.Symbol]) -> None:
    """Raise where a function without a derivative contains a symbol by which expressions are differentiated.

    The expressions are in local symbols; `changing` are the symbols of the derivatives.
    """
    for expression in expressions:
        for part in sorted(expression.atoms(*WITHOUT_DERIVATIVE), key=str):
            if part.free_symbols & changing:
                kind = type(part).__name__
                raise StudyError(
                    f"{where}: a force, an energy or a constraint contains {kind}(...) of what moves, and {kind} has "
                    "no derivative that can be computed; write it piecewise, or smooth it."
                )


def require_velocities(
    where: str,
    label: str,
    stated: sympy.Expr,
    whole: sympy.Expr,
    velocities: set[sympy.Symbol],
    accelerations: set[sympy.Basic],
) -> None:
    """Raise where an equation between velocities contains none, is not linear in them, or contains accelerations.

    The equation is given as stated and, as `whole`, with its named quantities replaced; `velocities` are those of the
    bodies, `accelerations` the named quantities that are rates of velocities.
    """
    if not whole.free_symbols & velocities:
        raise StudyError(
            f"{where}: the velocity constraint {label!r} contains no velocity; an equation of "
            "positions is a Constraint."
        )
    if stated.free_symbols & accelerations:
        raise StudyError(
            f"{where}: the velocity constraint {label!r} contains the rate of a velocity; expected an equation "
            "between velocities."
        )
    for velocity in sorted(whole.free_symbols & velocities, key=str):
        slope = whole.diff(velocity)
        if slope.free_symbols & velocities and sympy.expand(slope).free_symbols & velocities:
            raise StudyError(
                f"{where}: the velocity constraint {label!r} is not linear in the velocities; expected "
                "a(q, t) . v + b(q, t) = 0. What depends on velocities in another way is a VirtualWork."
            )
