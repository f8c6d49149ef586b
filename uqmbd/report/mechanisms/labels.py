"""Place names so that they cover neither other names nor the named parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uqmbd.report.mechanisms.sheet import Shape
from uqmbd.typing import Array

__all__ = ["Label", "PlacedLabel", "place", "placed_names"]

MOST_NAMES = 60
"""Maximum number of names in a picture; bodies have priority."""


DISTANCES = (0.11, 0.17, 0.25, 0.36, 0.5, 0.7, 0.95, 1.25)  # inches
ANGLES = np.deg2rad(np.arange(0, 360, 22.5))
HEIGHT, CHARACTER = 1.5 / 72, 0.58 / 72  # height of a line and width of a character, inches per point of font size


@dataclass(frozen=True)
class Label:
    """Name of a part, and position of the part on the page, inches."""

    text: str
    anchor: Array
    size: float
    colour: str = "ink"
    bold: bool = False

    @property
    def extent(self) -> Array:
        """Return the estimated width and height of the text, inches."""
        wide = 1.08 if self.bold else 1.0
        return np.array([CHARACTER * wide * len(self.text), HEIGHT]) * self.size


@dataclass(frozen=True)
class PlacedLabel:
    """Placed name: centre of the text, and its distance from the named part, inches."""

    label: Label
    centre: Array
    distance: float


def place(labels: Sequence[Label], obstacles: Array, box: tuple[float, float, float, float]) -> list[PlacedLabel]:
    """Place names next to the named parts in sequence, each at the position with the least overlap.

    `labels` are sorted by importance, the most important first. `obstacles` (N, 2) are points that names should not
    cover, inches. `box` is the available area, inches.

    >>> import numpy as np
    >>> both = [Label("one", np.array([1.0, 1.0]), 9), Label("two", np.array([1.0, 1.0]), 9)]
    >>> one, two = place(both, np.zeros((0, 2)), (0, 0, 2, 2))
    >>> bool(np.any(abs(one.centre - two.centre) >= (one.label.extent + two.label.extent) / 2))
    True
    """
    done: list[PlacedLabel] = []
    corners = np.array([[box[0], box[1]], [box[2], box[3]]])
    directions = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
    for label in labels:
        half = label.extent / 2
        distances = np.repeat(DISTANCES, len(directions))
        around = np.tile(directions, (len(DISTANCES), 1))
        # the distance of the centre from the anchor includes the extent of the text in this direction
        centres = label.anchor + around * distances[:, None] + half * np.clip(1.6 * around, -1, 1)
        cost = 1.6 * distances
        cost += 60 * np.maximum(corners[0] - (centres - half), 0).sum(axis=1)
        cost += 60 * np.maximum((centres + half) - corners[1], 0).sum(axis=1)
        if len(obstacles):
            inside = np.all(abs(centres[:, None] - obstacles[None]) < half + 0.02, axis=2)
            cost += 0.35 * inside.sum(axis=1)
        for other in done:
            gap = half + other.label.extent / 2 + 0.015 - abs(centres - other.centre)
            cost += np.where((gap > 0).all(axis=1), 20 + 40 * gap.min(axis=1), 0)
            # a line from a name to its part should not cross another name
            middle = (centres + label.anchor) / 2
            crossed = np.all(abs(middle - other.centre) < other.label.extent / 2, axis=1)
            cost += np.where(crossed & (distances > DISTANCES[2]), 3, 0)
        best = int(np.argmin(cost))
        done.append(PlacedLabel(label, centres[best], float(distances[best])))
    return done


def placed_names(
    labels: Sequence[Label], shapes: Sequence[Shape], box: tuple[float, float, float, float]
) -> tuple[list[PlacedLabel], list[Shape]]:
    """Place names next to the named parts, clear of shapes.

    `labels` are sorted by importance, the most important first; labels after `MOST_NAMES` are omitted. Names should not
    cover `shapes`; `box` is the available area, inches. Return the names, and thin lines from names to parts that are
    not adjacent.
    """
    placed = place(labels[:MOST_NAMES], _obstacles(shapes), box)
    lines = []
    for one in placed:
        if one.distance > 0.2:
            half = one.label.extent / 2
            away = one.label.anchor - one.centre
            share = 1 / max(1.0, float(np.max(abs(away) / np.maximum(half, 1e-9))))
            start = one.centre + share * away
            lines.append(Shape(np.array([start, one.label.anchor]), "soft", None, 0.6, order=4.9))
    return placed, lines


def _obstacles(shapes: Sequence[Shape]) -> Array:
    """Return points on the page, a twelfth of an inch apart, that names should not cover."""
    found = [np.zeros((0, 2))]
    for shape in shapes:
        corners = np.concatenate([shape.vertices, shape.vertices[:1]]) if shape.closed else shape.vertices
        lines = np.stack([corners[:-1], corners[1:]], axis=1)
        for a, b in lines[np.isfinite(lines).all(axis=(1, 2))]:
            count = int(np.hypot(*(b - a)) / 0.083) + 1
            found.append(a + np.linspace(0, 1, count, endpoint=False)[:, None] * (b - a))
    every = np.concatenate(found)
    return np.unique(np.round(every / 0.04), axis=0) * 0.04
