"""Symbols of components as strokes in frames that move with the mechanism; Matplotlib and the page draw the strokes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqmbd.report.mechanisms.sheet import Shape, Sheet, axes_of, hull
from uqmbd.typing import Array

__all__ = ["Stroke", "Symbols", "projected"]


PIN = 0.06  # inches: radius of a pin
PUSH = (0.5, 0.8)  # inches: minimum and maximum length of the arrow along the axis of a driver
COIL = 0.2  # inches: length below which a spring or damper is drawn as a ring
CLEAR = 0.1  # inches: distance from a joint up to which a mark is omitted
HATCH = (0.04, 0.06, 0.05)  # inches: position of the first stroke, distance of strokes, height
INK, DARK, GROUND, PLATE, PAPER, DRIVE, LIMIT = "ink", "dark", "ground", "plate", "paper", "drive", "limit"
CHAIN, DASHES, DOTS = (7.0, 2.0, 1.0, 2.0), (5.0, 2.0), (2.0, 2.0)
SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)


@dataclass(frozen=True)
class Stroke:
    """Line or area, in a frame that points and directions of a mechanism define.

    Without `axis`, the frame is the frame of the page at the point ``at[0]``. With `axis`, the frame is in space, and
    its first axis is along a direction (`axes_of`). With `tips`, the frame is along a span from ``at[0]`` to
    ``at[-1]``.
    """

    points: Array  # (N, axes) in the frame, inches; for a span (N, 3): share of its length, inches along and across it
    at: tuple[int, ...]  # indices of points
    axis: int | None = None  # index of a direction
    metres: Array | None = None  # (N, axes), m: offset of the points
    tips: Array | None = None  # (2, axes), inches: the ends of a span in the frame
    limits: tuple[float, float] | None = None  # inches: minimum and maximum span along the axis, which ends at at[-1]
    scaled: bool = False  # whether the unit of the points is the radius of the circle about at[-1]
    between: tuple[float, float] = (0.0, 1e9)  # inches: lengths of the span, or radii, at which the stroke is visible
    shrinks: float = 0.0  # inches: span below which lengths in inches decrease in proportion to the span
    facing: int = 0  # 1, -1: visible if the axis, or its opposite, points to the viewer
    convex: bool = False  # whether the stroke is the convex hull of its points
    hatch: bool = False  # whether the stroke is hatching on the right side of a line
    clear: bool = False  # whether the stroke is omitted near a point of a component
    edge: str = INK
    face: str | None = None
    width: float = 1.0
    closed: bool = False
    dashes: tuple[float, ...] = ()
    order: float = 4.0
    alpha: float = 1.0


def projected(stroke: Stroke, sheet: Sheet, points: Array, radii: Sequence[float]) -> Shape | None:
    """Project a stroke to the page, for points and directions (N, axes) in the world; return None if it is hidden."""
    at, unit = stroke.at, sheet.unit
    frame = None if stroke.axis is None else axes_of(points[stroke.axis])
    measure = radii[at[-1]] / unit
    size = measure if stroke.scaled else 1.0

    def page(place: int, local: Array, metres: Any = 0.0) -> Array:
        if frame is None:
            return sheet.project(points[place]) + size * local[..., :2]
        return sheet.project(points[place] + (unit * size * local + metres) @ frame)

    if stroke.tips is None:
        vertices = page(at[0], stroke.points, 0.0 if stroke.metres is None else stroke.metres)
    else:
        start, end = page(at[0], stroke.tips[0]), page(at[-1], stroke.tips[1])
        if stroke.limits and frame is not None:
            away = float((points[at[-1]] - points[at[0]]) @ frame[0]) / unit
            start = page(at[-1], np.eye(len(frame))[0] * -np.copysign(np.clip(abs(away), *stroke.limits), away))
        measure = float(np.hypot(*(end - start)))
        along = (end - start) / (measure or 1.0)
        share, ahead, left = stroke.points.T[..., None]
        less = min(1.0, measure / stroke.shrinks) if stroke.shrinks else 1.0
        vertices = start + share * (end - start) + less * (ahead * along + left * np.array([-along[1], along[0]]))
    if not stroke.between[0] <= measure < stroke.between[1] or not np.isfinite(vertices).all():
        return None
    if stroke.facing and frame is not None:
        near, far = sheet.depth(points[at[0]] + np.outer([0.0, unit], frame[0]))
        if stroke.facing * (far - near) > 0:
            return None
    vertices = hull(vertices) if stroke.convex else _hatched(*vertices) if stroke.hatch else vertices
    style: Any = (0, stroke.dashes) if stroke.dashes else "-"
    return Shape(
        vertices, stroke.edge, stroke.face, stroke.width, stroke.closed, style, stroke.order, stroke.alpha
    ) if len(vertices) else None  # fmt: skip


def _hatched(start: Array, end: Array) -> Array:
    """Return hatching on the right of a line as one line, interrupted by NaN; separate shapes are slower to draw."""
    first, step, high = HATCH
    length = float(np.hypot(*(end - start)))
    along = (end - start) / (length or 1.0)
    count = int((length - first) / step + 1.01)  # includes a stroke at the end of the line
    tops = start + (first + step * np.arange(count))[:, None] * along
    foot = tops + high * np.array([along[1], -along[0]]) - first * along
    return np.stack([tops, foot, np.full_like(tops, np.nan)], axis=1).reshape(-1, 2)


def _circle(radius: float, corners: int = 33, first: float = 0.0, last: float = 2 * np.pi, end: float = 0.0) -> Array:
    """Return an arc, or a spiral that ends at another radius `end`, inches."""
    turn = np.linspace(first, last, corners)
    path: Array = np.linspace(radius, end or radius, corners)[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    return path


@dataclass(frozen=True)
class Symbols:
    """Factory of the strokes of symbols; points and directions are given by their indices."""

    dimension: int  # dimension of the drawn space, 2 or 3

    @property
    def spatial(self) -> bool:
        """Return whether the mechanism moves in space."""
        return self.dimension == 3

    def disc(self, at: int, radius: float = PIN, face: str = PAPER, order: float = 4.0, **more: Any) -> Stroke:
        """Return a circle on the page, inches."""
        return Stroke(_circle(radius), (at,), face=face, width=1.3, closed=True, order=order, **more)

    def dot(self, at: int, **more: Any) -> Stroke:
        """Return a small filled circle."""
        return self.disc(at, 0.6 * PIN, INK, **more)

    def polygon(self, at: int, corners: Any, face: str, width: float) -> Stroke:
        """Return an area on the page; its corners are in units of the radius of a pin."""
        return Stroke(PIN * np.asarray(corners, dtype=float), (at,), face=face, width=width, closed=True)

    def _about(self, points: Array) -> Array:
        """Return points (N, 2) around an axis in space as points (N, 3) in the frame of the axis."""
        return np.column_stack([np.zeros(len(points)), points])

    def _along(self, *ends: float) -> Array:
        """Return positions along an axis as points (N, axes) in the frame of the axis."""
        return np.outer(ends, np.eye(self.dimension)[0])

    def _pair(self, first: int, last: int, points: Any = ((0, 0, 0), (1, 0, 0)), **more: Any) -> Stroke:
        """Return a stroke in the frame of the span between two points."""
        return Stroke(np.asarray(points, dtype=float), (first, last), tips=np.zeros((2, self.dimension)), **more)

    def centre_of_mass(self, at: int) -> list[Stroke]:
        """Return the symbol of a centre of mass: a circle with two black quarters."""
        ring = _circle(0.045)
        quarters = [np.concatenate([[[0, 0]], ring[k : k + 9]]) for k in (0, 16)]
        more: dict[str, Any] = {"closed": True, "clear": True}
        return [
            Stroke(ring, (at,), face=PAPER, width=0.7, order=5, **more),
            *(Stroke(q, (at,), edge="none", face=INK, width=0.0, order=5.1, **more) for q in quarters),
        ]

    # -- the ground --------------------------------------------------------------------------------------------------
    def _hatching(self, points: Any, at: int, **more: Any) -> list[Stroke]:
        """Return a line with hatching on the right side."""
        ends = np.asarray(points, dtype=float)
        return [
            Stroke(ends, (at,), edge=GROUND, width=1.2, order=0.9, **more),
            Stroke(ends, (at,), edge=GROUND, width=0.7, order=0.8, hatch=True, **more),
        ]

    def support(self, at: int) -> list[Stroke]:
        """Return a ground support of a point: a triangle on hatching."""
        foot = np.array([[0, 0], [-0.11, -0.17], [0.11, -0.17]])
        shape = Stroke(foot, (at,), edge=GROUND, face=PLATE, width=0.9, closed=True, order=1)
        return [shape, *self._hatching([[-0.17, -0.17], [0.17, -0.17]], at)]

    def _patch(self, corners: Array, at: int, axis: int, metres: Array | None = None) -> Stroke:
        """Return a patch of a plane in space, with corners (4, 2) relative to its normal."""
        more = None if metres is None else self._about(metres)
        looks: dict[str, Any] = {
            "edge": GROUND,
            "face": PLATE,
            "width": 0.8,
            "closed": True,
            "order": 0.6,
            "alpha": 0.6,
        }
        return Stroke(self._about(corners), (at,), axis, more, **looks)

    def ground(self, at: int, normal: int, reaches: Sequence[tuple[float, float]]) -> list[Stroke]:
        """Return a ground contact surface along its `reaches` (m): a hatched line, or a patch in space."""
        (low, high), more = reaches[0], 0.45
        if not self.spatial:  # from left to right along the surface, which is along the negative second axis
            ends, metres = np.array([[0, more], [0, -more]]), np.array([[0, -low], [0, -high]])
            return self._hatching(ends, at, axis=normal, metres=metres)
        bounds = np.array(reaches)
        sides = (SQUARE > 0).astype(int)
        return [
            self._patch(more * SQUARE, at, normal, np.column_stack([bounds[0][sides[:, 0]], bounds[1][sides[:, 1]]]))
        ]

    # -- joints ------------------------------------------------------------------------------------------------------
    def _axis(self, at: int, axis: int, half: float, dashes: tuple[float, ...] = CHAIN) -> Stroke:
        return Stroke(self._along(-half, half), (at,), axis, width=0.9, dashes=dashes, order=4.3)

    def hinge(self, at: int, axis: int | None) -> list[Stroke]:
        """Return the symbol of a hinge: a circle, or in space a ring around the axis."""
        if not self.spatial or axis is None:
            return [self.disc(at)]
        ring = Stroke(self._about(_circle(1.5 * PIN)), (at,), axis, face=PAPER, width=1.3, closed=True)
        return [self._axis(at, axis, 0.26), ring]

    def ball(self, at: int) -> list[Stroke]:
        """Return the symbol of a ball joint: a ring around a point."""
        return [self.disc(at, 1.35 * PIN), self.disc(at, 0.55 * PIN, INK, 4.2)]

    def universal(self, at: int, axes: Sequence[int]) -> list[Stroke]:
        """Return the symbol of a universal joint: a cross along two axes in a ring."""
        return [self.disc(at, 1.5 * PIN), *(self._axis(at, axis, 1.5 * PIN, ()) for axis in axes)]

    def slide(self, at: int, axis: int, face: str, *, turns: bool) -> list[Stroke]:
        """Return the symbol of a slider: a box along its axis; in space, it is round if the slider also rotates."""
        long, high = 0.19, 0.1
        if not self.spatial:
            return [Stroke(SQUARE * [long, high], (at,), axis, face=face, width=1.2, closed=True, order=2.8)]
        section = self._about(_circle(high) if turns else 0.85 * high * SQUARE)
        ends = [section + [s * long, 0, 0] for s in (-1, 1)]
        box = Stroke(np.concatenate(ends), (at,), axis, face=face, width=1.1, closed=True, order=2.8, convex=True)
        faces = [
            Stroke(end, (at,), axis, face=face, width=0.9, closed=True, order=2.9, facing=s)
            for s, end in zip((-1, 1), ends, strict=True)
        ]
        return [box, *faces]

    def line(
        self, at: int, axis: int, reach: tuple[float, float], more: float = 0.3, dashes: tuple[float, ...] = DASHES
    ) -> Stroke:
        """Return the line along which a point moves: the range `reach` in m, extended by `more` inches at each end."""
        metres = self._along(*reach)
        return Stroke(
            self._along(-more, more), (at,), axis, metres, edge=GROUND, width=1.0, dashes=dashes, order=0.7
        )  # fmt: skip

    def guide(self, at: int, axis: int, reach: tuple[float, float], grounded: Array | None) -> list[Stroke]:
        """Return the guide line of a slider; `grounded` is the direction of a guide that is fixed to the ground."""
        more = 0.36
        if self.spatial or grounded is None:
            return [self.line(at, axis, reach, more, CHAIN)]
        # choose the side such that the hatching, which is on the right of the line, is beneath it
        x, y = grounded / (float(np.linalg.norm(grounded)) or 1.0)
        side = 1 if x < -1e-9 or (abs(x) <= 1e-9 and y > 0) else -1
        ends, metres = np.array([[-more, side * 0.115], [more, side * 0.115]]), self._along(*reach)
        return self._hatching(ends[::-side], at, axis=axis, metres=metres[::-side])

    def plane(self, at: int, normal: int) -> Stroke:
        """Return a patch of a plane around a point on it; in two dimensions a line."""
        if self.spatial:
            return self._patch(0.35 * SQUARE, at, normal)
        ends = np.array([[0, -0.3], [0, 0.3]])
        return Stroke(ends, (at,), normal, edge=GROUND, width=1.0, dashes=DASHES, order=0.7)

    def blade(self, at: int, axis: int) -> Stroke:
        """Return the blade of a skate: a short thick line along its axis."""
        return Stroke(self._along(-0.22, 0.22), (at,), axis, width=3.2, order=4.1)

    def circle(self, at: int, role: str, axis: int | None = None) -> list[Stroke]:
        """Return the circle with the radius of a point: in space a disc around `axis`, or a sphere; if tiny, a dot."""
        seen: dict[str, Any] = {"closed": True, "scaled": True, "between": (0.6 * PIN, 1e9)}
        flat = self.spatial and axis is not None
        place, line = (axis, self._about(_circle(1.0))) if flat else (None, _circle(1.0, 97))
        return [
            self.dot(at, between=(0.0, 0.6 * PIN)),
            Stroke(line, (at,), place, edge=role, width=1.3, order=3.2, **seen),
            Stroke(line, (at,), place, edge="none", face=role, width=0.0, order=1.5, alpha=0.15, **seen),
        ]

    def rod(self, first: int, last: int) -> list[Stroke]:
        """Return the symbol of a massless rod: a bar between two pins."""
        bar = self._pair(first, last, edge=DARK, width=2.2, order=2.5)
        return [bar, self.disc(first, 0.7 * PIN), self.disc(last, 0.7 * PIN)]

    def link(self, first: int, last: int) -> Stroke:
        """Return a line between the attachments of a component without a symbol."""
        return self._pair(first, last, edge=GROUND, dashes=DOTS, order=2.5)

    def gap(self, first: int, last: int) -> Stroke:
        """Return a line between two positions that should coincide but do not."""
        return self._pair(first, last, edge=LIMIT, width=1.5, dashes=(4.0, 2.5), order=3.9, between=(PIN, 1e9))

    # -- springs, drivers, loads -------------------------------------------------------------------------------------
    def _between(self, first: int, last: int, lines: Sequence[tuple[Any, float]]) -> list[Stroke]:
        """Return `lines` (points, width) in the frame of a span with a pin at each end; a ring if the span is short."""
        looks: dict[str, Any] = {"edge": DARK, "order": 3.5}
        pins = [self.disc(at, 0.45 * PIN, INK) for at in (first, last)]
        ring = np.column_stack([np.zeros(33), _circle(0.1)])
        long = [self._pair(first, last, x, width=w, between=(COIL, 1e9), shrinks=0.375, **looks) for x, w in lines]
        return [self._pair(first, last, ring, width=1.2, closed=True, between=(0.0, COIL), **looks), *long, *pins]

    def spring(self, first: int, last: int, length: float) -> list[Stroke]:
        """Return the symbol of a spring: a zigzag between two points; `length`, inches, sets the number of turns."""
        turns = int(np.clip(np.nan_to_num(length) / 0.16, 4, 12))
        share = [0.0, *np.linspace(0.14, 0.86, 2 * turns + 1), 1.0]
        side = [0, 0, *([1, -1] * turns)[: 2 * turns - 1], 0, 0]
        return self._between(
            first, last, [(np.column_stack([share, 0 * np.array(share), 0.075 * np.array(side)]), 1.2)]
        )

    def damper(self, first: int, last: int) -> list[Stroke]:
        """Return the symbol of a damper: a piston in a cylinder between two points."""
        half, side = 0.16, 0.075
        pot = [[0.5, half, side], [0.5, -half, side], [0.5, -half, -side], [0.5, half, -side]]
        rods = [[[0, 0, 0], [0.5, -half, 0]], [[0.5, 0, 0], [1, 0, 0]]]
        piston = [[0.5, 0, -0.8 * side], [0.5, 0, 0.8 * side]]
        return self._between(first, last, [(rods[0], 1.2), (pot, 1.2), (piston, 2.2), (rods[1], 1.2)])

    def _around(self, at: int, axis: int | None, path: Array, edge: str, width: float) -> Stroke:
        if self.spatial and axis is not None:
            return Stroke(self._about(path), (at,), axis, edge=edge, width=width, order=4.4)
        return Stroke(path, (at,), edge=edge, width=width, order=4.4)

    def coil(self, at: int, axis: int | None) -> list[Stroke]:
        """Return the symbol of a torsional spring: a spiral around a point."""
        return [self._around(at, axis, _circle(0.07, 60, 0.0, 5 * np.pi, 0.16), GROUND, 1.0)]

    def arc(self, at: int, axis: int | None) -> list[Stroke]:
        """Return the symbol of a rotational driver or torque: a curved arrow around a point."""
        path = self._around(at, axis, _circle(0.19, 40, np.deg2rad(-30), np.deg2rad(215)), DRIVE, 1.6)
        return [path, self._head(path.at, path.axis, path.points[[-3, -1]])]

    def _head(self, at: tuple[int, ...], axis: int | None, tips: Array, limits: Any = None) -> Stroke:
        corners = np.array([[1, 0.02, 0], [1, -0.11, 0.05], [1, -0.11, -0.05]])
        looks: dict[str, Any] = {"edge": DRIVE, "face": DRIVE, "width": 0.6, "closed": True, "order": 4.5}
        return Stroke(corners, at, axis, tips=tips, limits=limits, **looks)

    def arrow(self, at: tuple[int, ...], axis: int | None, tips: Array, limits: Any = None) -> list[Stroke]:
        """Return an arrow between the ends of a span."""
        ends = np.array([[0.0, 0, 0], [1, 0, 0]])
        shaft = Stroke(ends, at, axis, tips=tips, limits=limits, edge=DRIVE, width=1.6, order=4.4)
        return [shaft, self._head(at, axis, tips, limits)]

    def force(self, at: int, direction: int | None) -> list[Stroke]:
        """Return a force arrow at a point; the arrow points downwards if its direction is unknown in advance."""
        if direction is None:
            return self.arrow((at,), None, np.array([[0, 0.5], [0, 0]]))
        return self.arrow((at,), direction, self._along(-0.55, 0.0))

    def push(self, first: int, last: int, axis: int | None) -> list[Stroke]:
        """Return the symbol of a driver: an arrow between two points, or along `axis` at the driven point."""
        return self.arrow((first, last), axis, np.zeros((2, self.dimension)), None if axis is None else PUSH)
