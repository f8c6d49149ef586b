"""Profiles of roads: height as an expression of the distance along the road, or of time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy

import uqmbd
from uqmbd.extend import typechecked
from uqmbd.laws import distance, law_values

__all__ = ["distance", "haversine_bump", "sampled_road"]


@typechecked(values=False)
def haversine_bump(height: Any, length: Any, start: Any = 0, along: Any = distance) -> sympy.Expr:
    """Return a bump on a flat road, ``height (1 - cos(2 pi (x - start) / length)) / 2``.

    The bump begins at ``x = start`` and ends at ``x = start + length``.

    Parameters
    ----------
    height, length, start : number or expression
        Dimensions and start of the bump, m; they can contain random variables.
    along : expression
        Distance ``x`` along the road, m: `distance`, or a function of `uqmbd.t` for a prescribed speed.

    Returns
    -------
    sympy.Expr
        Height of the road, m.

    Raises
    ------
    uqmbd.StudyError
        If an argument is neither a number nor an expression, or if the length is a number that is not positive.

    Examples
    --------
    >>> bump = haversine_bump(0.05, 0.3, start=1)
    >>> [round(float(bump.subs(distance, x)), 6) for x in (0.9, 1.15, 2)]
    [0.0, 0.05, 0.0]
    """
    for what, value in (("height", height), ("length", length), ("start", start), ("along", along)):
        symbols = {distance, *getattr(value, "free_symbols", ())}
        law_values(value, *sorted(symbols, key=str), what=f"haversine_bump: {what}")
    if sympy.sympify(length, strict=True).is_positive is False:
        raise uqmbd.StudyError(f"haversine_bump: the length is {length}; expected a positive number of metres.")
    x = sympy.sympify(along, strict=True) - start
    wave = height * (1 - sympy.cos(2 * sympy.pi * x / length)) / 2
    return sympy.Piecewise((0, x <= 0), (0, x >= length), (wave, True))


@typechecked(values=False)
def sampled_road(distances: Sequence[float], heights: Sequence[Any], along: Any = distance) -> sympy.Expr:
    """Return the cubic spline through samples of a road, with zero slope at both ends and constant heights beyond.

    The spline is ``uqmbd.spline(distances, heights, ends="flat")(along)``.

    Parameters
    ----------
    distances : sequence of numbers
        Distances of the samples, m, increasing.
    heights : sequence of numbers or expressions
        Heights of the samples, m; they can contain random variables.
    along : expression
        Distance along the road, as for `haversine_bump`.

    Returns
    -------
    sympy.Expr
        Height of the road, m.

    Raises
    ------
    uqmbd.StudyError
        If there are fewer than two samples, the lengths differ, a value is not finite, or the distances do not
        increase.

    Examples
    --------
    >>> road = sampled_road([0, 1, 2], [0, 0.1, 0])
    >>> [round(float(road.subs(distance, x)), 6) for x in (-1, 0.5, 1, 3)]
    [0.0, 0.05, 0.1, 0.0]
    """
    try:
        return uqmbd.spline(distances, heights, ends="flat")(along)
    except uqmbd.StudyError as error:
        why = str(error).removeprefix("spline: ").rstrip(".")
        raise uqmbd.StudyError(
            "sampled_road: expected two lists of equal length with at least two finite numbers, and increasing "
            f"distances; {why}."
        ) from None
