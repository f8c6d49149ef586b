"""Excitations: unknown functions; the linearised equations of motion are differentiated with respect to them."""

from __future__ import annotations

from typing import Any, ClassVar, Self

import sympy

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions.computable import FunctionData, OwnFunction
from uqmbd.mechanism.expressions.time import t
from uqmbd.mechanism.expressions.user_values import numbers, shown
from uqmbd.names import check_name
from uqmbd.randomness import RandomVariable, Symbol, Symbolic

__all__ = ["ORDERS", "Excitation", "ExcitationSource", "ExcitationSymbol", "excitation"]

ORDERS = 3
"""Number of Taylor coefficients of an excitation: its value, slope and curvature."""


class ExcitationSource(FunctionData):
    """Plugin object that describes an excitation, as an atom of expressions; sources with the same `repr` are equal."""

    source: Any

    def __new__(cls, source: Any) -> Self:
        """Store the object."""
        self: Self = super().__new__(cls)
        self.source = source
        return self

    def _hashable_content(self) -> tuple[Any, ...]:
        return (self.source.name, repr(self.source))

    def __reduce__(self) -> tuple[Any, ...]:
        return (type(self), (self.source,))

    def _sympyrepr(self, printer: Any) -> str:
        return f"ExcitationSource({self.source!r})"

    def _sympystr(self, printer: Any) -> str:
        return str(self.source.name)


class ExcitationSymbol(Symbolic, Symbol):
    """Symbol of a Taylor coefficient of an excitation, which is zero in all computations of a pose or a motion."""

    source: ExcitationSource
    argument: sympy.Expr
    order: int

    def __new__(cls, source: ExcitationSource, argument: sympy.Expr, order: int) -> Self:
        """Make the symbol of the coefficient of a power of the argument."""
        self: Self = sympy.Symbol.__xnew__(cls, f"{source.source.name}({argument})[{order}]", real=True)
        self.source, self.argument, self.order = source, argument, order
        self.units = source.source.units if order == 0 else ""
        return self

    def __init__(self, *args: Any) -> None:
        """Accept the arguments of ``__new__``."""

    def _hashable_content(self) -> tuple[Any, ...]:
        return (*super()._hashable_content(), *self.source._hashable_content())

    def __reduce__(self) -> tuple[Any, ...]:
        return (type(self), (self.source, self.argument, self.order))


class Excitation(OwnFunction):
    """Excitation at an argument, ``Excitation(x, source, order, *coefficients)``; `order` is the order of derivative.

    In equations, a polynomial of the argument replaces the excitation; its coefficients have the value zero.
    """

    is_real = True
    named: ClassVar[bool] = False

    @property
    def argument(self) -> sympy.Expr:
        """Argument of the excitation."""
        result: sympy.Expr = self.args[0]
        return result

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        """Return the derivative with respect to the argument."""
        x, source, order, *coefficients = self.args
        result: sympy.Expr = Excitation(x, source, order + 1, *coefficients)
        return result

    def _eval_derivative(self, s: sympy.Symbol) -> sympy.Expr:
        return self.fdiff() * self.argument.diff(s)

    def doit(self, **hints: Any) -> sympy.Expr:
        """Return the polynomial that replaces the excitation in equations."""
        x, _, order, *coefficients = self.args
        first = int(order)
        rest = enumerate(coefficients[first:])
        return sympy.Add(*(c * x**k / sympy.factorial(k) for k, c in rest))

    def _eval_evalf(self, prec: int) -> None:
        """Do nothing: an excitation has no value."""

    def _sympystr(self, printer: Any) -> str:
        return f"{self.args[1].source.name}{chr(39) * int(self.args[2])}({printer.doprint(self.argument)})"


@typechecked
def excitation(source: Any, argument: Any) -> sympy.Expr:
    """Return an excitation of the linearised mechanism, such as a random road, for use in forces and drivers.

    An excitation is an unknown function ``w(x)`` of an argument ``x`` that is linear in time. Every parameter that may
    contain `uqmbd.t` may contain an excitation. Outputs of the linearised mechanism (`uqmbd.extend.linear_output`) may
    also contain excitations. An excitation has no values: it is zero in an assembly, in an equilibrium and in modes.
    The motion of a mechanism with an excitation cannot be integrated.

    Parameters
    ----------
    source : object
        Object of a plugin that describes the excitation, for use in linear outputs. The object has the attributes
        ``name`` and ``units``, can be pickled, and has a different ``repr`` than other sources.
    argument : expression
        Argument, ``speed * uqmbd.t + offset``; `speed` and `offset` may contain random variables.

    Returns
    -------
    expression
        Value of the excitation at the argument; different arguments are different channels of one source.

    Raises
    ------
    uqmbd.StudyError
        If the argument is not linear in time, or contains a quantity of the motion.

    Examples
    --------
    >>> import uqmbd
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True)
    ... class Wind:
    ...     name: str
    ...     units: str = "m/s"
    >>> gust = uqmbd.extend.excitation(Wind("gust"), uqmbd.t)
    >>> gust, gust.diff(uqmbd.t)
    (gust(t), gust'(t))
    """
    name = check_name(source.name, "excitation")
    where = f"excitation {name!r}"
    x = numbers(where, "the argument", argument, 1, "speed * uqmbd.t + offset")[0]
    strange = sorted((s for s in x.free_symbols if s != t and not isinstance(s, RandomVariable)), key=str)
    if strange:
        raise StudyError(
            f"{where}: its argument is {shown(x)}, which contains {strange[0]}; expected speed * uqmbd.t + offset, "
            "with numbers and random variables."
        )
    speed = x.diff(t)
    if speed == 0 or speed.has(t):
        raise StudyError(
            f"{where}: its argument is {shown(x)}, which is {'constant' if speed == 0 else 'not linear in time'}; "
            "expected speed * uqmbd.t + offset with a constant speed."
        )
    atom = ExcitationSource(source)
    found: sympy.Expr = Excitation(x, atom, 0, *(ExcitationSymbol(atom, x, k) for k in range(ORDERS)))
    return found
