"""Preparation of expressions for the derivation: rewrite functions, and raise for unknown symbols."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism import (
    WITHOUT_DERIVATIVE,
    Component,
    Excitation,
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

__all__ = ["TIME", "plain", "require_derivatives", "require_velocities", "localised_expression"]

TIME = sympy.Symbol("_t", real=True)
"""Time in blocks."""


SMALLEST = 1e-290
"""Smallest size of a number that counts as regular; the inverse is the largest size."""


def plain(expression: Any) -> sympy.Expr:
    """Rewrite functions without a derivative everywhere as piecewise expressions with derivatives."""
    value = as_symbolic(expression)
    if value.has(Excitation):
        value = value.replace(lambda e: isinstance(e, Excitation), lambda e: e.doit())
    if value.has(step):
        value = value.replace(lambda e: isinstance(e, step), lambda e: e.doit())
    if value.has(sympy.Abs, sympy.Max, sympy.Min, sympy.sign, sympy.Heaviside):
        kinds = (sympy.Abs, sympy.Max, sympy.Min, sympy.sign, sympy.Heaviside)
        value = value.replace(lambda e: isinstance(e, kinds), _piecewise)
    if value.has(sympy.ITE):  # SymPy uses ITE to compare a piecewise expression
        value = value.replace(sympy.ITE, lambda a, b, c: sympy.Or(sympy.And(a, b), sympy.And(sympy.Not(a), c)))
    if value.has(sympy.exp) and any(_extreme(x) for x in value.atoms(sympy.Float)):
        value = value.replace(lambda e: isinstance(e, sympy.Mul) and _extreme(e.args[0]), _with_exponent)
    result: sympy.Expr = value
    return result


def _extreme(value: sympy.Basic) -> bool:
    """Return whether a number, other than zero, is near or beyond the limits of double precision."""
    return isinstance(value, sympy.Float) and value != 0 and not SMALLEST < abs(value) < 1 / SMALLEST


def _with_exponent(e: sympy.Mul) -> sympy.Expr:
    """Write ``c exp(x)`` as ``exp(log(c) + x)``, because numbers extracted from exponents by SymPy may overflow."""
    factor, *others = e.args
    grows = next((x for x in others if isinstance(x, sympy.exp)), None)
    if grows is None:
        return e
    others.remove(grows)
    # SymPy would extract a float again
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


def localised_expression(
    where: str,
    component: Component,
    expression: Any,
    named: Mapping[sympy.Basic, sympy.Expr],
    known: set[sympy.Symbol],
) -> sympy.Expr:
    """Return an expression of `Component.terms` in local symbols.

    Named quantities are replaced by their local symbols `named`; `known` contains all local symbols.  Raises
    `uqmbd.StudyError`, with advice, if the expression contains other symbols.
    """
    try:
        value = as_symbolic(expression)
    except StudyError:
        value = None
    if not isinstance(value, sympy.Expr):
        raise StudyError(
            f"{where}: terms() contains {shown(expression)}, which is not an expression; expected an expression in "
            "quantities of p."
        )
    if value.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo, sympy.I):
        raise StudyError(f"{where}: terms() contains {shown(value)}, which is not a finite real number.")
    if (large := too_large(value)) is not None:
        raise StudyError(f"{where}: terms() contains {shown(large)}, which exceeds the range of 64-bit numbers.")
    value = plain(value).xreplace(named) if named else plain(value)
    if (foreign := foreign_part(value)) is not None:
        raise StudyError(f"{where}: terms() is invalid: {describe_foreign_part(foreign)}")
    strangers = sorted(value.free_symbols - known, key=str)
    if strangers:
        raise StudyError(f"{where}: {_advice_on_symbol(component, strangers[0])}")
    return value


def _advice_on_symbol(component: Component, symbol: sympy.Symbol) -> str:
    """Return a message with the replacement for a symbol that is invalid in terms."""
    if symbol == t:
        return "terms() uses uqmbd.t; use p.time instead."
    if isinstance(symbol, StateSymbol):
        if not hasattr(symbol.owner, "pose"):
            return (
                f"terms() uses {symbol}, a coordinate of {symbol.owner.name!r}, itself; write p.coordinate(name) for "
                "a coordinate of this component, and a parameter for a coordinate of another component."
            )
        roles = [role for role, body in component.attached.items() if body is symbol.owner]
        write = f"p.{roles[0]}" if roles else "p.NAME, after you have added the argument NAME of this body to `bodies`"
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
            "pass the random variable as an argument of the component."
        )
    return (
        f"terms() uses the symbol {symbol}, which is unknown; expected quantities of p: bodies, "
        "parameters, states and time."
    )


def require_derivatives(where: str, expressions: list[sympy.Expr], changing: set[sympy.Symbol]) -> None:
    """Raise if a function without a derivative contains a symbol of differentiation.

    The expressions are in local symbols; `changing` are the symbols of the derivatives.
    """
    for expression in expressions:
        for part in sorted(expression.atoms(*WITHOUT_DERIVATIVE), key=str):
            if part.free_symbols & changing:
                kind = type(part).__name__
                raise StudyError(
                    f"{where}: a force, an energy or a constraint contains {kind}(...) of a quantity of the motion, "
                    f"but the derivative of {kind} cannot be computed; write a piecewise or a smooth function."
                )


def require_velocities(
    where: str,
    label: str,
    stated: sympy.Expr,
    whole: sympy.Expr,
    velocities: set[sympy.Symbol],
    accelerations: set[sympy.Basic],
) -> None:
    """Raise if an equation between velocities has no velocity, is nonlinear in velocities, or contains accelerations.

    `stated` is the equation as given, and `whole` is the equation with replaced named quantities; `velocities` belong
    to the bodies, and `accelerations` are named quantities that are rates of velocities.
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
    if _degree(whole, velocities, {}) <= 1:
        return
    for velocity in sorted(whole.free_symbols & velocities, key=str):  # terms of higher degree may cancel
        slope = whole.diff(velocity)
        if slope.free_symbols & velocities and sympy.expand(slope).free_symbols & velocities:
            raise StudyError(
                f"{where}: the velocity constraint {label!r} is not linear in the velocities; expected "
                "a(q, t) . v + b(q, t) = 0. Write other terms that depend on velocities as a VirtualWork."
            )


def _degree(e: sympy.Basic, symbols: set[sympy.Symbol], known: dict[sympy.Basic, float]) -> float:
    """Return the degree of an unexpanded expression in given symbols; inf: it may not be a polynomial.

    Derivatives of constraints contain the same parts hundreds of times: `known` stores the degree of each part.
    """
    if e not in known:
        degrees = [_degree(part, symbols, known) for part in e.args]
        if e in symbols:
            known[e] = 1
        elif isinstance(e, sympy.Mul):
            known[e] = sum(degrees)
        elif isinstance(e, sympy.Add) or not any(degrees):
            known[e] = max(degrees, default=0)
        else:
            known[e] = math.inf
    return known[e]
