"""Profiles of roads: height as an expression of the distance along the road, or of time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy

import uqmbd
from uqmbd.laws import distance, law_values

__all__ = ["distance", "haversine_bump", "sampled_road"]


def haversine_bump(height: Any, length: Any, start: Any = 0, along: Any = distance) -> sympy.Expr:
    """Return a bump on a flat road, ``height (1 - cos(2 pi (x - start) / length)) / 2`` for ``length`` from ``start``.

    Parameters
    ----------
    height, length, start : number or expression
        m; in random variables if wanted.
    along : expression
        `distance`, or the distance as a function of `uqmbd.t` where the speed is prescribed.

    Raises
    ------
    uqmbd.StudyError
        If one of them is no number or expression, or the length is a number that is not positive.

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


def sampled_road(distances: Sequence[float], heights: Sequence[Any], along: Any = distance) -> sympy.Expr:
    """Return the cubic spline through samples of a road: level at both ends, and flat beyond them.

    It is ``uqmbd.spline(distances, heights, ends="flat")(along)``.

    Parameters
    ----------
    distances : sequence of numbers
        m, increasing.
    heights : sequence of numbers or expressions
        m; in random variables if wanted.
    along : expression
        As in `haversine_bump`.

    Raises
    ------
    uqmbd.StudyError
        If they are fewer than two, not equally many, not finite, or the distances do not increase.

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
            "sampled_road: expected two lists of equal length, two numbers at least, all finite, and distances that "
            f"increase; {why}."
        ) from None
