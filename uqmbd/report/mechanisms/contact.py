"""Contacts on the page: a hatched line or a patch where a plane is, circles where spheres and wheels are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from uqmbd.report.mechanisms.symbols import Pen, normals
from uqmbd.typing import Array

__all__ = ["across", "draw_contact", "extremes", "foot"]


def foot(origin: Array, normal: Array, point: Array) -> Array:
    """Return the points of a plane that are nearest to others; all of shape (..., axis), m.

    Examples
    --------
    >>> import numpy as np
    >>> foot(np.array([0.0, 1.0]), np.array([0.0, 2.0]), np.array([3.0, 5.0])).tolist()
    [3.0, 1.0]
    """
    unit = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    nearest: Array = point - unit * np.sum(unit * (point - origin), axis=-1, keepdims=True)
    return nearest


def across(normal: Array) -> list[Array]:
    """Return unit vectors along a plane, given its normal: one in the plane of the page, two in space."""
    if len(normal) == 3:
        return list(normals(normal))
    return [np.array([normal[1], -normal[0]]) / np.linalg.norm(normal)]


def extremes(points: Array, radius: float) -> Array:
    """Return the ends of circles or spheres along the axes, shape (N, axis), m, about points (..., axis)."""
    d = points.shape[-1]
    ends: Array = points.reshape(-1, 1, d) + radius * np.concatenate([np.eye(d), -np.eye(d)])
    return ends.reshape(-1, d)


def draw_contact(
    pen: Pen, places: Sequence[Array], radii: Sequence[float], colours: Sequence[Any], normal: Array | None,
    reaches: Sequence[tuple[float, float]], turning: Array | None = None,
) -> None:  # fmt: skip
    """Draw what may touch.

    Parameters
    ----------
    pen : Pen
        What draws.
    places : sequence of array
        World points: a point of the plane first, if there is a normal; centres of circles.
    radii : sequence of float
        Of the circles, m; 0 is a point.
    colours : sequence
        Of the circles.
    normal : array, optional
        Of the plane, towards the other body.
    reaches : sequence of (low, high)
        How far the plane is shown from its point along each vector of `across`, m.
    turning : array, optional
        Axis of the circles in space, where they are wheels.
    """
    if normal is not None:
        pen.ground(places[0], normal, across(normal), reaches)
    for place, radius, colour in list(zip(places, radii, colours, strict=True))[normal is not None :]:
        pen.circle(place, radius, colour, turning)
