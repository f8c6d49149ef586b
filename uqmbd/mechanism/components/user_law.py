"""User-defined laws: expressions in symbols that a component declares."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import sympy

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError, StudyWarning
from uqmbd.mechanism.components.local import Local
from uqmbd.mechanism.expressions import Spline, as_symbolic, shown, t, unevaluated_process

__all__ = ["law_at", "law_values"]


NO_NUMBERS = (sympy.nan, sympy.oo, -sympy.oo, sympy.zoo, sympy.I)
"""Values that a law must not contain, because its values are finite and real."""


@typechecked
def law_values(law: Any, *symbols: sympy.Symbol, what: str = "law", package: str = "") -> dict[str, sympy.Symbol]:
    """Return the quantities in a user-defined law other than its arguments, for `uqmbd.Component.prepare`.

    These quantities, such as random variables and the time, become parameters of the component. The values of these
    parameters differ between realisations. Values of the time and of commands also change during the motion.

    Parameters
    ----------
    law : expression
        Law from the user, in `symbols`, `uqmbd.t` and random variables.
    *symbols : sympy.Symbol
        Arguments of the law, such as the length of a spring.
    what : str
        Name of the law: the beginning of the returned names, and the name in messages. Laws of the same component have
        different names, and `law_at` needs the same name.
    package : str
        Package that provides the symbols, for messages.

    Returns
    -------
    dict of str to sympy.Symbol
        The other quantities, sorted by name, under the names ``law_0``, ``law_1`` and so on for ``what="law"``.

    Raises
    ------
    uqmbd.StudyError
        If the law is not a finite real expression, or contains a plain symbol that is neither in `symbols` nor
        `uqmbd.t`.

    Warns
    -----
    uqmbd.StudyWarning
        If the law contains a spline over time and none of `symbols`: the spline should probably be called with one of
        `symbols` instead of the time.

    Examples
    --------
    >>> import sympy
    >>> import uqmbd
    >>> gap = sympy.Symbol("gap", real=True)
    >>> class Magnet(uqmbd.Component):
    ...     law = uqmbd.Parameter("N", "attraction as a function of `gap`, m", kind="option", example=1 / (1 + gap))
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
        raise StudyError(f"{what} is {unevaluated_process(law) or repr(law)}; {expected}.")
    others = sorted(value.free_symbols - set(symbols), key=str)
    if strangers := [x for x in others if type(x) is sympy.Symbol and x != t]:
        raise StudyError(f"{what} is {law!r}, which contains the unknown symbol {str(strangers[0])!r}; {expected}.")
    if not value.free_symbols & set(symbols) and any(x.argument == t for x in value.atoms(Spline)):
        warnings.warn(
            f"{what} is {law!r}, a table over time, which contains neither {' nor '.join(names)}. If it is a table "
            "over "
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
    """Return a user-defined law with values inserted for its symbols, for `uqmbd.Component.terms`.

    Parameters
    ----------
    p : uqmbd.extend.Local
        Argument of `terms`; it contains the values that `law_values` returned to `prepare`.
    law : expression
        Law from the user.
    values : mapping
        Expression for each symbol of the law.
    what : str
        Name of the law, equal to `what` in the call of `law_values`.
    by : sympy.Symbol, optional
        Symbol with respect to which the function differentiates the law. Default: no differentiation.

    Raises
    ------
    uqmbd.StudyError
        If `by` is not a symbol, or if the law is invalid as in `law_values`.

    Examples
    --------
    A spring with a user-defined law in its length:

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
        warnings.simplefilter("ignore", StudyWarning)  # `prepare` has already warned
        beside = law_values(law, *values, what=what)
    if by is not None and not isinstance(by, sympy.Symbol):
        raise StudyError(f"law_at: by is {shown(by)}; expected one of the symbols of the law.")
    if missing := [str(symbol) for name, symbol in beside.items() if not hasattr(p, name)]:
        raise StudyError(
            f"law_at: {what} is {shown(law)} and contains {missing[0]}, which prepare() of the component did not "
            f"return. Return law_values(law, ..., what={what!r}) from prepare()."
        )
    known = {symbol: getattr(p, name) for name, symbol in beside.items()}
    expression = as_symbolic(law)
    return (expression if by is None else expression.diff(by)).xreplace(known | dict(values))
