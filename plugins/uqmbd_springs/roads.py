"""Profiles of roads: height as an expression of the distance along the road, or of time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import sympy

import uqmbd

__all__ = ["distance", "haversine_bump", "sampled_road"]

distance = sympy.Symbol("distance", real=True)
"""Distance along a road, m, in its profile."""


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
        If the length is a number that is not positive.

    Examples
    --------
    >>> bump = haversine_bump(0.05, 0.3, start=1)
    >>> [round(float(bump.subs(distance, x)), 6) for x in (0.9, 1.15, 2)]
    [0.0, 0.05, 0.0]
    """
    if sympy.sympify(length).is_positive is False:
        raise uqmbd.StudyError(f"haversine_bump: the length is {length}; expected a positive number of metres.")
    x = sympy.sympify(along) - start
    wave = height * (1 - sympy.cos(2 * sympy.pi * x / length)) / 2
    return sympy.Piecewise((0, x <= 0), (0, x >= length), (wave, True))


def sampled_road(distances: Sequence[float], heights: Sequence[float], along: Any = distance) -> sympy.Expr:
    """Return the cubic spline through samples of a road: level at both ends, and flat beyond them.

    Coefficients are looked up by bisection, so that the time of an evaluation hardly grows with the number of samples;
    that of the compilation, once, does.

    Parameters
    ----------
    distances : sequence of numbers
        m, increasing.
    heights : sequence of numbers
        m.
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
    from scipy.interpolate import CubicSpline

    x, z = np.asarray(distances, dtype=float), np.asarray(heights, dtype=float)
    if x.ndim != 1 or len(x) < 2 or x.shape != z.shape or not np.isfinite([x, z]).all() or not (np.diff(x) > 0).all():
        raise uqmbd.StudyError(
            f"sampled_road: distances have shape {x.shape} and heights {z.shape}; expected two lists of equal length, "
            "two numbers at least, all finite, and distances that increase."
        )
    inner = CubicSpline(x, z, bc_type="clamped").c
    flat = [np.array([0.0, 0.0, 0.0, height])[:, None] for height in (z[0], z[-1])]
    coefficients = np.concatenate([flat[0], inner, flat[1]], axis=1)
    *cubic, constant = (_looked_up(row, x, along) for row in coefficients)
    offset = sympy.sympify(along) - _looked_up(np.concatenate([x[:1], x]), x, along)
    return ((cubic[0] * offset + cubic[1]) * offset + cubic[2]) * offset + constant


def _looked_up(values: np.ndarray, knots: np.ndarray, along: Any) -> sympy.Expr:
    """Return the value of the interval that a distance is in, by bisection; there is one more than there are knots."""
    if len(values) == 1:
        return sympy.Float(values[0])
    middle = len(knots) // 2
    lower = _looked_up(values[: middle + 1], knots[:middle], along)
    upper = _looked_up(values[middle + 1 :], knots[middle + 1 :], along)
    return sympy.Piecewise((lower, along < sympy.Float(knots[middle])), (upper, True), evaluate=False)
