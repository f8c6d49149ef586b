"""Write LLVM IR of straight-line functions as text, from SymEngine expressions or operations of an elimination.

A function is ``void name(ptr x, ptr y)``. A row of its arguments and results is ``<8 x double>``, with one number for
each of eight independent realisations.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from typing import Any

from uqmbd.compiled.tables import Tables
from uqmbd.compiled.writer import FunctionWriter, Masks

__all__ = ["NotCompiled", "Operation", "expressions_text", "operations_text"]

POWERS = 16
"""Largest power that is computed by multiplications; for larger powers, the library function is more accurate."""

Operation = tuple[str, int, int, int]
"""Operation on values by number: ``inverse`` 1 / a, ``product`` a b, ``sum`` a + b, ``difference`` a - b c (a < 0:
- b c), or ``zero``."""


class NotCompiled(ValueError):
    """An expression contains a function that cannot be computed with real numbers."""


_LIBRARY = {
    "sin": "sin", "cos": "cos", "tan": "tan", "asin": "asin", "acos": "acos", "atan": "atan",
    "sinh": "sinh", "cosh": "cosh", "tanh": "tanh", "asinh": "asinh", "acosh": "acosh", "atanh": "atanh",
    "log": "log", "erf": "erf", "erfc": "erfc", "gamma": "tgamma", "loggamma": "lgamma", "atan2": "atan2",
}  # fmt: skip
"""Functions of SymEngine that are in the C library."""

_RECIPROCAL = {"sec": "cos", "csc": "sin", "cot": "tan", "sech": "cosh", "csch": "sinh", "coth": "tanh"}
"""Functions with a reciprocal in the C library."""

_OF_RECIPROCAL = {"asec": "acos", "acsc": "asin", "acot": "atan", "acoth": "atanh"}
"""Functions whose value is that of a function of the C library at the reciprocal argument."""

_INTRINSIC = {"Abs": "fabs", "floor": "floor", "ceiling": "ceil"}

_COMPARISON = {"LessThan": "ole", "StrictLessThan": "olt", "Equality": "oeq", "Unequality": "une"}

_OPPOSITE = {"LessThan": "ogt", "StrictLessThan": "oge", "Equality": "one", "Unequality": "oeq"}
"""Opposite of each comparison; both are false if one side is not a real number."""

_PARTIAL = {"asin", "acos", "acosh", "atanh", "asec", "acsc", "acoth", "log", "gamma"}
"""Functions, in addition to powers, that are not real everywhere."""

_CONNECTIVE = {"And": "and", "Or": "or", "Xor": "xor"}


def operations_text(
    name: str, operations: Sequence[Operation], reads: Sequence[int], writes: Sequence[int], first: int, native: int
) -> str:
    """Return the LLVM IR of a function that performs the operations of an elimination.

    Each operation makes one value; their numbers begin at `first`. `reads` and `writes` are the numbers of the
    arguments and results in order. `native` is the number of lanes that the processor computes at once.
    """
    w = FunctionWriter()
    values = {x: k for k, x in enumerate(reads)}
    names: dict[int, str] = {}

    def value(x: int) -> str:
        if x not in names:
            names[x] = w.load(values[x])
        return names[x]

    for k, (kind, a, b, c) in enumerate(operations):
        if kind == "inverse":
            made = w.divide(w.number(1.0), value(a))
        elif kind == "product":
            made = w.multiply(value(a), value(b))
        elif kind == "sum":
            made = w.add(value(a), value(b))
        elif kind == "zero":
            made = w.number(0.0)
        elif a < 0:
            made = w.negate(w.multiply(value(b), value(c)))
        else:
            made = w.subtract(value(a), w.multiply(value(b), value(c)))
        names[first + k] = made
    for k, x in enumerate(writes):
        w.store(k, value(x))
    return w.text(name, native)


def expressions_text(
    name: str,
    arguments: Sequence[Any],
    replacements: Sequence[tuple[Any, Any]],
    expressions: Sequence[Any],
    native: int,
    tables: Tables,
) -> str:
    """Return the LLVM IR of a function that evaluates SymEngine expressions; raise NotCompiled if one has no code.

    The replacements (symbol, expression) come from `symengine.cse`. `native` is the number of lanes that the processor
    computes at once. The form of a table lookup is ``name(row, argument, *terms)``.
    """
    w = FunctionWriter()
    meaning = dict(replacements)
    rows = {symbol: k for k, symbol in enumerate(arguments)}
    known: dict[Any, str] = {}
    masks = Masks()
    looked: dict[tuple[str, ...], list[str]] = {}

    def look_up(e: Any, values: list[str]) -> str:
        name = e.get_name()
        key = (name, *values)
        if key not in looked:
            looked[key] = w.look_up(name, tables[name], values)
        return looked[key][int(e.args[0])]

    def write(expression: Any) -> str:
        waiting: list[tuple[Any, Sequence[Any] | None]] = [(expression, None)]
        while waiting:
            e, parts = waiting.pop()
            if e in known:
                continue
            if parts is None:
                if e.is_Symbol and e not in meaning:
                    if e not in rows:
                        raise NotCompiled(f"the symbol {e}, which is not an argument")
                    known[e] = w.load(rows[e])
                    continue
                if e.is_Symbol:
                    parts = [meaning[e]]
                else:
                    parts = e.args[1:] if _is_application(e, tables) else _parts(e)
                missing = [x for x in parts if x not in known]
                if missing:
                    waiting.append((e, parts))
                    waiting += [(x, None) for x in reversed(missing)]
                    continue
            values = [known[x] for x in parts]
            if e.is_Symbol:
                (known[e],) = values
            elif _is_application(e, tables):
                known[e] = look_up(e, values)
            else:
                known[e] = _written(w, masks, e, values)
            if known[e] not in masks and (_may_be_unreal(e) or not masks.partial.isdisjoint(values)):
                masks.partial.add(known[e])
        return known[expression]

    # common subexpressions are written at their first use, which keeps values in registers
    for k, e in enumerate(expressions):
        value = write(e)
        w.store(k, w.select(value, w.number(1.0), w.number(0.0)) if value in masks else value)
    return w.text(name, native)


def _is_application(e: Any, tables: Tables) -> bool:
    """Return whether an expression looks up a table."""
    return bool(tables) and type(e).__name__ == "FunctionSymbol" and e.get_name() in tables


def _split_sum(e: Any) -> tuple[list[Any], list[Any]]:
    """Return the added terms and the subtracted terms of a sum."""
    plus, minus = [], []
    for term in e.args:
        factor = term.args[0] if term.is_Mul else term
        if factor.is_Number and _real(factor) < 0:
            minus.append(-term)
        else:
            plus.append(term)
    return plus, minus


def _split_product(e: Any) -> tuple[list[Any], list[Any]]:
    """Return the factors of a product, with numbers last, and its divisors."""
    above, below, numbers = [], [], []
    for factor in e.args:
        if factor.is_Number:
            numbers.append(factor)
        elif factor.is_Pow and factor.args[1].is_Number and _real(factor.args[1]) < 0:
            below.append(1 / factor)
        else:
            above.append(factor)
    return above + numbers, below


def _parts(e: Any) -> list[Any]:
    """Return the subexpressions of an expression."""
    if e.is_Add:
        plus, minus = _split_sum(e)
        return plus + minus
    if e.is_Mul:
        above, below = _split_product(e)
        return above + below
    if e.is_Pow:
        base, exponent = e.args
        if type(base).__name__ == "Exp1":
            return [exponent]
        return [base] if _multiplied(exponent) else [base, exponent]
    return list(e.args) if not _is_constant(e) else []


def _multiplied(exponent: Any) -> bool:
    """Return whether a power is computed by multiplications and a square root."""
    return bool(exponent.is_Number) and (2 * _real(exponent)).is_integer() and abs(_real(exponent)) <= POWERS


def _is_constant(e: Any) -> bool:
    return bool(getattr(e, "is_number", False)) or type(e).__name__ in ("BooleanTrue", "BooleanFalse")


_LIMITS = {"Infinity": float("inf"), "NegativeInfinity": float("-inf"), "NaN": float("nan")}


def _real(e: Any) -> float:
    """Return a SymEngine number as a float."""
    kind = type(e).__name__
    if kind in _LIMITS:
        return _LIMITS[kind]
    try:
        return float(e)
    except (TypeError, ValueError, RuntimeError):
        raise NotCompiled(f"{e}, which is not a real number") from None


def _written(w: FunctionWriter, masks: Masks, e: Any, values: list[str]) -> str:
    """Write an expression whose subexpressions are already written."""
    if values and all(value.startswith("splat (double") for value in values):
        with contextlib.suppress(NotCompiled):  # for example the comparison of numbers
            return w.number(_real(e.n()))
    if e.is_Add:
        plus, minus = _split_sum(e)
        total = values[0] if plus else w.negate(values[0])
        for k, value in enumerate(values[1:], 1):
            total = w.add(total, value) if k < len(plus) else w.subtract(total, value)
        return total
    if e.is_Mul:
        count = len(_split_product(e)[0])
        if count > 1 and values[count - 1] == w.number(-1.0):
            return w.negate(_quotient(w, values[: count - 1], values[count:]))
        return _quotient(w, values[:count], values[count:])
    if e.is_Pow:
        return _power(w, e, values)
    kind = type(e).__name__
    if kind == "BooleanTrue" or kind == "BooleanFalse":
        return masks.noted(f"splat (i1 {'true' if kind == 'BooleanTrue' else 'false'})")
    if _is_constant(e):
        return w.number(_real(e))
    rule = _RULES.get(kind)
    if rule is None:
        raise NotCompiled(f"{e}, and {kind} cannot be computed")
    return rule(w, masks, kind, values)


def _quotient(w: FunctionWriter, above: list[str], below: list[str]) -> str:
    def product(values: list[str]) -> str:
        result = values[0] if values else w.number(1.0)
        for value in values[1:]:
            result = w.multiply(result, value)
        return result

    return w.divide(product(above), product(below)) if below else product(above)


def _power(w: FunctionWriter, e: Any, values: list[str]) -> str:
    base, exponent = e.args
    if type(base).__name__ == "Exp1":
        return w.call("exp", values[0])
    if not _multiplied(exponent):
        return w.call("pow", *values)
    halves = round(2 * abs(_real(exponent)))
    result = w.power(values[0], halves // 2) if halves > 1 else ""
    if halves % 2:
        root = w.intrinsic("sqrt", values[0])
        result = w.multiply(result, root) if result else root
    return w.divide(w.number(1.0), result) if _real(exponent) < 0 else result


def _may_be_unreal(e: Any) -> bool:
    """Return whether a function of real arguments may be undefined or complex."""
    if e.is_Pow:
        base, exponent = e.args
        whole = exponent.is_Number and _real(exponent).is_integer()
        never_negative = (base.is_Number and _real(base) >= 0) or type(base).__name__ == "Exp1"
        return not (whole or never_negative)
    return type(e).__name__ in _PARTIAL


Rule = Callable[[FunctionWriter, Masks, str, list[str]], str]


def _compared(w: FunctionWriter, masks: Masks, kind: str, values: list[str]) -> str:
    a, b = values
    if a in masks or b in masks:  # truth values: the search for common subexpressions writes ``x == True``
        return _same_truth(w, masks, kind, a, b)
    if masks.partial.isdisjoint(values):
        return masks.noted(w.compare(_COMPARISON[kind], a, b))
    holds = "one" if kind == "Unequality" else _COMPARISON[kind]
    return masks.noted(w.compare(holds, a, b), w.compare(_OPPOSITE[kind], a, b))


def _same_truth(w: FunctionWriter, masks: Masks, kind: str, a: str, b: str) -> str:
    """Return the comparison of two truth values."""
    if masks.defined(a, b):
        differ = masks.noted(w.made(f"xor MASK {a}, {b}"))
        return differ if kind == "Unequality" else _not(w, masks, "Not", [differ])
    both, neither = (w.made(f"and MASK {x}, {y}") for x, y in ((a, b), (masks.false(w, a), masks.false(w, b))))
    one, other = (w.made(f"and MASK {x}, {y}") for x, y in ((a, masks.false(w, b)), (masks.false(w, a), b)))
    same, differ = w.made(f"or MASK {both}, {neither}"), w.made(f"or MASK {one}, {other}")
    return masks.noted(differ, same) if kind == "Unequality" else masks.noted(same, differ)


def _connected(w: FunctionWriter, masks: Masks, kind: str, values: list[str]) -> str:
    result = values[0]
    for value in values[1:]:
        if masks.defined(result, value):
            result = masks.noted(w.made(f"{_CONNECTIVE[kind]} MASK {result}, {value}"))
        elif kind == "Xor":
            result = _same_truth(w, masks, "Unequality", result, value)
        else:
            opposite = "or" if kind == "And" else "and"
            false = w.made(f"{opposite} MASK {masks.false(w, result)}, {masks.false(w, value)}")
            result = masks.noted(w.made(f"{_CONNECTIVE[kind]} MASK {result}, {value}"), false)
    return result


def _not(w: FunctionWriter, masks: Masks, kind: str, values: list[str]) -> str:
    (value,) = values
    return masks.noted(masks.false(w, value), None if masks.defined(value) else value)


def _piecewise(w: FunctionWriter, masks: Masks, kind: str, values: list[str]) -> str:
    undefined = w.number(float("nan"))
    result = undefined
    for value, condition in reversed(list(zip(values[::2], values[1::2], strict=True))):
        if not masks.defined(condition):  # a comparison of values that are not real gives NaN
            result = w.select(masks.false(w, condition), result, undefined)
        result = value if condition == "splat (i1 true)" else w.select(condition, value, result)
    return result


def _sign(w: FunctionWriter, masks: Masks, kind: str, values: list[str]) -> str:
    (x,) = values
    zero = w.number(0.0)
    negative = w.select(w.compare("olt", x, zero), w.number(-1.0), x)  # zero and NaN do not change
    return w.select(w.compare("ogt", x, zero), w.number(1.0), negative)


def _extreme(w: FunctionWriter, masks: Masks, kind: str, values: list[str]) -> str:
    result = values[0]
    for value in values[1:]:
        result = w.intrinsic("maximum" if kind == "Max" else "minimum", result, value)
    return result


_RULES: dict[str, Rule] = {
    **dict.fromkeys(_LIBRARY, lambda w, _, kind, values: w.call(_LIBRARY[kind], *values)),
    **dict.fromkeys(_INTRINSIC, lambda w, _, kind, values: w.intrinsic(_INTRINSIC[kind], *values)),
    **dict.fromkeys(
        _RECIPROCAL, lambda w, _, kind, values: w.divide(w.number(1.0), w.call(_RECIPROCAL[kind], *values))
    ),
    **dict.fromkeys(
        _OF_RECIPROCAL, lambda w, _, kind, values: w.call(_OF_RECIPROCAL[kind], w.divide(w.number(1.0), values[0]))
    ),
    **dict.fromkeys(_COMPARISON, _compared),
    **dict.fromkeys(_CONNECTIVE, _connected),
    "Not": _not,
    "Piecewise": _piecewise,
    "sign": _sign,
    "Max": _extreme,
    "Min": _extreme,
    "UnevaluatedExpr": lambda w, _, kind, values: values[0],
}
"""Rule of code generation for each function, by the name of its class in SymEngine."""
