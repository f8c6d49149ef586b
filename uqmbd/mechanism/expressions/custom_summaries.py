"""Summaries of motions by Python functions of plugins and studies.

The functions receive values and weights, or polynomials of several expressions.
"""

from __future__ import annotations

import hashlib
import types
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self, overload

import sympy

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions.computable import FunctionData
from uqmbd.mechanism.expressions.summaries import Summary
from uqmbd.mechanism.expressions.timeless import single
from uqmbd.mechanism.expressions.user_values import shown
from uqmbd.units import Unit, read_units

__all__ = ["CustomSummary", "DeclaredSummary", "SummaryData", "function_digest", "not_smooth", "summary"]


@dataclass(frozen=True, eq=False)
class SummaryData:
    """Data of a summary that are not numbers, such as the shapes of two bodies.

    Parameters
    ----------
    data : object
        Second argument of the function, after the motion. Worker processes receive a pickled copy.
    digest : str
        Text that differs for different data.
    label : str
        Text of the quantity in messages and results; different quantities need different labels.

    Examples
    --------
    >>> import uqmbd
    >>> uqmbd.extend.SummaryData((1.0, 2.0), "1, 2", "norm(1, 2)").label
    'norm(1, 2)'
    """

    data: Any
    digest: str
    label: str


class DeclaredSummary:
    """Declared summary function; a call with expressions and numbers returns a quantity for outputs."""

    def __init__(
        self,
        function: Callable[..., float | str],
        further: tuple[str, ...] = (),
        power: int | None = None,
        unit: Unit | None = None,
        *,
        polynomials: bool = False,
        smooth: bool = True,
        bound: tuple[DeclaredSummary, SummaryData] | None = None,
    ) -> None:
        self.function, self.polynomials, self.smooth, self.bound = function, polynomials, smooth, bound
        self.further, self.power, self.unit = further, power, unit
        self.__name__, self.__qualname__ = function.__name__, function.__qualname__
        self.__module__, self.__doc__ = function.__module__, function.__doc__
        self.digest = function_digest(function) + repr((further, power, unit, polynomials, bound and bound[1].digest))

    @property
    def label(self) -> str:
        """Text of the quantity in messages and results; empty: name and arguments."""
        return self.bound[1].label if self.bound else ""

    @property
    def data(self) -> tuple[Any, ...]:
        """Arguments of the function between the values and the numbers."""
        return (self.bound[1].data,) if self.bound else ()

    def with_data(self, data: SummaryData, further: Sequence[str]) -> DeclaredSummary:
        """Return the same summary with data, which its function receives after the motion."""
        bound = (self, data)
        looks = {"polynomials": self.polynomials, "smooth": self.smooth}
        return DeclaredSummary(self.function, tuple(further), self.power, self.unit, **looks, bound=bound)

    def __call__(self, expression: Any, *others: Any) -> sympy.Expr:
        """Return the summary of an expression; `others` are further expressions, then numbers."""
        name = self.__name__.lstrip("_")
        count = len(self.further)
        if len(others) < count:
            raise StudyError(f"{name} was given {1 + len(others)} expressions; expected {1 + count}.")
        try:
            summed = [single(name, x) for x in (expression, *others[:count])]
        except StudyError as error:
            raise StudyError(str(error).replace(f"uqmbd.{name}(", f"{name}(")) from None
        for number in others[count:]:
            if isinstance(number, bool) or not isinstance(number, (int, float)) or not abs(number) < float("inf"):
                raise StudyError(
                    f"{name}: an argument after the expression is {shown(number)}; expected finite numbers."
                )
        numbers = map(sympy.Float, others[count:])
        found: sympy.Expr = CustomSummary(summed[0], SummaryFunction(self), *summed[1:], *numbers)
        return found

    def __reduce__(self) -> str | tuple[Any, ...]:
        if self.bound:
            declared, data = self.bound
            return DeclaredSummary.with_data, (declared, data, self.further)
        return self.__qualname__  # workers import the function by this name


def not_smooth(expression: sympy.Expr) -> str:
    """Return the text of a summary in an expression that polynomials cannot approximate; empty without one."""
    found = (one for one in sympy.preorder_traversal(expression) if isinstance(one, CustomSummary))
    return next((str(one) for one in found if not one.declared.smooth), "")


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
    def further(self) -> tuple[sympy.Expr, ...]:
        """Further expressions that the function receives."""
        return tuple(self.args[2 : 2 + len(self.declared.further)])

    @property
    def numbers(self) -> tuple[float, ...]:
        """Further arguments of the function."""
        return tuple(float(number) for number in self.args[2 + len(self.declared.further) :])

    def _sympystr(self, printer: Any) -> str:
        if self.declared.label:
            return self.declared.label
        expressions = [printer.doprint(x) for x in (self.args[0], *self.further)]
        arguments = [*expressions, *(f"{number:g}" for number in self.numbers)]
        return f"{self.declared.__name__.lstrip('_')}({', '.join(arguments)})"


@overload
def summary(
    function: Callable[..., float | str],
    *,
    polynomials: bool = False,
    further: Sequence[str] = (),
    power: int | None = None,
    units: str = "",
    smooth: bool = True,
) -> DeclaredSummary: ...


@overload
def summary(
    *,
    polynomials: bool = False,
    further: Sequence[str] = (),
    power: int | None = None,
    units: str = "",
    smooth: bool = True,
) -> Callable[[Callable[..., float | str]], DeclaredSummary]: ...


@typechecked
def summary(
    function: Callable[..., float | str] | None = None,
    *,
    polynomials: bool = False,
    further: Sequence[str] = (),
    power: int | None = None,
    units: str = "",
    smooth: bool = True,
) -> Any:
    """Declare a summary of a motion, such as a percentile over time; every method can propagate a smooth summary.

    Parameters
    ----------
    function : callable
        Function of a module that worker processes can import. ``function(values, weights, *numbers)`` returns one
        finite number for a realisation. The array ``values`` (N,) contains the values of the expression at N points of
        the motion, 1024 or more. The array ``weights`` (N,) contains the duration that each point represents, s. N
        differs between realisations. Without `function`, the call returns a decorator.
    polynomials : bool
        The function is ``function(motion, *numbers)`` instead, with an `uqmbd.extend.MotionPolynomials`. The function
        returns a number, or the reason why the realisation has no value: a clause, without a full stop.
    further : sequence of str
        Units of further expressions, which follow the first one in calls: ``("rad",)`` for an angle. An empty text
        accepts every unit. Requires `polynomials`.
    power : int, optional
        The quantity has the units of the first expression to this power, times `units`: 2 for a power spectral density,
        0 for a number of cycles. Default: uqmbd does not check the units of the quantity.
    units : str
        Further factor of the units, such as ``"s"``.
    smooth : bool
        Whether the quantity is a piecewise smooth function of the inputs, which polynomials can approximate. Otherwise
        only methods that sample the inputs compute it, and other methods refuse it with a message.

    Returns
    -------
    callable
        Function ``function(expression, *further, *numbers)``, which returns a scalar quantity for outputs and
        requirements.

    Raises
    ------
    uqmbd.StudyError
        If `function` is not a function, or the units are unknown. The error also occurs if an argument of the quantity
        is not a single expression.

    Notes
    -----
    uqmbd divides each integration step until polynomials resolve the expression. The points are the 16 nodes of Gauss'
    rule on each part of a step. Weighted sums of smooth functions of the values are therefore as accurate as
    `uqmbd.integral`. A result that depends on single points, such as a percentile, has a further error. The order of
    magnitude of this error is one weight divided by the whole time.

    Examples
    --------
    >>> import numpy as np
    >>> import uqmbd
    >>> def fourth_norm(values, weights):
    ...     return (weights @ values**4 / weights.sum()) ** 0.25
    >>> norm = uqmbd.extend.summary(fourth_norm, power=1)
    >>> mechanism = uqmbd.Mechanism("throw", uqmbd.Translational())
    >>> ball = mechanism.body("ball", mass=1, velocity=(2, 0))
    >>> mechanism.output("norm", norm(ball.position[0]), units="m")
    >>> found = uqmbd.simulate(mechanism, [0, 3])
    >>> bool(np.isclose(found["norm"], 6 / 5**0.25))
    True
    """
    unit = read_units(units or "1")
    if unit is None or (units and power is None):
        raise StudyError(
            f"summary: units is {units!r} and power is {power}; expected known units and a power, such as "
            "units='s', power=2. The result has the units of the expression to this power, times units."
        )
    strange = [x for x in further if not isinstance(x, str) or (x and read_units(x) is None)]
    if strange or (further and not polynomials) or isinstance(further, str):
        raise StudyError(
            f"summary: further={further!r}; expected a sequence with the units of each further expression, such as "
            "('rad',), and polynomials=True."
        )

    def declare(written: Any) -> DeclaredSummary:
        if not isinstance(written, types.FunctionType):
            raise StudyError(f"summary: the argument is {shown(written)}; expected a function written in Python.")
        return DeclaredSummary(written, tuple(further), power, unit, polynomials=polynomials, smooth=smooth)

    return declare if function is None else declare(function)


def function_digest(function: Callable[..., Any]) -> str:
    """Return a hash of the name, the defaults and the code of a function."""
    about = repr((function.__module__, function.__qualname__, function.__defaults__)).encode()
    return hashlib.sha256(about + _code(function.__code__)).hexdigest()


def _code(code: types.CodeType) -> bytes:
    """Return the byte code, names and constants of a function, without the location of its source."""
    inner = [_code(one) if isinstance(one, types.CodeType) else repr(one).encode() for one in code.co_consts]
    return repr((code.co_code, code.co_names, code.co_varnames, inner)).encode()
