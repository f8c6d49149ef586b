"""Summaries of motions by Python functions of plugins and studies, which receive values and weights."""

from __future__ import annotations

import hashlib
import types
from collections.abc import Callable
from typing import Any, ClassVar, Self

import sympy

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions.computable import FunctionData
from uqmbd.mechanism.expressions.summaries import Summary
from uqmbd.mechanism.expressions.timeless import single
from uqmbd.mechanism.expressions.user_values import shown

__all__ = ["CustomSummary", "DeclaredSummary", "function_digest", "summary"]


class DeclaredSummary:
    """Declared summary function; a call with an expression and numbers returns a quantity for outputs."""

    def __init__(self, function: Callable[..., float]) -> None:
        self.function = function
        self.__name__, self.__qualname__ = function.__name__, function.__qualname__
        self.__module__, self.__doc__ = function.__module__, function.__doc__
        self.digest = function_digest(function)

    def __call__(self, expression: Any, *numbers: float) -> sympy.Expr:
        """Return the summary of an expression; `numbers` are further arguments of the function."""
        name = self.__name__
        try:
            summed = single(name, expression)
        except StudyError as error:
            raise StudyError(str(error).replace(f"uqmbd.{name}(", f"{name}(")) from None
        for number in numbers:
            if isinstance(number, bool) or not isinstance(number, (int, float)) or not abs(number) < float("inf"):
                raise StudyError(
                    f"{name}: an argument after the expression is {shown(number)}; expected finite numbers."
                )
        found: sympy.Expr = CustomSummary(summed, SummaryFunction(self), *map(sympy.Float, numbers))
        return found

    def __reduce__(self) -> str:
        return self.__qualname__  # workers import the function by this name


class SummaryFunction(FunctionData):
    """Declared summary as an atom of expressions; atoms with the same code are equal."""

    declared: DeclaredSummary

    def __new__(cls, declared: DeclaredSummary) -> Self:
        """Store the declaration."""
        self: Self = super().__new__(cls)
        self.declared = declared
        return self

    def _hashable_content(self) -> tuple[Any, ...]:
        return (self.declared.digest,)

    def __reduce__(self) -> tuple[Any, ...]:
        return (SummaryFunction, (self.declared,))

    def _sympyrepr(self, printer: Any) -> str:
        return f"SummaryFunction({self.declared.digest!r})"


class CustomSummary(Summary):
    """Summary that a declared function computes from the values of an expression over the motion."""

    nargs: ClassVar[int | None] = None
    kind = "custom"

    @property
    def declared(self) -> DeclaredSummary:
        """The declared function."""
        found: DeclaredSummary = self.args[1].declared
        return found

    @property
    def numbers(self) -> tuple[float, ...]:
        """Further arguments of the function."""
        return tuple(float(number) for number in self.args[2:])

    def _sympystr(self, printer: Any) -> str:
        arguments = [printer.doprint(self.args[0]), *(f"{number:g}" for number in self.numbers)]
        return f"{self.declared.__name__}({', '.join(arguments)})"


@typechecked
def summary(function: Callable[..., float]) -> Callable[..., sympy.Expr]:
    """Declare a summary of a motion, such as a percentile over time; every method can propagate the summary.

    Parameters
    ----------
    function : callable
        Function of a module that worker processes can import. ``function(values, weights, *numbers)`` returns one
        finite number for a realisation. The array ``values`` (N,) contains the values of the expression at N points of
        the motion, 1024 or more. The array ``weights`` (N,) contains the duration that each point represents, s. N
        differs between realisations.

    Returns
    -------
    callable
        Function ``function(expression, *numbers)``, which returns a scalar quantity for outputs and requirements. The
        units of the quantity are not checked.

    Raises
    ------
    uqmbd.StudyError
        If `function` is not a function, or its argument is not a single expression.

    Notes
    -----
    uqmbd divides each integration step until polynomials resolve the expression.  The points are the 16 nodes of Gauss'
    rule on each part of a step.  Weighted sums of smooth functions of the values are therefore as accurate as
    `uqmbd.integral`.  A result that depends on single points, such as a percentile, has a further error.  Its order of
    magnitude is one weight divided by the whole time.

    Examples
    --------
    >>> import numpy as np
    >>> import uqmbd
    >>> def fourth_norm(values, weights):
    ...     return (weights @ values**4 / weights.sum()) ** 0.25
    >>> norm = uqmbd.extend.summary(fourth_norm)
    >>> mechanism = uqmbd.Mechanism("throw", uqmbd.Translational())
    >>> ball = mechanism.body("ball", mass=1, velocity=(2, 0))
    >>> mechanism.output("norm", norm(ball.position[0]), units="m")
    >>> found = uqmbd.simulate(mechanism, [0, 3])
    >>> bool(np.isclose(found["norm"], 6 / 5**0.25))
    True
    """
    if not isinstance(function, types.FunctionType):
        raise StudyError(f"summary: the argument is {shown(function)}; expected a function written in Python.")
    return DeclaredSummary(function)


def function_digest(function: Callable[..., Any]) -> str:
    """Return a hash of the name, the defaults and the code of a function."""
    about = repr((function.__module__, function.__qualname__, function.__defaults__)).encode()
    return hashlib.sha256(about + _code(function.__code__)).hexdigest()


def _code(code: types.CodeType) -> bytes:
    """Return the byte code, names and constants of a function, without the location of its source."""
    inner = [_code(one) if isinstance(one, types.CodeType) else repr(one).encode() for one in code.co_consts]
    return repr((code.co_code, code.co_names, code.co_varnames, inner)).encode()
