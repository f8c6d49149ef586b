"""Excitations: unknown functions; the linearised equations of motion are differentiated with respect to them."""

from __future__ import annotations

from typing import Any, ClassVar, Self

import sympy

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions.computable import FunctionData, OwnFunction
from uqmbd.mechanism.expressions.time import t
from uqmbd.mechanism.expressions.user_values import flatten, numbers, shown
from uqmbd.names import check_name, check_units
from uqmbd.randomness import RandomVariable, Symbol, Symbolic

__all__ = [
    "MEAN_KEY",
    "ORDERS",
    "Excitation",
    "ExcitationSource",
    "ExcitationSymbol",
    "PathSymbol",
    "SampledPath",
    "excitation",
    "excitation_sources",
    "path_keys",
]

MEAN_KEY = 0.0
"""Key of the path of zeros, which is the mean of all paths; sampled keys never have this value."""

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


class PathSymbol(Symbolic, Symbol):
    """Symbol of the sampled path of a source: the key of the path in the inputs, its memory address in kernels."""

    source: ExcitationSource

    def __new__(cls, source: ExcitationSource) -> Self:
        """Make the symbol of a source with sampled paths."""
        self: Self = sympy.Symbol.__xnew__(cls, f"path of {source.source.name}", real=True)
        self.source, self.units = source, "1"
        return self

    def __init__(self, *args: Any) -> None:
        """Accept the arguments of ``__new__``."""

    @property
    def key(self) -> RandomVariable:
        """Input that chooses the path."""
        found: RandomVariable = self.source.source.key
        return found

    def _hashable_content(self) -> tuple[Any, ...]:
        return (*super()._hashable_content(), *self.source._hashable_content())

    def __reduce__(self) -> tuple[Any, ...]:
        return (type(self), (self.source,))


class SampledPath(OwnFunction):
    """Sampled path at an argument, ``SampledPath(x, order, path)``: a cubic spline with data of the realisation."""

    is_real = True
    named: ClassVar[bool] = False

    @classmethod
    def eval(cls, x: Any, order: Any, path: Any) -> sympy.Expr | None:
        """Return zero for derivatives of a cubic of fourth order."""
        return sympy.S.Zero if order > 3 else None

    @property
    def argument(self) -> sympy.Expr:
        """Argument of the path."""
        result: sympy.Expr = self.args[0]
        return result

    @property
    def order(self) -> int:
        """Order of the derivative."""
        return int(self.args[1])

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        """Return the derivative with respect to the argument."""
        x, order, path = self.args
        result: sympy.Expr = SampledPath(x, order + 1, path)
        return result

    def _eval_derivative(self, s: sympy.Symbol) -> sympy.Expr:
        return self.fdiff() * self.argument.diff(s)

    def _eval_evalf(self, prec: int) -> None:
        """Do nothing: only kernels have the values of a path."""


class Excitation(OwnFunction):
    """Excitation ``Excitation(x, source, order, *coefficients)`` at `x`, or its derivative of the given order.

    In equations, a polynomial of the argument replaces the excitation; its coefficients have the value zero.  If the
    source has sampled paths, the `PathSymbol` is the last argument, and the sampled path is added to the polynomial.
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
        rest = enumerate(coefficients[first:ORDERS])
        paths = [SampledPath(x, first, path) for path in coefficients[ORDERS:]]
        return sympy.Add(*(c * x**k / sympy.factorial(k) for k, c in rest), *paths)

    def _eval_evalf(self, prec: int) -> None:
        """Do nothing: an excitation has no value."""

    def _sympystr(self, printer: Any) -> str:
        return f"{self.args[1].source.name}{chr(39) * int(self.args[2])}({printer.doprint(self.argument)})"


@typechecked
def excitation(source: Any, argument: Any) -> sympy.Expr:
    """Return an excitation of the linearised mechanism, such as a random road, for use in forces and drivers.

    An excitation is an unknown function ``w(x)`` of an argument ``x`` that is linear in time. Every parameter that may
    contain `uqmbd.t` may contain an excitation. Outputs of the linearised mechanism (`uqmbd.extend.linear_output`) may
    also contain excitations. An excitation is zero in modes, in linearisations, and in outputs at equilibrium.

    A source with sampled paths also has values over time, so that the motion can be integrated. An input of the
    mechanism, the key of the source, chooses the path of a realisation.

    Parameters
    ----------
    source : object
        Object of a plugin that describes the excitation, for use in linear outputs. The object has the attributes
        ``name`` and ``units``, can be pickled, and has a different ``repr`` than other sources.  A source with sampled
        paths also has the attribute ``key``, from `uqmbd.extend.path_key`, and the method ``sample_paths(sources, keys,
        begin, end)``: it returns ``(first, step, coefficients)`` for keys (K,) and arguments from `begin` to `end`.
        ``coefficients`` (K, source, n) are coefficients of cubic B-splines: the value at the knot ``first + i step``, a
        multiple of ``step``, is ``(c[i] + 4 c[i+1] + c[i+2]) / 6``.  Sources with the same key are sampled together.
        A path must depend on its key and the sources only, not on the interval or on other keys.
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
    check_units(source.units, where)
    x = numbers(where, "the argument", argument, 1, "speed * uqmbd.t + offset")[0]
    strange = sorted((s for s in x.free_symbols if s != t and not isinstance(s, RandomVariable)), key=str)
    if strange:
        raise StudyError(
            f"{where}: its argument is {shown(x)}, and {strange[0]} is not constant; expected speed * uqmbd.t + "
            "offset, with numbers and random variables. The argument cannot depend on the motion of the mechanism, "
            "such as the distance that it travels; use its mean speed."
        )
    speed = x.diff(t)
    if speed == 0 or speed.has(t):
        raise StudyError(
            f"{where}: its argument is {shown(x)}, which is {'constant' if speed == 0 else 'not linear in time'}; "
            "expected speed * uqmbd.t + offset with a constant speed. For several speeds, use a random variable."
        )
    atom = ExcitationSource(source)
    coefficients = [ExcitationSymbol(atom, x, k) for k in range(ORDERS)]
    paths = [] if getattr(source, "key", None) is None else [PathSymbol(atom)]
    found: sympy.Expr = Excitation(x, atom, 0, *coefficients, *paths)
    return found


def excitation_sources(value: Any) -> dict[str, Any]:
    """Return the sources of the excitations that occur in a value, by name.

    >>> excitation_sources((1, None, "text", t))
    {}
    """
    symbols = {s for part in flatten(value) if isinstance(part, sympy.Basic) for s in part.free_symbols}
    found = {s.source.source.name: s.source.source for s in symbols if isinstance(s, (ExcitationSymbol, PathSymbol))}
    return dict(sorted(found.items()))


def path_keys(value: Any) -> set[RandomVariable]:
    """Return the keys of the sampled paths that occur in a value.

    >>> path_keys((1, None, "text", t))
    set()
    """
    symbols = {s for part in flatten(value) if isinstance(part, sympy.Basic) for s in part.free_symbols}
    return {s.key for s in symbols if isinstance(s, PathSymbol)}
