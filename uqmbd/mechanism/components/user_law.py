"""Laws that a user states: expressions in the symbols that a component declares for them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import sympy

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError, StudyWarning
from uqmbd.mechanism.components.local import Local
from uqmbd.mechanism.expressions import Spline, as_symbolic, shown, t

__all__ = ["law_at", "law_values"]


NO_NUMBERS = (sympy.nan, sympy.oo, -sympy.oo, sympy.zoo, sympy.I)
"""Values that no law may contain: its values are finite and real."""


@typechecked
def law_values(law: Any, *symbols: sympy.Symbol, what: str = "law", package: str = "") -> dict[str, sympy.Symbol]:
    """Return what a law of a user contains beside its symbols, for `uqmbd.Component.prepare`.

    Random variables and the time in a law become numbers of each realisation like the parameters of the component.

    Parameters
    ----------
    law : expression
        As the user gave it, in `symbols`, `uqmbd.t` and random variables.
    *symbols : sympy.Symbol
        What it is a function of, such as the length of a spring.
    what : str
        Name of the parameter, for messages; laws of one component have different names.
    package : str
        The package that offers the symbols, for messages.

    Raises
    ------
    uqmbd.StudyError
        If the law is no finite expression, or contains a symbol that nobody knows.

    Warns
    -----
    uqmbd.StudyWarning
        If the law is a table over time, with none of its symbols in it: most likely the table was not called.

    Examples
    --------
    >>> import sympy
    >>> import uqmbd
    >>> gap = sympy.Symbol("gap", real=True)
    >>> class Magnet(uqmbd.Component):
    ...     law = uqmbd.Parameter("N", "attraction over `gap`, m", kind="option", example=1 / (1 + gap))
    ...     def prepare(self):
    ...         return uqmbd.laws.law_values(self.law, gap, package="my_package")
    ...     def terms(self, p):
    ...         offset = p.body_j.position - p.body_i.position
    ...         distance = sympy.sqrt(offset.dot(offset))
    ...         yield uqmbd.VirtualWork(-uqmbd.laws.law_at(p, p.law, {gap: distance}), p.rate_of(distance))
    >>> uqmbd.laws.law_values(sympy.exp(-gap) * uqmbd.t, gap)
    {'law_0': t}
    """
    names = [f"{package}.{x}" if package else str(x) for x in symbols]
    listed = " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
    expected = f"expected an expression in {listed}{', ' * bool(names)}uqmbd.t and random variables"
    try:
        value = None if isinstance(law, bool) else as_symbolic(law)
    except StudyError:
        value = None
    if not isinstance(value, sympy.Expr) or value.is_Matrix or value.has(*NO_NUMBERS):
        raise StudyError(f"{what} is {law!r}; {expected}.")
    others = sorted(value.free_symbols - set(symbols), key=str)
    if strangers := [x for x in others if type(x) is sympy.Symbol and x != t]:
        raise StudyError(f"{what} is {law!r}, with the unknown symbol {str(strangers[0])!r} in it; {expected}.")
    if not value.free_symbols & set(symbols) and any(x.argument == t for x in value.atoms(Spline)):
        warnings.warn(
            f"{what} is {law!r}, a table over time, with neither {' nor '.join(names)} in it; if it is one over "
            f"{symbols[0]}, call it: uqmbd.spline(...)({names[0]}).",
            StudyWarning,
            stacklevel=5,
        )
    return {f"{what}_{k}": symbol for k, symbol in enumerate(others)}


@typechecked
def law_at(
    p: Local,
    law: Any,
    values: Mapping[sympy.Symbol, Any],
    *,
    what: str = "law",
    by: sympy.Symbol | None = None,
) -> sympy.Expr:
    """Return a law of a user with values for its symbols, for `uqmbd.Component.terms`.

    Parameters
    ----------
    p : uqmbd.extend.Local
        What `terms` works with; it holds what `law_values` returned to `prepare`.
    law : expression
        As the user gave it.
    values : mapping
        An expression for each of its symbols.
    what : str
        As for `law_values`.
    by : sympy.Symbol, optional
        The derivative by this symbol instead of the law itself.

    Raises
    ------
    uqmbd.StudyError
        If `by` is no symbol, or as for `law_values`.

    Examples
    --------
    A spring whose law the user writes in the length:

    >>> import sympy
    >>> import uqmbd
    >>> from uqmbd.laws import law_at, law_values, length
    >>> class Spring(uqmbd.Component):
    ...     bodies, spaces = ("body",), (uqmbd.Line,)
    ...     law = uqmbd.Parameter("N", "force by its length", kind="option")
    ...     def prepare(self):
    ...         return law_values(self.law, length)
    ...     def terms(self, p):
    ...         pull = law_at(p, self.law, {length: p.body.position[0]})
    ...         yield uqmbd.VirtualWork(pull, p.body.velocity[0])
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    >>> mass = mechanism.body("mass", mass=1, position=1)
    >>> spring = mechanism.add(Spring("spring", mass, law=-(sympy.pi**2) * length))
    >>> mechanism.output("x", mass.position[0], units="m")
    >>> round(float(uqmbd.simulate(mechanism, [0, 1])["x"][-1]), 4)  # cos(pi)
    -1.0
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", StudyWarning)  # `prepare` warned
        beside = law_values(law, *values, what=what)
    if by is not None and not isinstance(by, sympy.Symbol):
        raise StudyError(f"law_at: by is {shown(by)}; expected one of the symbols of the law.")
    if missing := [str(symbol) for name, symbol in beside.items() if not hasattr(p, name)]:
        raise StudyError(
            f"law_at: {what} is {shown(law)}, with {missing[0]} in it, which the component did not prepare; return "
            f"law_values(law, ..., what={what!r}) from its prepare()."
        )
    known = {symbol: getattr(p, name) for name, symbol in beside.items()}
    expression = as_symbolic(law)
    return (expression if by is None else expression.diff(by)).xreplace(known | dict(values))
