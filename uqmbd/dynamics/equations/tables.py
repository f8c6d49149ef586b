"""Splines in equations: polynomials in numbers that are looked up, on their way from expressions to kernels.

Within an interval a spline is a cubic in ``o = x - knot``.  Its coefficients and the knot do not change with `x`
there, so to the derivation they are symbols whose derivatives are zero: it neither differentiates nor expands a table.
Where equations are compiled, each such symbol becomes an application ``_table...(which, x, terms)`` of the function
that looks the table up; all that is looked up for one argument shares one search.  LLVM as SymEngine drives it cannot
read a table from memory, and branches for 3000 knots take it seconds in each of a dozen kernels, so NumPy looks up
between two kernels: that of the arguments, and that of the results.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy

from uqmbd.mechanism import LOOKED_UP, Spline, SplineTable, polynomial
from uqmbd.typing import Array

__all__ = ["Stage", "TabulatedFunction", "Tables", "tabulated"]


class Tables:
    """Turns SymPy expressions into those of SymEngine, and remembers the tables in them."""

    def __init__(self) -> None:
        self.known: dict[str, SplineTable] = {}
        self._symbols: dict[Any, Any] = {}  # of an application of a table
        self._applications: dict[Any, Any] = {}  # of a symbol, without any symbol inside

    def converted(self, expression: sympy.Expr, inserted: Mapping[Any, Any] | None = None) -> Any:
        """Turn an expression into one of SymEngine, in which symbols stand for what is looked up.

        Parameters
        ----------
        expression : SymPy expression
            What to turn.
        inserted : mapping, optional
            What symbols of SymEngine stand for.
        """
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
        """Put applications of tables in the place of symbols; nothing may be differentiated any more."""
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


@dataclass(frozen=True)
class Stage:
    """Tables that are looked up at once.

    Attributes
    ----------
    function : object or None
        Computes all their arguments and terms, from the columns of the work array; None: they are columns themselves.
    inputs : array of int
        Columns, where there is no function.
    tables : tuple of (SplineTable, int, int, int)
        Table; which of these numbers is its argument, and the end of its terms, which follow; first column to write.
    """

    function: Any
    inputs: Any
    outputs: int
    tables: tuple[tuple[SplineTable, int, int, int], ...]

    def write(self, work: Array) -> None:
        """Look up, and write what was found into the columns."""
        if self.function is None:
            arguments = work[:, self.inputs]
        else:
            arguments = np.empty((len(work), self.outputs))
            self.function.unsafe_eval(work.reshape(-1), arguments.reshape(-1), len(work))
        for table, x, end, column in self.tables:
            terms = arguments[:, x + 1 : end] if end > x + 1 else None
            work[:, column : column + LOOKED_UP] = table.look_up(arguments[:, x], terms)


class TabulatedFunction:
    """A compiled function with tables; it is called like those of SymEngine.

    Parameters
    ----------
    inputs, outputs : int
        Numbers of arguments and results.
    width : int
        Columns of the work array: arguments, then what is looked up.
    stages : sequence of Stage
        In order: tables of arguments that were looked up come later.
    results : object
        Compiled function from the columns to the results.
    """

    def __init__(self, inputs: int, outputs: int, width: int, stages: Sequence[Stage], results: Any) -> None:
        self.inputs, self.outputs, self.width = inputs, outputs, width
        self.stages, self.results = tuple(stages), results

    def __call__(self, arguments: Array, out: Array | None = None) -> Array:
        """Evaluate for arguments (..., inputs)."""
        rows = np.ascontiguousarray(arguments, dtype=float).reshape(-1, self.inputs)
        found = np.empty((len(rows), self.outputs))
        self.unsafe_eval(rows, found.reshape(-1), len(rows))
        found = found.reshape(*np.shape(arguments)[:-1], self.outputs)
        if out is None:
            return found
        out[...] = found
        return out

    def unsafe_real(self, arguments: Array, out: Array) -> None:
        """Evaluate one row, without any check."""
        self.unsafe_eval(arguments, out, 1)

    def unsafe_eval(self, arguments: Array, out: Array, count: int) -> None:
        """Evaluate rows one after the other, without any check."""
        work = np.zeros((count, self.width))
        work[:, : self.inputs] = arguments.reshape(count, self.inputs)
        for stage in self.stages:
            stage.write(work)
        self.results.unsafe_eval(work.reshape(-1), out, count)


def tabulated(
    arguments: Sequence[Any],
    expressions: Sequence[Any],
    tables: Mapping[str, SplineTable],
    compiled: Callable[[Sequence[Any], Sequence[Any]], Any],
) -> TabulatedFunction | None:
    """Compile SymEngine expressions with applications of tables; None where there are none.

    Parameters
    ----------
    arguments, expressions : sequence
        In SymEngine.
    tables : mapping
        By the names of the functions that look them up.
    compiled : callable
        Compiles arguments and expressions without any table.
    """
    import symengine as se

    if not tables:
        return None
    kind = type(se.Function("_any")(se.Symbol("_any")))
    everything = se.Function("_all")(*expressions)
    calls = {tuple([e.get_name(), *e.args[1:]]): e for e in everything.atoms(kind) if e.get_name() in tables}
    if not calls:
        return None
    # one search for all that is looked up with one argument
    inner = {
        key: {other for other in calls if any(_inside(calls[other], part, kind) for part in key[1:])} for key in calls
    }
    order: list[list[tuple[Any, ...]]] = []
    done: set[tuple[Any, ...]] = set()
    while len(done) < len(calls):
        ready = sorted((key for key in calls if key not in done and inner[key] <= done), key=str)
        order.append(ready)
        done |= set(ready)
    columns = list(arguments)
    swap: dict[Any, Any] = {}
    plans = []
    for ready in order:
        parts: list[Any] = []
        placed = []
        for key in ready:
            name, *about = key
            placed.append((tables[name], len(parts), len(parts) + len(about), len(columns)))
            parts += [e.xreplace(swap) for e in about]
            columns += [se.Symbol(f"_looked{len(columns) + w}") for w in range(LOOKED_UP)]
        for key, (*_, first) in zip(ready, placed, strict=True):
            name, *about = key
            swap |= {se.Function(name)(se.Integer(w), *about): columns[first + w] for w in range(LOOKED_UP)}
        plans.append((parts, tuple(placed)))
    where = {symbol: k for k, symbol in enumerate(columns)}
    stages = []
    for parts, placed_tables in plans:
        known = all(e in where for e in parts)
        inputs = np.array([where[e] for e in parts], dtype=np.int64) if known else None
        stages.append(Stage(None if known else compiled(columns, parts), inputs, len(parts), placed_tables))
    results = compiled(columns, list(everything.xreplace(swap).args))
    return TabulatedFunction(len(arguments), len(expressions), len(columns), stages, results)


def _inside(application: Any, expression: Any, kind: type) -> bool:
    """Whether a table is looked up, with the same argument, within an expression."""
    about = application.args[1:]
    return any(e.get_name() == application.get_name() and e.args[1:] == about for e in expression.atoms(kind))
