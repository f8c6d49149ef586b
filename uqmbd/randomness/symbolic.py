"""Messages for symbols of uqmbd that are used as numbers of Python or NumPy; each message states the replacement.

SymPy's messages on conditions, comparisons with NaN, and conversions to numbers describe SymPy objects, not quantities
of uqmbd. SymPy has no hook for these messages. This module replaces the methods, only for expressions with symbols of
uqmbd. SymPy catches its own TypeError and ValueError, so the errors also have these classes.
"""

from __future__ import annotations

import functools
import math
import numbers
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, NoReturn

from uqmbd.errors import StudyError
from uqmbd.wording import format_count

if TYPE_CHECKING:
    import sympy

MYPY = False
"""True for mypy only."""

__all__ = ["Symbol", "Symbolic"]

if MYPY:

    class Symbol:
        """Types for mypy, which would treat a subclass of a SymPy class as Any, and ``2 * length`` as int."""

        name: str

        def __getattr__(self, name: str) -> Any: ...
        def _hashable_content(self) -> tuple[Any, ...]: ...
        def _eval_derivative_n_times(self, s: sympy.Symbol, n: Any) -> sympy.Expr: ...
        def __float__(self) -> float: ...
        def __add__(self, other: Any) -> sympy.Expr: ...
        def __radd__(self, other: Any) -> sympy.Expr: ...
        def __sub__(self, other: Any) -> sympy.Expr: ...
        def __rsub__(self, other: Any) -> sympy.Expr: ...
        def __mul__(self, other: Any) -> sympy.Expr: ...
        def __rmul__(self, other: Any) -> sympy.Expr: ...
        def __truediv__(self, other: Any) -> sympy.Expr: ...
        def __rtruediv__(self, other: Any) -> sympy.Expr: ...
        def __pow__(self, other: Any) -> sympy.Expr: ...
        def __rpow__(self, other: Any) -> sympy.Expr: ...
        def __mod__(self, other: Any) -> sympy.Expr: ...
        def __rmod__(self, other: Any) -> sympy.Expr: ...
        def __neg__(self) -> sympy.Expr: ...
        def __pos__(self) -> sympy.Expr: ...
        def __abs__(self) -> sympy.Expr: ...
        def __lt__(self, other: Any) -> sympy.Rel: ...
        def __le__(self, other: Any) -> sympy.Rel: ...
        def __gt__(self, other: Any) -> sympy.Rel: ...
        def __ge__(self, other: Any) -> sympy.Rel: ...

else:
    from sympy import Symbol

_WRITTEN = {
    **{name: name for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "cbrt")},
    **{f"arc{name}": f"a{name}" for name in ("sin", "cos", "tan", "tan2", "sinh", "cosh", "tanh")},
    "exp2": "2**x", "expm1": "exp(x) - 1", "log2": "log(x, 2)", "log10": "log(x, 10)", "log1p": "log(1 + x)",
    "fabs": "Abs", "hypot": "sqrt(x**2 + y**2)", "deg2rad": "x * sympy.pi / 180", "radians": "x * sympy.pi / 180",
    "rad2deg": "x * 180 / sympy.pi", "degrees": "x * 180 / sympy.pi", "rint": "floor(x + 1/2)",
}  # fmt: skip
"""Functions of NumPy and the equivalent functions or expressions of SymPy."""


def _refusal(name: str, written: str) -> Callable[..., NoReturn]:
    write = f"sympy.{written}" if written.isidentifier() else f"{written}, with functions of SymPy"

    def refuse(self: Any, *others: Any) -> NoReturn:
        raise StudyError(
            f"numpy.{name}: the argument is the quantity {self}, but NumPy functions accept numbers "
            f"only. Write {write}."
        )

    return refuse


class Symbolic:
    """Base class of symbols: NumPy calls the method with the name of a function, which raises an error with advice."""

    __slots__ = ()

    units = ""
    """Units of the symbol; empty if unknown."""


for _name, _function in _WRITTEN.items():
    setattr(Symbolic, _name, _refusal(_name, _function))


class UndecidedError(StudyError, TypeError):
    """A relation between quantities was used as a condition of Python."""


class UnrealComparisonError(StudyError, TypeError, ValueError):
    """A quantity was compared with a value that is not real."""


class VectorComparisonError(StudyError, TypeError):
    """A vector or matrix of quantities was compared as a whole."""


class SymbolicNumberError(StudyError, TypeError):
    """An expression with quantities was converted to a number of Python."""


def _quantities(*values: Any) -> list[Symbolic]:
    """Return the quantities of uqmbd in some expressions."""
    return [x for value in values for x in getattr(value, "free_symbols", ()) if isinstance(x, Symbolic)]


def _short(value: Any) -> str:
    """Return a value as text of at most 80 characters."""
    text = str(value)
    return text if len(text) <= 80 else text[:77] + "..."


def _refuse_truth(plain: Callable[[Any], bool]) -> Callable[[Any], bool]:
    @functools.wraps(plain)
    def truth(self: Any) -> bool:
        if not _quantities(self):
            return plain(self)
        left, right = self.args[:2]
        raise UndecidedError(
            f"{self} has no truth value, because it differs between realisations or times. Write a comparison with two "
            "limits, such as 1 <= x <= 2, as two requirements: 1 <= x, and x <= 2. Write sympy.Piecewise((a, "
            f"{self}), (b, True)) for a value that is a where the relation is true, and b elsewhere. Write "
            "sympy.Max, sympy.Min, sympy.And and sympy.Or instead of max, min, and, or. To choose by the means, "
            f"write uqmbd.nominal({left - right}) {self.rel_op} 0."
        )

    return truth


def _unreal(called: str, values: Iterable[Any]) -> UnrealComparisonError | None:
    """Return the error for a comparison of some values; None if all are real, or none is a quantity."""
    given = list(values)
    wrong = [x for x in given if _is_nan(x) or getattr(x, "is_extended_real", None) is False or isinstance(x, complex)]
    if not wrong or not _quantities(*given):
        return None
    return UnrealComparisonError(
        f"{called} is undefined, because {_short(wrong[0])} is "
        f"{'not a number' if _is_nan(wrong[0]) else 'not real'}. Compare with a real number, or with "
        "sympy.oo for no limit."
    )


def _is_nan(value: Any) -> bool:
    import sympy

    return value is sympy.nan or (isinstance(value, numbers.Real) and math.isnan(value))


def _of_vector(sign: str, left: Any, right: Any) -> VectorComparisonError | None:
    """Return the error for a comparison of a vector; None if both sides are scalars, or neither has quantities."""
    from sympy.matrices.matrixbase import MatrixBase

    wrong = next((x for x in (left, right) if isinstance(x, MatrixBase)), None)
    if wrong is None or not _quantities(left, right):
        return None
    side = "left" if wrong is left else "right"
    rows, columns = wrong.shape
    size = (
        f"a vector ({format_count(rows, 'entry', 'entries')})"
        if columns == 1
        else f"a matrix ({rows} by {columns} entries)"
    )
    entries = [_short(x) for x in wrong[:3]] + (["..."] if len(wrong) > 3 else [])
    example = (wrong[0], right) if wrong is left else (left, wrong[0])
    entry, other = (_short(x[0] if isinstance(x, MatrixBase) else x) for x in example)
    return VectorComparisonError(
        f"The {side} side of {sign} is {size}: {', '.join(entries)}; expected a scalar. Compare an entry, such as the "
        f"first one, {entry} {sign} {other}, or the length of the vector, vector.norm(). Each entry needs a separate "
        "requirement."
    )


def _refuse_vector(sign: str) -> Callable[[Any, Any], Any]:
    def compare(self: Any, other: Any) -> Any:
        if error := _of_vector(sign, self, other):
            raise error
        return NotImplemented

    return compare


def _refuse_unreal_relation(plain: Callable[..., Any]) -> Any:
    @functools.wraps(plain)
    def make(cls: Any, left: Any, right: Any, **options: Any) -> Any:
        try:
            return plain(cls, left, right, **options)
        except TypeError as error:
            vector = _of_vector(cls.rel_op, left, right)
            raise vector or _unreal(f"{_short(left)} {cls.rel_op} {_short(right)}", (left, right)) or error from None

    return staticmethod(make)


def _refuse_unreal_extreme(plain: Callable[..., Any]) -> Any:
    @functools.wraps(plain)
    def make(cls: Any, *values: Any, **options: Any) -> Any:
        try:
            return plain(cls, *values, **options)
        except ValueError as error:
            called = f"sympy.{cls.__name__}({', '.join(map(_short, values))})"
            raise _unreal(called, values) or error from None

    return staticmethod(make)


_CONVERSIONS = {
    "__float__": (
        "float, or a function of math,",
        " In an expression, write functions of SymPy: sympy.sin for math.sin.",
    ),
    "__int__": ("int", " In an expression, write sympy.floor."),
    "__complex__": ("complex", ""),
    "__round__": ("round", " In an expression, write sympy.floor(x + 1/2)."),
    "__trunc__": ("math.trunc", " In an expression, write sympy.floor."),
    "__format__": ("", " To print the expression as text, omit the format."),
}
"""Methods of expressions that need a number, with their names in messages and advice for expressions."""


def _refuse_conversion(name: str, plain: Callable[..., Any]) -> Callable[..., Any]:
    called, advice = _CONVERSIONS[name]

    @functools.wraps(plain)
    def convert(self: Any, *options: Any) -> Any:
        try:
            return plain(self, *options)
        except TypeError:
            found = _quantities(self)
            if not found:
                raise
            requested = f"the format {options[0]!r}" if name == "__format__" else called
            if all(hasattr(quantity, "distribution") for quantity in found):
                value = f"Write uqmbd.nominal({_short(self)}) for its value at the means of the inputs."
            else:
                value = "Declare it as an output, and read its values from the results."
            raise SymbolicNumberError(
                f"{_short(self)} differs between realisations or times, but {requested} needs a number. {value}{advice}"
            ) from None

    return convert


def _install() -> None:
    """Replace the methods of SymPy; a second call changes nothing."""
    from sympy.core.expr import Expr
    from sympy.core.relational import Relational, _Inequality
    from sympy.functions.elementary.miscellaneous import MinMaxBase
    from sympy.matrices.matrixbase import MatrixBase

    if hasattr(Relational.__bool__, "__wrapped__"):
        return
    Relational.__bool__ = _refuse_truth(Relational.__bool__)
    _Inequality.__new__ = _refuse_unreal_relation(_Inequality.__new__)
    MinMaxBase.__new__ = _refuse_unreal_extreme(MinMaxBase.__new__)
    for name, sign in {"__lt__": "<", "__le__": "<=", "__gt__": ">", "__ge__": ">="}.items():
        setattr(MatrixBase, name, _refuse_vector(sign))
    for name in _CONVERSIONS:
        setattr(Expr, name, _refuse_conversion(name, getattr(Expr, name)))


if not MYPY:
    _install()
