"""NumPy functions of symbolic quantities: reducing one expression raises an error that states the remedy.

NumPy turns an expression into an array of one object, whose maximum, mean or percentile is the expression itself. NumPy
looks up two methods of the type of an argument before it computes. Sums and products of quantities have types of
SymPy, so this module adds the methods to `sympy.Expr`. Results for expressions without quantities of uqmbd are
unchanged.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import sympy

from uqmbd.errors import StudyError
from uqmbd.randomness.symbolic import Symbolic

__all__ = ["install"]

_MEAN = "uqmbd.integral({x}) / T, with the duration T"
_SAMPLES = (
    "Write a function of the values and their weights over time, and declare it with uqmbd.extend.summary, which "
    "all methods support. docs/how-to/summaries.md shows a percentile"
)
_REMEDIES = (
    (("max", "amax", "nanmax", "maximum", "fmax"), "Write uqmbd.maximum({x})"),
    (("min", "amin", "nanmin", "minimum", "fmin"), "Write uqmbd.minimum({x})"),
    (("ptp",), "Write uqmbd.maximum({x}) - uqmbd.minimum({x})"),
    (("argmax", "nanargmax"), "Write uqmbd.time_of_maximum({x})"),
    (("argmin", "nanargmin"), "Write uqmbd.time_of_minimum({x})"),
    (("mean", "nanmean", "average"), f"Write {_MEAN}"),
    (("sum", "nansum", "trapezoid", "trapz", "add"), "Write uqmbd.integral({x})"),
    (("norm",), "Write uqmbd.root_mean_square({x})"),
    (("std", "nanstd"), f"Write sympy.sqrt(uqmbd.root_mean_square({{x}})**2 - m**2), where m is {_MEAN}"),
    (("var", "nanvar"), f"Write uqmbd.root_mean_square({{x}})**2 - m**2, where m is {_MEAN}"),
    (("clip",), "Write sympy.Min(sympy.Max({x}, low), high)"),
    (("percentile", "nanpercentile", "quantile", "nanquantile", "median", "nanmedian"), _SAMPLES),
)
"""Names of functions of NumPy, and the replacements for the motion of one realisation."""

_ADVICE = {name: text for names, text in _REMEDIES for name in names}

_OTHER = (
    "Write functions of SymPy, or a summary of the motion: uqmbd.maximum, uqmbd.minimum, uqmbd.integral, "
    "uqmbd.root_mean_square or uqmbd.final"
)

_ARRANGING = frozenset(
    {
        "append", "array2string", "array_repr", "array_str", "asarray", "atleast_1d", "atleast_2d",
        "atleast_3d", "block", "broadcast_arrays", "broadcast_to", "column_stack", "concatenate", "copy",
        "copyto", "cross", "dot", "dstack", "einsum", "expand_dims", "full_like",
        "hstack", "inner", "insert", "iscomplexobj", "isrealobj", "kron", "matmul",
        "matvec", "moveaxis", "multi_dot", "ndim", "ones_like", "outer", "place",
        "put", "ravel", "real", "repeat", "reshape", "result_type", "select",
        "shape", "size", "squeeze", "stack", "swapaxes", "tensordot", "tile",
        "transpose", "vdot", "vecdot", "vecmat", "vstack", "where", "zeros_like",
    }
)  # fmt: skip
"""Functions of NumPy that arrange or multiply expressions, without comparisons and without statistics."""


def _quantities(values: Iterable[Any]) -> tuple[sympy.Expr, list[Symbolic]] | None:
    """Return the first expression with quantities of uqmbd, and these quantities."""
    for value in values:
        if isinstance(value, sympy.Expr):
            found = [symbol for symbol in value.free_symbols if isinstance(symbol, Symbolic)]
            if found:
                return value, found
    return None


def _refused(name: str, expression: sympy.Expr, quantities: list[Symbolic]) -> StudyError:
    text = str(expression)
    x = text if len(text) <= 40 else "x"
    short = text if len(text) <= 80 else text[:77] + "..."
    if all(hasattr(quantity, "distribution") for quantity in quantities):
        return StudyError(
            f"numpy.{name}: the argument is {short}, a random quantity instead of an array of numbers. A study "
            "computes statistics over realisations: declare the expression as an output, and read them from the "
            "results. uqmbd.extend.nominal returns the value at the means of the inputs."
        )
    return StudyError(
        f"numpy.{name}: the argument is {short}, one expression instead of an array of values over time. "
        f"{_ADVICE.get(name, _OTHER).format(x=x, name=name)}."
    )


def _of_function(self: Any, function: Callable[..., Any], types: Any, args: Any, kwargs: Any) -> Any:
    """Raise StudyError for a function of one expression with quantities; otherwise compute as NumPy by default."""
    name = function.__name__
    if name not in _ARRANGING and (found := _quantities([*args, *kwargs.values()])):
        raise _refused(name, *found)
    # with no types that override the function, the method of an array runs NumPy's implementation
    return np.ndarray.__array_function__(np.empty(0), function, (), args, kwargs)


def _of_ufunc(self: Any, function: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
    """Raise an error for a reduction of one expression with quantities; treat others as an array of one object."""
    name = function.__name__
    if (method != "__call__" or hasattr(Symbolic, name)) and (found := _quantities(inputs)):
        if method != "__call__":
            raise _refused(name, *found)
        getattr(Symbolic, name)(found[0])  # raises an error that names the function of SymPy
    return getattr(function, method)(*(_object(x) if isinstance(x, sympy.Expr) else x for x in inputs), **kwargs)


def _object(value: sympy.Expr) -> Any:
    """Return an expression as NumPy's array of one object."""
    if hasattr(value, "__array__"):
        return np.asarray(value)
    found = np.empty((), object)
    found[()] = value
    return found


def install() -> None:
    """Add both methods to `sympy.Expr`; a second call changes nothing."""
    sympy.Expr.__array_function__ = _of_function
    sympy.Expr.__array_ufunc__ = _of_ufunc
