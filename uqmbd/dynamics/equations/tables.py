"""Splines in equations: polynomials in numbers that are looked up, on their way from expressions to kernels.

Within an interval a spline is a cubic in ``o = x - knot``.  Its coefficients and the knot do not change with `x`
there, so to the derivation they are symbols whose derivatives are zero: it neither differentiates nor expands a table.
Where equations are compiled, each such symbol becomes an application ``_table...(which, x, terms)`` of the function
that looks the table up; all that is looked up for one argument shares one search.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import sympy

from uqmbd.mechanism import LOOKED_UP, Spline, SplineTable, polynomial

__all__ = ["Tables"]


class Tables:
    """Turns SymPy expressions into those of SymEngine, and remembers the tables in them."""

    def __init__(self) -> None:
        self.known: dict[str, SplineTable] = {}
        self._symbols: dict[Any, Any] = {}  # of an application of a table
        self._applications: dict[Any, Any] = {}  # of a symbol, without any symbol inside

    def converted(self, expression: sympy.Expr, inserted: Mapping[Any, Any] | None = None) -> Any:
        """Convert a SymPy expression to SymEngine, with symbols for table look-ups and `inserted` ones replaced."""
        import symengine as se

        splines = _outermost(expression)
        local = expression.xreplace({e: sympy.Symbol(f"_spline{k}") for k, e in enumerate(splines)})
        found = {se.Symbol(f"_spline{k}"): self._cubic(e, inserted) for k, e in enumerate(splines)}
        result = se.sympify(local)
        return result.xreplace({**(inserted or {}), **found}) if inserted or found else result

    def _cubic(self, spline: Spline, inserted: Mapping[Any, Any] | None) -> Any:
        x, *terms = (self.converted(e, inserted) for e in (spline.argument, *spline.random_terms))
        knot, *coefficients = (self._symbol(spline.table, which, x, terms) for which in range(LOOKED_UP))
        return polynomial(spline.order, x - knot, *coefficients)

    def _symbol(self, table: SplineTable, which: int, x: Any, terms: list[Any]) -> Any:
        import symengine as se

        self.known[table.name] = table
        return self._standing_for(se.Function(table.name)(se.Integer(which), *self.applied([x, *terms])))

    def _standing_for(self, application: Any) -> Any:
        import symengine as se

        if application not in self._symbols:
            symbol = se.Symbol(f"_k{len(self._symbols)}")
            self._symbols[application] = symbol
            self._applications[symbol] = application
        return self._symbols[application]

    def substituted(self, expression: Any, values: Mapping[Any, Any]) -> Any:
        """Insert values for symbols, into the arguments of tables too."""
        held = [symbol for symbol in expression.free_symbols if symbol in self._applications]
        other = {symbol: self._standing_for(self._applications[symbol].subs(values)) for symbol in held}
        return expression.subs({**values, **other})

    def applied(self, expressions: Sequence[Any]) -> list[Any]:
        """Replace symbols by applications of tables; the results must not be differentiated."""
        if not self._applications:
            return list(expressions)
        import symengine as se

        return list(se.Function("_all")(*expressions).xreplace(self._applications).args) if expressions else []


def _outermost(expression: sympy.Expr) -> list[Spline]:
    """Find the splines that are in no other one, in a fixed order."""
    found: dict[Spline, None] = {}
    seen: set[Any] = set()
    waiting: list[Any] = [expression]
    while waiting:
        part = waiting.pop()
        if part in seen:
            continue
        seen.add(part)
        if isinstance(part, Spline):
            found[part] = None
        else:
            waiting += part.args
    return list(found)
