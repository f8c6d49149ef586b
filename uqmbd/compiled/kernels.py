"""Make kernels from expressions, and from operations of an elimination."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from uqmbd.compiled.emission import NotCompiled, Operation, expressions_text, operations_text
from uqmbd.compiled.kernel import Kernel, compiled
from uqmbd.compiled.native import host
from uqmbd.compiled.tables import Tables
from uqmbd.errors import StudyError
from uqmbd.typing import Array

__all__ = ["compilations", "compile_kernel", "compile_operations", "replaced"]


LIBRARY = 150
"""Cost of a function of the C library, in operations; the function is called for each of eight realisations. Measured:
sines take 60 to 100 ns, sums and products 0.3 to 0.7 ns."""

compilations = [0]
"""Number of kernels compiled by this process, for tests and provenance."""


def compile_kernel(arguments: Sequence[Any], expressions: Sequence[Any], *, tables: Tables | None = None) -> Kernel:
    """Compile SymEngine expressions in SymEngine symbols; raise `uqmbd.StudyError` if one cannot be computed.

    Derivatives of SymEngine may contain sums with terms that are not collected. The search for common subexpressions
    loses terms of such sums. Expressions are therefore rebuilt first, and the kernel is compared with a plain
    evaluation. The form of a table lookup in an expression is ``name(row, argument, *terms)``.
    """
    import symengine as se

    if not expressions:
        return Kernel(b"", "", len(arguments), 0)
    symbols = list(arguments)
    rebuilt = list(replaced(expressions, {se.Symbol("_nothing"): se.Symbol("_nowhere")}))
    known = tables or {}
    replacements, reduced = se.cse(rebuilt)
    kernel = _compiled(symbols, replacements, reduced, known)
    point = np.random.default_rng(0).uniform(0.1, 0.9, len(symbols))
    expected = _substituted_values(expressions, dict(zip(symbols, point, strict=True)), known)
    if expected is None or not np.allclose(kernel(point), expected, rtol=1e-9, atol=1e-12, equal_nan=True):
        kernel = _compiled(symbols, [], rebuilt, known)
    return kernel


def _compiled(
    symbols: Sequence[Any], replacements: Sequence[tuple[Any, Any]], expressions: Sequence[Any], tables: Tables
) -> Kernel:
    def text(name: str) -> str:
        return expressions_text(name, symbols, replacements, expressions, host().width, tables)

    try:
        return _kernel(text, len(symbols), len(expressions))
    except NotCompiled as error:
        raise StudyError(f"An expression contains {error}.") from None


def compile_operations(
    operations: Sequence[Operation], reads: Sequence[int], writes: Sequence[int], first: int
) -> Kernel:
    """Compile operations of an elimination; each computes one value, and `first` is the index of the first.

    The numbers of the arguments and of the results are `reads` and `writes`, in order.
    """
    if not writes:
        return Kernel(b"", "", len(reads), 0)
    return _kernel(
        lambda name: operations_text(name, operations, reads, writes, first, host().width), len(reads), len(writes)
    )


def _kernel(text: Any, inputs: int, outputs: int) -> Kernel:
    """Compile the text of a function; its name is the digest of the text."""
    compilations[0] += 1
    source = text("KERNEL")
    name, code = compiled(source)
    operations = source.count(" = f") + LIBRARY * source.count("@lanes.")
    return Kernel(code, name, inputs, outputs, host().needs, operations, zlib.compress(source.encode()))


def replaced(expressions: Sequence[Any], known: dict[Any, Any]) -> Sequence[Any]:
    """Replace symbols in SymEngine expressions simultaneously, so that common subexpressions remain shared."""
    import symengine as se

    found: Sequence[Any] = se.Function("_all")(*expressions).xreplace(known).args if expressions else ()
    return found


def _substituted_values(expressions: Sequence[Any], point: dict[Any, float], tables: Tables) -> Array | None:
    """Evaluate expressions by substitution of numbers, once for common subexpressions; NaN if this fails.

    Return None if a substitution is impossible, such as a complex number in a comparison.
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
        while tables and (found := _evaluate_lookups(inserted, tables)):
            inserted = replaced(inserted, found)
    except RuntimeError:
        return None
    return np.array([number(e) for e in inserted])


def _evaluate_lookups(expressions: Sequence[Any], tables: Tables) -> dict[Any, Any]:
    """Evaluate table lookups with numeric arguments."""
    import symengine as se

    kind = type(se.Function("_any")(se.Symbol("_any")))
    found = {}
    for e in se.Function("_all")(*expressions).atoms(kind):
        if e.get_name() in tables and all(x.is_Number for x in e.args):
            which, x, *terms = map(float, e.args)
            numbers = tables[e.get_name()].look_up(np.array([x]), np.array([terms]) if terms else None)[0]
            found[e] = se.RealDouble(numbers[int(which)])
    return found
