"""Symbols of uqmbd in functions of NumPy, and in conditions of Python: a message states the replacement.

Both need numbers.  SymPy's relations have no truth value, and say so in terms of SymPy; there is no hook for the
message, so that the method is replaced, for relations with symbols of uqmbd alone.  What is raised is a TypeError, as
SymPy expects it of itself.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NoReturn

from uqmbd.errors import StudyError

if TYPE_CHECKING:
    import sympy

MYPY = False
"""True to mypy alone."""

__all__ = ["Symbol", "Symbolic"]

if MYPY:

    class Symbol:
        """SymPy has no types for mypy, to which a class derived from it is everything, and ``2 * length`` an int."""

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
"""Functions of NumPy, and how they are written with SymPy."""


def _refusal(name: str, written: str) -> Callable[..., NoReturn]:
    write = f"sympy.{written}" if written.isidentifier() else f"{written}, with functions of SymPy"

    def refuse(self: Any, *others: Any) -> NoReturn:
        raise StudyError(
            f"numpy.{name} was given {self}, which represents a quantity and is no number: NumPy computes with numbers "
            f"alone; write {write}."
        )

    return refuse


class Symbolic:
    """Base of symbols: NumPy calls the method of a function's name, which raises with advice."""

    __slots__ = ()

    units = ""
    """Units of the symbol; empty: unknown."""


for _name, _function in _WRITTEN.items():
    setattr(Symbolic, _name, _refusal(_name, _function))


class UndecidedError(StudyError, TypeError):
    """A relation between quantities was used as a condition of Python."""


def _refuse_truth(plain: Callable[[Any], bool]) -> Callable[[Any], bool]:
    def truth(self: Any) -> bool:
        if not any(isinstance(symbol, Symbolic) for symbol in self.free_symbols):
            return plain(self)
        left, right = self.args[:2]
        raise UndecidedError(
            f"{self} has no truth value, since it differs between realisations or times. Write "
            f"sympy.Piecewise((a, {self}), (b, True)) for a value that is a where it is true and b elsewhere. Write "
            "sympy.Max, sympy.Min, sympy.And and sympy.Or instead of max, min, and, or. "
            f"To choose by the means, write uqmbd.nominal({left - right}) {self.rel_op} 0."
        )

    return truth


if not MYPY:
    from sympy.core.relational import Relational

    if Relational.__bool__.__qualname__ != _refuse_truth.__qualname__ + ".<locals>.truth":
        Relational.__bool__ = _refuse_truth(Relational.__bool__)
