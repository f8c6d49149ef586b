"""Profiles of roads: a user's expression of the distance along the road."""

from __future__ import annotations

from typing import Any

import sympy

import uqmbd

__all__ = ["distance", "inserted", "profile_symbols"]

distance = sympy.Symbol("distance", real=True)
"""Distance along a road, m, in its profile: the same symbol as ``uqmbd_springs.distance``."""


def profile_symbols(road: Any) -> dict[str, sympy.Symbol]:
    """Return what a profile contains beside the distance, under the names it has in `inserted`; for `prepare`.

    Raises
    ------
    uqmbd.StudyError
        If it is no finite expression, or contains a symbol that nobody knows.

    Examples
    --------
    >>> profile_symbols(sympy.cos(distance) + uqmbd.t)
    {'symbol_0': t}
    """
    expected = "expected an expression in uqmbd_contact.distance, uqmbd.t and random variables"
    try:
        value = None if isinstance(road, (str, bytes, bool)) else sympy.sympify(road, strict=True)
    except (sympy.SympifyError, TypeError, ValueError):
        value = None
    if not isinstance(value, sympy.Expr) or value.is_Matrix or value.has(sympy.nan, sympy.oo, -sympy.oo, sympy.zoo):
        raise uqmbd.StudyError(f"the road {road!r} is given; {expected}.")
    others = sorted(value.free_symbols - {distance}, key=str)
    if strangers := [x for x in others if type(x) is sympy.Symbol and x != uqmbd.t]:
        raise uqmbd.StudyError(
            f"the road {road!r} is given, with the unknown symbol {str(strangers[0])!r}; {expected}."
        )
    return {f"symbol_{k}": symbol for k, symbol in enumerate(others)}


def inserted(road: Any, place: Any, p: uqmbd.Local) -> sympy.Expr:
    """Insert a place for the distance, and what `prepare` made of the other symbols."""
    known = {symbol: getattr(p, name) for name, symbol in profile_symbols(road).items()}
    return sympy.sympify(road).xreplace(known | {distance: place})
