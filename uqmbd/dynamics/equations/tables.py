"""Splines in equations: conversion from expressions to kernels, as polynomials with look-up of coefficients.

Within an interval a spline is a cubic in ``o = x - knot``.  In the interval, the coefficients and the knot do not
depend on `x`. In the derivation they are symbols with zero derivatives, so tables are neither differentiated nor
expanded.  The compilation replaces each such symbol by an application ``_table...(which, x, terms)`` of the look-up
function; all look-ups with the same argument share one search.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import sympy

from uqmbd.compiled import PATHS, PathTable
from uqmbd.mechanism import LOOKED_UP, SampledPath, Spline, SplineTable, polynomial

__all__ = ["Tables"]

PATH_NAME = "_path"
"""Name of the look-up function of sampled paths."""


class Tables:
    """Converter from SymPy to SymEngine, with storage of the tables in expressions."""

    def __init__(self) -> None:
        self.known: dict[str, SplineTable | PathTable] = {}
        self._symbols: dict[Any, Any] = {}  # symbol of an application of a table
        self._applications: dict[Any, Any] = {}  # application of a symbol, without symbols inside it

    def converted(self, expression: sympy.Expr, inserted: Mapping[Any, Any] | None = None) -> Any:
        """Convert a SymPy expression to SymEngine, with symbols for table look-ups; replace `inserted` symbols."""
        import symengine as se

        splines = _outermost(expression)
        local = expression.xreplace({e: sympy.Symbol(f"_spline{k}") for k, e in enumerate(splines)})
        found = {se.Symbol(f"_spline{k}"): self._cubic(e, inserted) for k, e in enumerate(splines)}
        result = se.sympify(local)
        return result.xreplace({**(inserted or {}), **found}) if inserted or found else result

    def _cubic(self, spline: Spline | SampledPath, inserted: Mapping[Any, Any] | None) -> Any:
        terms: Sequence[Any]
        if isinstance(spline, SampledPath):
            name, table, terms = PATH_NAME, PATHS, [spline.args[2]]
        else:
            name, table, terms = spline.table.name, spline.table, spline.random_terms
        self.known[name] = table
        x, *terms = (self.converted(e, inserted) for e in (spline.argument, *terms))
        knot, *coefficients = (self._symbol(name, which, x, terms) for which in range(LOOKED_UP))
        return polynomial(spline.order, x - knot, *coefficients)

    def _symbol(self, name: str, which: int, x: Any, terms: list[Any]) -> Any:
        import symengine as se

        return self._standing_for(se.Function(name)(se.Integer(which), *self.applied([x, *terms])))

    def _standing_for(self, application: Any) -> Any:
        import symengine as se

        if application not in self._symbols:
            symbol = se.Symbol(f"_k{len(self._symbols)}")
            self._symbols[application] = symbol
            self._applications[symbol] = application
        return self._symbols[application]

    def substituted(self, expression: Any, values: Mapping[Any, Any]) -> Any:
        """Insert values for symbols, also in the arguments of tables."""
        held = [symbol for symbol in expression.free_symbols if symbol in self._applications]
        other = {symbol: self._standing_for(self._applications[symbol].subs(values)) for symbol in held}
        return expression.subs({**values, **other})

    def applied(self, expressions: Sequence[Any]) -> list[Any]:
        """Replace symbols by applications of tables; the results must not be differentiated."""
        if not self._applications:
            return list(expressions)
        import symengine as se

        return list(se.Function("_all")(*expressions).xreplace(self._applications).args) if expressions else []


def _outermost(expression: sympy.Expr) -> list[Spline | SampledPath]:
    """Return the splines and sampled paths that are not inside another one, in a fixed order."""
    found: dict[Spline | SampledPath, None] = {}
    seen: set[Any] = set()
    waiting: list[Any] = [expression]
    while waiting:
        part = waiting.pop()
        if part in seen:
            continue
        seen.add(part)
        if isinstance(part, (Spline, SampledPath)):
            found[part] = None
        else:
            waiting += part.args
    return list(found)
