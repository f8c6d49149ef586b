"""Conversion of user values to numbers: scalars, sequences, arrays, matrices, expressions in random variables."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
import sympy

from uqmbd.arguments import Bounds, typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions.computable import UNEVALUATED, describe_foreign_part, foreign_part
from uqmbd.randomness import RandomVariable
from uqmbd.units import is_quantity

__all__ = [
    "LARGEST",
    "as_symbolic",
    "flatten",
    "numbers",
    "random_variables",
    "shown",
    "too_large",
    "unevaluated_process",
    "unknown_symbol",
]


LARGEST = 1e100
"""Largest number for 64-bit arithmetic: energies are products of three such numbers."""


MANY = 10_000
"""Largest size of an array in an expression or a message."""


def as_symbolic(value: Any) -> Any:
    """Convert a number to SymPy, or return a SymPy object unchanged; raise `uqmbd.StudyError` for texts and containers.

    Convert every user value by this function before SymPy receives it: `sympy.sympify` executes texts as Python code,
    including texts inside tuples, sets and dicts, and also with ``strict=True``.
    """
    if isinstance(value, (sympy.Basic, sympy.MatrixBase)):
        return value
    if isinstance(value, np.ndarray) and value.ndim == 0 and not np.ma.is_masked(value):
        value = value.item()
    if isinstance(value, (str, bytes, type)) or value is None or hasattr(value, "__iter__"):
        raise StudyError(f"{shown(value)} is not a number or an expression.")
    try:
        return sympy.sympify(value, strict=True)
    except (sympy.SympifyError, TypeError, ValueError):
        raise StudyError(f"{shown(value)} is not a number or an expression.") from None


def flatten(value: Any) -> list[Any]:
    """Return the entries of a scalar, a sequence, an array or a matrix, as a list.

    >>> flatten([1, (2, sympy.Matrix([3, 4]))])
    [1, 2, 3, 4]
    """
    if isinstance(value, np.ndarray) and value.size > MANY:
        raise StudyError(f"an array of the shape {value.shape} is given; expected at most {MANY} numbers.")
    parts = _parts(value)
    return [value] if parts is None else [leaf for part in parts for leaf in flatten(part)]


@typechecked
def numbers(
    where: str,
    key: str,
    value: Any,
    size: Annotated[int, Bounds(0, 1_000_000)],
    hint: str = "",
    *,
    scalar: bool = False,
) -> list[sympy.Expr]:
    """Convert numbers or expressions of a user to SymPy, after a check.

    Use this function instead of ``sympy.sympify``, which executes texts as Python code.

    Parameters
    ----------
    where : str
        Beginning of messages.
    key : str
        Name of the value in messages.
    value : number, expression, or sequence, array or matrix of these
        Value from the user.
    size : int
        Required number of entries.
    hint : str
        Explanation of the value for messages, such as its units.
    scalar : bool
        Whether a sequence of one number is an error. Otherwise it is a vector of a one-dimensional space.

    Returns
    -------
    list of sympy.Expr
        Numbers that are real and finite, and expressions that may be real.

    Raises
    ------
    uqmbd.StudyError
        If the value is missing, is not a number, is not real, is not finite, or has another size.

    Examples
    --------
    >>> import uqmbd
    >>> uqmbd.extend.numbers("body 'rod'", "position", (1, 0.5), 2)
    [1, 0.500000000000000]
    >>> uqmbd.extend.numbers("body 'rod'", "mass", "2", 1, "kg")
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: body 'rod': mass is the text '2'; expected a number (kg).
    """
    expected = f"expected {'a number' if size == 1 else f'{size} numbers'}{f' ({hint})' if hint else ''}"
    if value is None:
        raise StudyError(f"{where}: {key} is missing; {expected}.")
    if isinstance(value, np.ndarray) and value.size > max(MANY, size):  # a list of so many entries may exceed memory
        raise StudyError(f"{where}: {key} is an array of the shape {value.shape}; {expected}.")
    parts = _row(value)
    if parts is None:
        flat = "" if size == 1 else " in a flat sequence"
        raise StudyError(f"{where}: {key} is {shown(value)}, which is nested; {expected}{flat}.")
    if len(parts) != size and not any(isinstance(x, (str, bytes)) for x in parts):
        count = f"{len(parts)} number{'s' * (len(parts) != 1)}"
        raise StudyError(f"{where}: {key} has {count}, expected {size}{f' ({hint})' if hint else ''}; it is {value!r}.")
    if scalar and (isinstance(value, (list, tuple, range)) or (isinstance(value, np.ndarray) and value.ndim)):
        raise StudyError(f"{where}: {key} is {shown(value)}, which is a sequence; {expected} without brackets.")
    return [_number(f"{where}: {key}", x, value, expected) for x in parts]


def random_variables(value: Any) -> set[RandomVariable]:
    """Return the random variables that occur in a value.

    >>> random_variables((1, None, "text"))
    set()
    """
    symbols = {s for part in flatten(value) if isinstance(part, sympy.Basic) for s in part.free_symbols}
    return {s for s in symbols if isinstance(s, RandomVariable)}


def shown(value: object) -> str:
    """Return a value as text for a message: at most 80 characters, with its kind if it is a text or a class.

    >>> shown("0.3"), shown(dict), shown(2)
    ("the text '0.3'", 'the class dict', '2')
    """
    if isinstance(value, str):
        return f"the text {value!r}"
    if isinstance(value, type):
        return f"the class {value.__name__}"
    if (process := unevaluated_process(value)) is not None:
        return process
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def unevaluated_process(value: object) -> str | None:
    """Return a description of a source of excitations without its argument; None for other values.

    >>> unevaluated_process(2) is None
    True
    """
    if isinstance(value, type) or not callable(getattr(value, "sample_paths", None)):
        return None
    name = str(getattr(value, "name", "process"))
    argument = "20 * uqmbd.t" if getattr(value, "over", "time") == "distance" else "uqmbd.t"
    call = f"{name}({argument})" if callable(value) else f"uqmbd.extend.excitation({name}, {argument})"
    return f"the random process {name!r} without its argument (write {call})"


def unknown_symbol(symbol: sympy.Symbol) -> str:
    """Return the end of a message about a symbol without a meaning.

    >>> unknown_symbol(sympy.Symbol("k"))
    'the symbol k, which is neither a random variable (uqmbd.RandomVariable), nor time (uqmbd.t), nor a ...'
    """
    hint = " This is a different symbol with the name t: time is uqmbd.t." if str(symbol) == "t" else ""
    return (
        f"the symbol {symbol}, which is neither a random variable (uqmbd.RandomVariable), nor time (uqmbd.t), nor a "
        f"quantity of a body or component.{hint}"
    )


def _number(where: str, entry: Any, value: Any, expected: str) -> sympy.Expr:

    def refused(why: str) -> StudyError:
        # format the text only on errors, because the formatting of a long expression is slow
        given = shown(entry) if entry is value else f"{shown(value)}, which contains {shown(entry)}"
        return StudyError(f"{where} is {given}{why}")

    if is_quantity(entry):
        raise refused(", but uqmbd does not read units of quantities. Give a number, e.g. quantity.m_as('m').")
    # SymPy would parse a text as a formula and convert its words to symbols, so texts are errors
    if isinstance(entry, (str, bytes, bool, type)) or entry is None:
        raise refused(f"; {expected}.")
    try:
        number = as_symbolic(entry)
    except StudyError:
        raise refused(f", which is not a number or an expression; {expected}.") from None
    if not isinstance(number, sympy.Expr) or number.is_commutative is False:
        raise refused(f", which is a {type(number).__name__}; {expected}.")
    if number.has(sympy.nan, sympy.zoo) or (number.has(sympy.oo, -sympy.oo) and not number.atoms(*UNEVALUATED)):
        raise refused(f", which is not finite; {expected}.")
    if (foreign := foreign_part(number)) is not None:
        # a constant, such as a definite integral, still has a value
        found = None if number.free_symbols else _evaluated(number)
        if found is None:
            raise refused(f": {describe_foreign_part(foreign)}")
        number = found
    if number.has(sympy.I) or (number.is_number and not number.is_real):
        raise refused(f", which is not real; {expected}.")
    if number.is_number and abs(_float(number)) > LARGEST:
        raise refused(
            f", which is too large: its square exceeds the range of 64-bit numbers; {expected}, at most {LARGEST:g}."
        )
    if (large := too_large(number)) is not None:
        raise refused(f", which contains {shown(large)}; this number exceeds the range of 64-bit numbers; {expected}.")
    return number


def too_large(expression: sympy.Expr) -> sympy.Expr | None:
    """Return a number in an expression that exceeds the range of 64-bit floats; None if there is none.

    Numerical factors of exponentials may be of any size.

    >>> x = sympy.Symbol("x")
    >>> too_large(x + 10**400) is None, too_large(x + 1), too_large(10**400 * sympy.exp(-x))
    (False, None, None)
    """
    products = [x for x in expression.atoms(sympy.Mul) if any(isinstance(factor, sympy.exp) for factor in x.args)]
    # a numerical factor of an exponential becomes a part of the exponent before the evaluation
    scales = {factor for product in products for factor in product.args if factor.is_Number}
    numbers = expression.atoms(sympy.Number) - scales
    return next((x for x in numbers if x.is_finite and math.isinf(_float(x))), None)


def _evaluated(constant: sympy.Expr) -> sympy.Expr | None:
    """Return the value of an unevaluated constant; None if it is not finite."""
    try:
        value = constant.doit().evalf()
    except Exception:  # noqa: BLE001 - SymPy raises many types of errors for constants without a value
        return None
    return value if isinstance(value, sympy.Number) and value.is_finite else None


def _float(number: sympy.Expr) -> float:
    try:
        return float(number)
    except (OverflowError, TypeError):
        return math.inf


def _parts(value: Any) -> list[Any] | None:
    """Return the entries of a sequence, an array or a matrix; None for other objects."""
    if isinstance(value, (tuple, list, sympy.MatrixBase, sympy.Tuple)):
        return list(value)
    if value is None or isinstance(value, (int, float, str, bytes, sympy.Basic)) or is_quantity(value):
        return None
    if hasattr(value, "tolist"):
        value = value.tolist()
        return value if isinstance(value, list) else None  # a NumPy scalar is a number
    return list(value) if isinstance(value, Sequence) else None


def _row(value: Any) -> list[Any] | None:
    """Return the entries of a scalar, a row or a column; None for other nested sequences."""
    parts = _parts(value)
    if parts is None:
        return [value]
    nested = [_parts(part) for part in parts]
    inner = [part for part in nested if part is not None]
    if not inner:
        return parts
    if len(inner) < len(parts) or any(_parts(x) is not None for part in inner for x in part):
        return None
    if len(inner) == 1 or all(len(part) == 1 for part in inner):
        return [x for part in inner for x in part]
    return None
