"""How fast an expression of time changes at most, by its symbols alone.

Entire functions of exponential type s are, between points that are closer than 1/s, what their polynomials are: sines
and exponentials of a linear argument, polynomials of a low degree, and sums and products of these.
"""

from __future__ import annotations

import sympy

from uqmbd.mechanism import t

__all__ = ["exponential_types"]


DEGREE = 16
"""Degree of the polynomials in time, at most: those of a high degree have narrow peaks, as ``(t * (1 - t))**10000``."""

MANY = 64
"""Terms, at most."""


def exponential_types(expression: sympy.Expr) -> tuple[sympy.Expr, ...] | None:
    """Return numbers, the largest of which is the exponential type of an expression of time, rad/s; None: unknown."""
    found = _growth(expression)
    return None if found is None or found[1] > DEGREE else tuple(found[0])


def _growth(e: sympy.Expr) -> tuple[list[sympy.Expr], sympy.Expr] | None:
    """Return exponential types of the terms of an expression, and its degree as a polynomial in time."""
    if not e.has(t):
        return [sympy.S.Zero], sympy.S.Zero
    if e == t:
        return [sympy.S.Zero], sympy.S.One
    if isinstance(e, sympy.sin | sympy.cos | sympy.sinh | sympy.cosh | sympy.exp):
        rate = sympy.diff(e.args[0], t)
        return None if rate.has(t) else ([sympy.Abs(rate)], sympy.S.Zero)
    if isinstance(e, sympy.Pow):
        base, exponent = _growth(e.args[0]), e.args[1]
        if base is None or not (exponent.is_Integer and exponent.is_positive):
            return None
        return [exponent * one for one in base[0]], exponent * base[1]
    if not isinstance(e, sympy.Add | sympy.Mul):
        return None
    types, degree = [sympy.S.Zero], sympy.S.Zero
    for part in e.args:
        found = _growth(part)
        if found is None:
            return None
        if isinstance(e, sympy.Add):
            types, degree = [*types, *found[0]], max(degree, found[1])
        else:
            types, degree = [a + b for a in types for b in found[0]], degree + found[1]
        types = list(dict.fromkeys(types))
        if len(types) > MANY:
            return None
    return types, degree
