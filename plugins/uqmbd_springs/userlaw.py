"""Expressions of a user in a component: their random variables and the time become numbers of each realisation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import sympy

import uqmbd

__all__ = ["coefficients", "inserted"]


def coefficients(law: Any, *variables: sympy.Symbol, what: str = "law") -> dict[str, sympy.Symbol]:
    """Return what an expression contains beside its variables, under the names it has in `inserted`; for `prepare`.

    Parameters
    ----------
    law : expression
        As the user gave it.
    *variables : Symbol
        What it is a function of.
    what : str
        What it is called, for messages.

    Raises
    ------
    uqmbd.StudyError
        If it is no finite expression, or contains a symbol that nobody knows.
    """
    found = sorted(_expression(law, variables, what).free_symbols - set(variables), key=str)
    return {f"coefficient_{k}": symbol for k, symbol in enumerate(found)}


def inserted(law: Any, values: Mapping[sympy.Symbol, Any], p: uqmbd.Local) -> sympy.Expr:
    """Insert values for the variables of an expression, and what `prepare` made of the rest by `coefficients`."""
    known = {symbol: getattr(p, name) for name, symbol in coefficients(law, *values).items()}
    return sympy.sympify(law).xreplace(known | dict(values))


def _expression(law: Any, variables: Sequence[sympy.Symbol], what: str) -> sympy.Expr:
    names = " and ".join(f"uqmbd_springs.{x}" for x in variables)
    expected = f"expected an expression in {names}, uqmbd.t and random variables"
    try:
        # SymPy would read a text as a formula and make symbols of its words
        value = None if isinstance(law, (str, bytes, bool)) else sympy.sympify(law, strict=True)
    except (sympy.SympifyError, TypeError, ValueError):
        value = None
    if not isinstance(value, sympy.Expr) or value.is_Matrix or value.has(sympy.nan, sympy.oo, -sympy.oo, sympy.zoo):
        raise uqmbd.StudyError(f"{what} is {law!r}; {expected}.")
    strangers = sorted(str(x) for x in value.free_symbols if type(x) is sympy.Symbol and x not in (*variables, uqmbd.t))
    if strangers:
        raise uqmbd.StudyError(f"{what} is {law!r}, with the unknown symbol {strangers[0]!r} in it; {expected}.")
    return value
