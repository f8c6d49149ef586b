"""Compiled kernels (SymEngine with LLVM)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from uqmbd.dynamics.equations.tables import tabulated
from uqmbd.mechanism import SplineTable
from uqmbd.typing import Array

__all__ = ["Kernel", "compilations", "compile_kernel", "replaced", "unrolled_kernel"]


compilations = [0]
"""Number of kernels compiled by this process, for tests and provenance."""


class Kernel:
    """A compiled vector function that broadcasts over rows.

    Parameters
    ----------
    function : symengine.LLVMDouble or None
        None where there is nothing to compute.
    inputs, outputs : int
        Number of arguments and results.
    """

    def __init__(self, function: Any, inputs: int, outputs: int) -> None:
        self.function = function
        self.inputs = inputs
        self.outputs = outputs

    def __call__(self, arguments: Array, out: Array | None = None) -> Array:
        """Evaluate.

        Parameters
        ----------
        arguments : array, shape (..., inputs)
            C-contiguous.
        out : array, shape (..., outputs), optional
            Where to write.

        Returns
        -------
        array, shape (..., outputs)
        """
        if self.function is None or not arguments.size:
            return np.zeros((*arguments.shape[:-1], self.outputs))
        result: Array = self.function(arguments, out=out) if out is not None else self.function(arguments)
        return result.reshape(*arguments.shape[:-1], self.outputs)

    def fast(self, arguments: Array, out: Array | None = None) -> Array:
        """Evaluate like a call, without any check: both arrays C-contiguous, of two dimensions, and of type float64."""
        if out is None:
            out = np.empty((len(arguments), self.outputs))
        if self.function is None or not arguments.size:
            out[:] = 0.0
        else:
            count = len(arguments)
            if count == 1:
                self.function.unsafe_real(arguments[0], out[0])
            else:
                self.function.unsafe_eval(arguments.reshape(-1), out.reshape(-1), count)
        return out


def compile_kernel(
    arguments: Sequence[Any],
    expressions: Sequence[Any],
    *,
    tables: Mapping[str, SplineTable] | None = None,
    opt_level: int = 0,
) -> Kernel:
    """Compile SymEngine expressions in SymEngine symbols.

    Parameters
    ----------
    arguments, expressions : sequence
        In SymEngine.
    tables : mapping, optional
        Those that are looked up in the expressions, by the names of the functions that do so.
    opt_level : int
        Of LLVM.
    """
    if not expressions:
        return Kernel(None, len(arguments), 0)
    import symengine as se

    # LLVM wants at least one argument
    symbols = list(arguments) or [se.Symbol("_none")]

    def compiled(symbols: Sequence[Any], expressions: Sequence[Any]) -> Any:
        return _compiled(symbols, expressions, opt_level)

    function = tabulated(symbols, expressions, tables or {}, compiled) or compiled(symbols, expressions)
    return Kernel(function, len(symbols), len(expressions))


def _compiled(symbols: Sequence[Any], expressions: Sequence[Any], opt_level: int) -> Any:
    """Compile expressions.

    SymEngine's derivatives may hold sums with terms that are not collected, from which its search for common
    subexpressions loses terms.  So expressions are rebuilt first, and the kernel is compared with a plain evaluation.
    """
    import symengine as se

    compilations[0] += 1
    nothing = {se.Symbol("_nothing"): se.Symbol("_nowhere")}
    rebuilt = replaced(expressions, nothing)
    function = se.Lambdify(symbols, rebuilt, backend="llvm", cse=True, opt_level=opt_level)
    point = np.random.default_rng(0).uniform(0.1, 0.9, len(symbols))
    expected = _plainly(expressions, dict(zip(symbols, point, strict=True)))
    with np.errstate(all="ignore"):
        same = expected is not None and np.allclose(function(point), expected, rtol=1e-9, atol=1e-12, equal_nan=True)
    if not same:
        function = se.Lambdify(symbols, rebuilt, backend="llvm", cse=False, opt_level=opt_level)
    return function


def replaced(expressions: Sequence[Any], known: dict[Any, Any]) -> Sequence[Any]:
    """Replace symbols in SymEngine expressions; all at once, so that the parts that they share stay shared."""
    import symengine as se

    found: Sequence[Any] = se.Function("_all")(*expressions).xreplace(known).args if expressions else ()
    return found


def _plainly(expressions: Sequence[Any], point: dict[Any, float]) -> Array | None:
    """Evaluate expressions by inserting numbers, which treats a part that they share once; NaN where that fails.

    None where nothing can be inserted, as a complex number into a comparison.
    """
    import symengine as se

    values = {symbol: se.RealDouble(x) for symbol, x in point.items()}

    def number(e: Any) -> float:
        try:
            return float(e.n())
        except (RuntimeError, TypeError, ValueError):
            return float("nan")

    try:
        inserted = replaced(expressions, values)
    except RuntimeError:
        return None
    return np.array([number(e) for e in inserted])


def unrolled_kernel(arguments: Sequence[Any], expressions: Sequence[Any]) -> Kernel:
    """Compile expressions that share nearly all their parts, as the steps of an elimination do.

    They are compiled as they stand: rebuilding or evaluating them one by one would visit shared parts again and again.
    """
    import symengine as se

    compilations[0] += 1
    function = se.Lambdify(list(arguments), list(expressions), backend="llvm", cse=True, opt_level=2)
    return Kernel(function, len(arguments), len(expressions))
