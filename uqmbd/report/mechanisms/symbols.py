"""Bodies, joints, springs, drivers and loads as shapes on the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from uqmbd.report.mechanisms.sheet import Shape, Sheet
from uqmbd.typing import Array

__all__ = ["Pen", "hull", "normals"]


RADIUS = 0.06  # inches: of a pin
PUSH = (0.5, 0.8)  # inches: shortest and longest arrow along the axis of a driver
INK, DARK, GROUND, PLATE, PAPER = "ink", "dark", "ground", "plate", "paper"  # roles of `ROLES`
DRIVE = "drive"  # what moves or loads, apart from what holds
TURN = np.linspace(0, 2 * np.pi, 33)


def hull(points: Array) -> Array:
    """Return the corners of the convex hull of points, shape (N, 2), anticlockwise; of points on a line its two ends.

    Examples
    --------
    >>> import numpy as np
    >>> hull(np.array([[0, 0], [2, 0], [1, 0.5], [2, 2], [0, 2.0]])).tolist()
    [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]
    """
    ordered = points[np.lexsort((points[:, 1], points[:, 0]))]
    if len(ordered) < 3:
        return ordered
    ends = []
    for chain in (ordered, ordered[::-1]):
        kept: list[Array] = []
        for point in chain:
            while len(kept) > 1 and _cross(kept[-1] - kept[-2], point - kept[-2]) <= 1e-4:
                kept.pop()
            kept.append(point)
        ends += kept[:-1]
    return np.array(ends)


def _cross(a: Array, b: Array) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


@dataclass
class Pen:
    """Collects shapes; all points and directions that it is given are in the world, m."""

    sheet: Sheet
    thick: float = 9.5
    """Width of a link, points."""
    shapes: list[Shape] = field(default_factory=list)

    # -- bodies ------------------------------------------------------------------------------------------------------
    def outline(self, points: Array) -> Array:
        """Corners of a body on the page, shape (1 or more, 2), inches: those that differ by a hair are one."""
        page = np.unique(np.round(self.sheet.project(points), 3), axis=0)
        return hull(page)

    def body(self, points: Array, colour: str, light: Any, order: float) -> None:
        """Draw a body as the rounded link or plate that its points span."""
        corners = self.outline(points)
        closed = len(corners) > 2
        vertices = corners if len(corners) > 1 else np.repeat(corners, 2, axis=0) + [[-1e-3, 0], [1e-3, 0]]
        self.shapes.append(Shape(vertices, colour, colour if closed else None, self.thick, closed, order=order))
        self.shapes.append(
            Shape(vertices, light, light if closed else None, 0.8 * self.thick, closed, order=order + 1e-3)
        )

    def centre_of_mass(self, point: Array) -> None:
        """Draw the circle with two black quarters."""
        centre, r = self.sheet.project(point), 0.045
        self._add(centre + r * _circle(), INK, PAPER, 0.7, closed=True, order=5)
        for first in (0, 16):
            arc = r * _circle()[first : first + 9]
            self._add(centre + np.concatenate([[[0, 0]], arc]), "none", INK, 0.0, closed=True, order=5.1)

    # -- the ground --------------------------------------------------------------------------------------------------
    def support(self, point: Array) -> None:
        """Draw what holds a point to the ground: a triangle on hatching."""
        centre = self.sheet.project(point)
        foot = centre + [[0, 0], [-0.11, -0.17], [0.11, -0.17]]
        self._add(foot, GROUND, PLATE, 0.9, closed=True, order=1)
        self._hatch(centre + [-0.17, -0.17], centre + [0.17, -0.17])

    def _hatch(self, start: Array, end: Array) -> None:
        """Draw a line with strokes on its right side."""
        self._add(np.array([start, end]), GROUND, None, 1.2, order=0.9)
        along = end - start
        length = float(np.hypot(*along))
        if length < 1e-6:
            return
        along = along / length
        down = np.array([along[1], -along[0]])
        tops = start + np.arange(0.04, length + 1e-9, 0.06)[:, None] * along
        # one broken line: a shape for each stroke would take most of the time of an animation
        strokes = np.stack([tops, tops + 0.05 * down - 0.04 * along, np.full_like(tops, np.nan)], axis=1)
        self.shapes.append(Shape(strokes.reshape(-1, 2), GROUND, None, 0.7, order=0.8))

    # -- joints ------------------------------------------------------------------------------------------------------
    def hinge(self, point: Array, axis: Array | None) -> None:
        """Draw a circle; in space a ring about the axis."""
        if not self.sheet.spatial or axis is None:
            self._disc(point, RADIUS)
            return
        self._axis(point, axis, 0.26)
        self._add(
            self.sheet.project(point + 1.5 * RADIUS * self.sheet.unit * _ring(axis)), INK, PAPER, 1.3, closed=True
        )

    def ball(self, point: Array) -> None:
        """Draw a ring around a point."""
        self._disc(point, 1.35 * RADIUS)
        self._disc(point, 0.55 * RADIUS, face=INK, order=4.2)

    def universal(self, point: Array, axes: Sequence[Array]) -> None:
        """Draw a cross along its two axes, in a ring."""
        self._disc(point, 1.5 * RADIUS)
        for axis in axes:
            self._axis(point, axis, 1.5 * RADIUS, style="-")

    def weld(self, point: Array) -> None:
        """Draw a square."""
        square = 1.1 * RADIUS * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        self._add(self.sheet.project(point) + square, INK, GROUND, 1.0, closed=True, order=4)

    def diamond(self, point: Array) -> None:
        """Draw the sign for what has no sign of its own."""
        diamond = 1.2 * RADIUS * np.array([[-1, 0], [0, -1], [1, 0], [0, 1]])
        self._add(self.sheet.project(point) + diamond, INK, PAPER, 1.1, closed=True, order=4)

    def dot(self, point: Array) -> None:
        """Draw a small filled circle."""
        self._disc(point, 0.6 * RADIUS, face=INK)

    def slide(self, point: Array, axis: Array, light: Any, *, round_: bool = False) -> None:
        """Draw a box along its axis; `round_` for one that turns as well."""
        long, high = 0.19 * self.sheet.unit, 0.1 * self.sheet.unit
        axis = axis / np.linalg.norm(axis)
        if not self.sheet.spatial:
            across = np.array([-axis[1], axis[0]])
            corners = [point + a * long * axis + b * high * across for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            self._add(self.sheet.project(np.array(corners)), INK, light, 1.2, closed=True, order=2.8)
            return
        b, c = normals(axis)
        ends = [point + s * long * axis for s in (-1.0, 1.0)]
        section = _ring(axis) * high if round_ else np.array([b + c, c - b, -b - c, b - c]) * high * 0.85
        both = [self.sheet.project(end + section) for end in ends]
        self._add(hull(np.concatenate(both)), INK, light, 1.1, closed=True, order=2.8)
        near = int(np.argmin(self.sheet.depth(np.array(ends))))
        self._add(both[near], INK, light, 0.9, closed=True, order=2.9)

    def guide(self, origin: Array, axis: Array, reach: tuple[float, float], *, grounded: bool) -> None:
        """Draw the line on which something slides, from one place along the axis to another, m."""
        axis = axis / np.linalg.norm(axis)
        more = 0.36 * self.sheet.unit
        ends = origin + np.outer([reach[0] - more, reach[1] + more], axis)
        if self.sheet.spatial or not grounded:
            self._add(self.sheet.project(ends), GROUND, None, 1.0, style=(0, (7, 2, 1, 2)), order=0.7)
            return
        across = np.array([axis[1], -axis[0]])
        across = -across if (across[1] > 1e-9 or (abs(across[1]) <= 1e-9 and across[0] > 0)) else across
        ends = self.sheet.project(ends) + 0.115 * across
        along = ends[1] - ends[0]
        right = np.array([along[1], -along[0]])
        self._hatch(*(ends if right @ across > 0 else ends[::-1]))

    def line(self, origin: Array, axis: Array, reach: tuple[float, float]) -> None:
        """Draw a line that something stays on."""
        axis = axis / np.linalg.norm(axis)
        more = 0.3 * self.sheet.unit
        ends = origin + np.outer([reach[0] - more, reach[1] + more], axis)
        self._add(self.sheet.project(ends), GROUND, None, 1.0, style=(0, (5, 2)), order=0.7)

    def plane(self, origin: Array, normal: Array, point: Array) -> None:
        """Draw the part of a plane beneath a point; in the plane a line."""
        normal = normal / np.linalg.norm(normal)
        foot = point - normal * float(normal @ (point - origin))
        if not self.sheet.spatial:
            self.line(foot, np.array([-normal[1], normal[0]]), (0.0, 0.0))
            return
        b, c = (0.35 * self.sheet.unit * x for x in normals(normal))
        corners = np.array([foot + b + c, foot - b + c, foot - b - c, foot + b - c])
        self._add(self.sheet.project(corners), GROUND, PLATE, 0.8, closed=True, order=0.6, alpha=0.6)

    def ground(
        self, origin: Array, normal: Array, along: Sequence[Array], reaches: Sequence[tuple[float, float]]
    ) -> None:
        """Draw what bodies hit or lie on: a hatched line, in space a patch, which `reaches` so far `along`, m."""
        more = 0.45 * self.sheet.unit
        first = origin + np.outer([reaches[0][0] - more, reaches[0][1] + more], along[0])
        if not self.sheet.spatial:
            self._hatch(*self.sheet.project(first))
            return
        second = np.outer([reaches[1][0] - more, reaches[1][1] + more], along[1])
        corners = np.array([first[0] + second[0], first[1] + second[0], first[1] + second[1], first[0] + second[1]])
        self._add(self.sheet.project(corners), GROUND, PLATE, 0.8, closed=True, order=0.6, alpha=0.6)

    def blade(self, point: Array, axis: Array) -> None:
        """Draw the blade of a skate: a short thick line along its axis."""
        step = 0.22 * self.sheet.unit * axis / np.linalg.norm(axis)
        self._add(self.sheet.project(np.array([point - step, point + step])), INK, None, 3.2, order=4.1)

    def circle(self, point: Array, radius: float, colour: Any, axis: Array | None = None) -> None:
        """Draw a circle or sphere of a radius, m, in space with an axis a disc; a dot where it is too small to see."""
        inches = radius / self.sheet.unit
        if inches < 0.6 * RADIUS:
            self.dot(point)
            return
        line = self.sheet.project(point) + inches * _circle(97)
        if self.sheet.spatial and axis is not None:
            line = self.sheet.project(point + radius * _ring(axis))
        self._add(line, colour, None, 1.3, closed=True, order=3.2)
        self._add(line, "none", colour, 0.0, closed=True, order=1.5, alpha=0.15)

    def rod(self, first: Array, second: Array) -> None:
        """Draw a massless rod."""
        self._add(self.sheet.project(np.array([first, second])), DARK, None, 2.2, order=2.5)
        self._disc(first, 0.7 * RADIUS)
        self._disc(second, 0.7 * RADIUS)

    def link(self, first: Array, second: Array) -> None:
        """Draw that two places have to do with each other."""
        self._add(self.sheet.project(np.array([first, second])), GROUND, None, 1.0, style=(0, (2, 2)), order=2.5)

    def gap(self, first: Array, second: Array) -> None:
        """Draw that two places should be one, and are not."""
        ends = self.sheet.project(np.array([first, second]))
        if np.hypot(*(ends[1] - ends[0])) > RADIUS:
            self._add(ends, "limit", None, 1.5, style=(0, (4, 2.5)), order=3.9)

    # -- springs, drivers, loads -------------------------------------------------------------------------------------
    def spring(self, first: Array, second: Array) -> None:
        """Draw a zigzag between two points; a small coil where they coincide."""
        start, end = self.sheet.project(np.array([first, second]))
        along = end - start
        length = float(np.hypot(*along))
        if length < 0.2:
            self._add(start + 0.1 * _circle(), DARK, None, 1.2, closed=True, order=3.5)
        else:
            across = np.array([-along[1], along[0]]) / length * min(0.075, 0.2 * length)
            turns = int(np.clip(length / 0.16, 4, 12))
            s = np.concatenate([[0.0], np.linspace(0.14, 0.86, 2 * turns + 1), [1.0]])
            side = np.array([0, 0, *([1, -1] * turns)[: 2 * turns - 1], 0, 0])
            self._add(start + s[:, None] * along + side[:, None] * across, DARK, None, 1.2, order=3.5)
        self._disc(first, 0.45 * RADIUS, face=INK)
        self._disc(second, 0.45 * RADIUS, face=INK)

    def damper(self, first: Array, second: Array) -> None:
        """Draw a piston in a cylinder between two points; a spring's small circle where they coincide."""
        start, end = self.sheet.project(np.array([first, second]))
        along = end - start
        length = float(np.hypot(*along))
        if length < 0.2:
            self.spring(first, second)
            return
        along = along / length
        side = np.array([-along[1], along[0]]) * min(0.075, 0.2 * length)
        middle, half = (start + end) / 2, min(0.16, 0.25 * length) * along
        self._add(np.array([start, middle - half]), DARK, None, 1.2, order=3.5)
        pot = np.array([middle + half + side, middle - half + side, middle - half - side, middle + half - side])
        self._add(pot, DARK, None, 1.2, order=3.5)
        self._add(np.array([middle - 0.8 * side, middle + 0.8 * side]), DARK, None, 2.2, order=3.5)
        self._add(np.array([middle, end]), DARK, None, 1.2, order=3.5)
        self._disc(first, 0.45 * RADIUS, face=INK)
        self._disc(second, 0.45 * RADIUS, face=INK)

    def coil(self, point: Array, axis: Array | None) -> None:
        """Draw a spiral."""
        turn = np.linspace(0, 5 * np.pi, 60)
        size = 0.07 + 0.09 * turn / turn[-1]
        self._around(point, axis, size, turn, GROUND, 1.0)

    def arc(self, point: Array, axis: Array | None, radius: float = 0.19) -> None:
        """Draw an arrow that turns about a point."""
        turn = np.linspace(np.deg2rad(-30), np.deg2rad(215), 40)
        path = self._around(point, axis, np.full(40, radius), turn, DRIVE, 1.6)
        self._head(path[-3], path[-1])

    def arrow(self, first: Array, second: Array) -> None:
        """Draw an arrow between two places on the page, inches."""
        self._add(np.array([first, second]), DRIVE, None, 1.6, order=4.4)
        self._head(first, second)

    def force(self, point: Array, direction: Array | None) -> None:
        """Draw an arrow that pushes at a point; downwards where its direction is not known beforehand."""
        head = self.sheet.project(point)
        if direction is None:
            tail = head + [0.0, 0.5]
        else:
            step = 0.55 * self.sheet.unit * direction / np.linalg.norm(direction)
            tail = self.sheet.project(point - step)
        self.arrow(tail, head)

    def push(self, first: Array, second: Array, axis: Array | None) -> None:
        """Draw an arrow from one point to another; with an axis a short one along it, at the driven point."""
        if axis is not None:
            along, unit = axis / np.linalg.norm(axis), self.sheet.unit
            way = float((second - first) @ along)
            first = second - np.copysign(min(max(abs(way), PUSH[0] * unit), PUSH[1] * unit), way) * along
        self.arrow(*self.sheet.project(np.array([first, second])))

    # -- helpers -----------------------------------------------------------------------------------------------------
    def _around(self, point: Array, axis: Array | None, size: Array, turn: Array, edge: Any, width: float) -> Array:
        if self.sheet.spatial and axis is not None:
            b, c = normals(axis)
            offsets = np.outer(size * np.cos(turn), b) + np.outer(size * np.sin(turn), c)
            path = self.sheet.project(point + self.sheet.unit * offsets)
        else:
            path = self.sheet.project(point) + size[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
        self._add(path, edge, None, width, order=4.4)
        return path

    def _head(self, before: Array, tip: Array) -> None:
        along = tip - before
        along = along / (float(np.hypot(*along)) or 1.0)
        across = np.array([-along[1], along[0]])
        self._add(
            np.array([tip + 0.02 * along, tip - 0.11 * along + 0.05 * across, tip - 0.11 * along - 0.05 * across]),
            DRIVE, DRIVE, 0.6, closed=True, order=4.5,
        )  # fmt: skip

    def _axis(self, point: Array, axis: Array, half: float, style: Any = (0, (7, 2, 1, 2))) -> None:
        step = half * self.sheet.unit * axis / np.linalg.norm(axis)
        self._add(self.sheet.project(np.array([point - step, point + step])), INK, None, 0.9, style=style, order=4.3)

    def _disc(self, point: Array, radius: float, face: Any = PAPER, order: float = 4.0) -> None:
        self._add(self.sheet.project(point) + radius * _circle(), INK, face, 1.3, closed=True, order=order)

    def _add(
        self, vertices: Array, edge: Any, face: Any, width: float, *, closed: bool = False, style: Any = "-",
        order: float = 4.0, alpha: float = 1.0,
    ) -> None:  # fmt: skip
        if np.isfinite(vertices).all():
            self.shapes.append(Shape(vertices, edge, face, width, closed, style, order, alpha))


def _circle(corners: int = len(TURN)) -> Array:
    turn = np.linspace(0, 2 * np.pi, corners)
    return np.column_stack([np.cos(turn), np.sin(turn)])


def normals(axis: Array) -> tuple[Array, Array]:
    """Two unit vectors perpendicular to an axis in space and to each other."""
    axis = axis / np.linalg.norm(axis)
    other = np.eye(3)[int(np.argmin(abs(axis)))]
    b = np.cross(axis, other)
    b = b / np.linalg.norm(b)
    return b, np.cross(axis, b)


def _ring(axis: Array) -> Array:
    """Return the unit circle about an axis in space, shape (N, 3)."""
    b, c = normals(axis)
    ring: Array = np.outer(np.cos(TURN), b) + np.outer(np.sin(TURN), c)
    return ring
