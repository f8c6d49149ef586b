"""Convert a dataset of poses to shapes: the points of each body, and the symbol of each component."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.report.mechanisms.labels import Label
from uqmbd.report.mechanisms.pose_data import PoseData
from uqmbd.report.mechanisms.sheet import Shape, Sheet, across, extremes, foot, link_shapes, outline_of
from uqmbd.report.mechanisms.solids import Solids
from uqmbd.report.mechanisms.symbols import CLEAR, SQUARE, Stroke, Symbols, projected
from uqmbd.typing import Array

__all__ = ["SketchPart", "Sketch", "world"]


POINTLIKE = ("hinge", "ball", "universal", "weld", "rod", "spring", "damper", "")
"""Symbols of components whose points on the ground are drawn with a ground support."""

ON_GROUND = ("contact", "wheel")
"""Symbols of components on a plane; the first direction is the normal of the plane."""

CLOSED = ("hinge", "ball", "universal", "weld")
"""Symbols of joints with two coincident points."""


def world(data: xr.Dataset | PoseData) -> Array:
    """Return all points and directions in world axes.

    `data` is the result of `uqmbd.report.motion`. Return an array (realisation, time, point, axis). Points are
    in m; directions rotate with their bodies, but are not translated. Points that move in their bodies are displaced at
    true scale.
    """
    pose = data["pose"].values.astype(float)
    local = np.broadcast_to(data["local"].values[:, None], (*pose.shape[:2], *data["local"].shape[1:]))
    if "displacement" in data:
        local = local.copy()
        local[:, :, data["moved_point"].values] += data["displacement"].values
    d = local.shape[-1]
    bodies = [str(name) for name in data["body"].values]
    result = np.empty(local.shape)
    for k, body in enumerate(data["point_body"].values.astype(str)):
        if body not in bodies:
            result[:, :, k] = local[:, :, k]
            continue
        q = pose[:, :, bodies.index(body)]
        result[:, :, k] = _turned(q[..., d:], local[:, :, k])
        if data["point_kind"].values[k] != "direction":
            result[:, :, k] += q[..., :d]
    return result


def _turned(e: Array, vector: Array) -> Array:
    """Rotate vectors (..., 2 or 3) by half-angle pairs (..., 2) or quaternions (..., 4); (..., 0) is no rotation."""
    if e.shape[-1] == 0:
        return vector
    if e.shape[-1] == 2:
        c, s = e[..., 0] ** 2 - e[..., 1] ** 2, 2 * e[..., 0] * e[..., 1]
        return np.stack([c * vector[..., 0] - s * vector[..., 1], s * vector[..., 0] + c * vector[..., 1]], axis=-1)
    once = 2 * np.cross(e[..., 1:], vector)
    turned: Array = vector + e[..., :1] * once + np.cross(e[..., 1:], once)
    return turned


@dataclass(frozen=True)
class SketchPart:
    """Symbol and bodies of a component, and indices of its points and directions.

    `anchor` is the index of the position of the component; None if it is unknown. `ends` are the indices of the
    known positions of its bodies.
    """

    name: str
    symbol: str
    bodies: tuple[str, ...]
    points: tuple[int, ...]
    directions: tuple[int, ...]
    anchor: int | None
    ends: tuple[int, ...]


@dataclass(frozen=True)
class Sketch:
    """Drawing instructions for a mechanism in any of its poses."""

    data: xr.Dataset | PoseData  # result of `uqmbd.report.motion`, or a drawn pose

    @cached_property
    def bodies(self) -> tuple[str, ...]:
        """Return the names of the bodies."""
        return tuple(str(name) for name in self.data["body"].values)

    @cached_property
    def kinds(self) -> list[str]:
        """Return the kind of each point."""
        return [str(kind) for kind in self.data["point_kind"].values]

    @cached_property
    def owners(self) -> list[str]:
        """Return the body of each point."""
        return [str(body) for body in self.data["point_body"].values]

    @cached_property
    def placed(self) -> NDArray[np.bool_]:
        """Return a mask of points; other entries are directions."""
        return np.array([kind != "direction" for kind in self.kinds])

    def points_of(self, body: str) -> list[int]:
        """Return the indices of the points of a body."""
        return [k for k, owner in enumerate(self.owners) if owner == body and self.placed[k]]

    @cached_property
    def lines(self) -> dict[str, list[list[int]]]:
        """Return the lines of at least two points that show a deformable body, as indices of points."""
        found: dict[str, dict[str, list[int]]] = {}
        for k, kind in enumerate(self.kinds):
            if kind == "node":
                found.setdefault(self.owners[k], {}).setdefault(str(self.data["point_role"].values[k]), []).append(k)
        long = {body: [line for line in lines.values() if len(line) > 1] for body, lines in found.items()}
        return {body: lines for body, lines in long.items() if lines}

    @cached_property
    def boxes(self) -> dict[str, list[list[int]]]:
        """Return the corners of the box around each shape, as indices of points."""
        found: dict[str, list[list[int]]] = {}
        corners = [k for k, kind in enumerate(self.kinds) if kind == "corner"]
        for first in range(0, len(corners), 8):
            found.setdefault(self.owners[corners[first]], []).append(corners[first : first + 8])
        return found

    def colour(self, body: str) -> str:
        """Return the colour role of a body."""
        return f"c{self.bodies.index(body) % 5}" if body in self.bodies else "ground"

    def light(self, body: str) -> str:
        """Return the colour role of the faces of a body."""
        return f"pale-{self.colour(body)}"

    @cached_property
    def radii(self) -> list[float]:
        """Return the radius of the circle around each point, m; most points have the radius 0."""
        if "point_radius" not in self.data:
            return [0.0] * len(self.kinds)
        return [abs(float(r)) for r in self.data["point_radius"].values[0]]

    @cached_property
    def solids(self) -> Solids:
        """Return the surfaces of the shapes."""
        return Solids(self.data)

    @cached_property
    def shaped(self) -> set[str]:
        """Return the bodies with shapes, which are drawn instead of links."""
        return set(self.solids.owners) if len(self.solids.faces) else set()

    @cached_property
    def parts(self) -> tuple[SketchPart, ...]:
        """Return the components of the mechanism."""
        if "component" not in self.data.coords:
            return ()
        owner = [str(name) for name in self.data["point_component"].values]
        names = [str(name) for name in self.data["component"].values]
        given = {n: [k for k, o in enumerate(owner) if o == n] for n in names}
        attached = {
            n: tuple(str(b).split("/")) for n, b in zip(names, self.data["component_bodies"].values, strict=True)
        }
        made = []
        for name, symbol in zip(names, self.data["component_symbol"].values, strict=True):
            points = tuple(k for k in given[name] if self.placed[k])
            ends = [self._middle(body) for body in attached[name]]
            anchor = points[-1] if points else self._shared_point(name, attached, given)
            if anchor is None and len(attached[name]) == 1:
                anchor = ends[0]
            directions = tuple(k for k in given[name] if not self.placed[k])
            known = tuple(k for k in ends if k is not None)
            made.append(SketchPart(name, str(symbol), attached[name], points, directions, anchor, known))
        return tuple(made)

    def _middle(self, body: str) -> int | None:
        """Return the index of the position of a body: its centre of mass, otherwise its first point."""
        points = self.points_of(body)
        heavy = [k for k in points if self.kinds[k] == "com"]
        return next(iter([*heavy, *points]), None)

    def _shared_point(self, name: str, attached: dict[str, tuple[str, ...]], given: dict[str, list[int]]) -> int | None:
        """Return the index of a point of another component between the same bodies.

        A component without points is drawn at this point.
        """
        for other, bodies in attached.items():
            if other != name and set(bodies) == set(attached[name]) and len(bodies) > 1:
                points = [k for k in given[other] if self.placed[k]]
                if points:
                    return points[-1]
        return None

    def extent(self, points: Array) -> Array:
        """Return the points (N, axis) in m that a picture must contain, from `points` (..., point, axis)."""
        found = [points[..., self.placed, :].reshape(-1, points.shape[-1])]
        found += [extremes(points[..., k, :], radius) for k, radius in enumerate(self.radii) if radius > 0]
        for part in self.parts:
            if part.symbol in ON_GROUND and part.directions and len(part.points) > 1:
                origin, last, normal = (
                    points[..., k, :] for k in (part.points[0], part.points[-1], part.directions[0])
                )
                found.append(foot(origin, normal, last).reshape(-1, points.shape[-1]))
        return np.concatenate(found)

    # -- drawing -----------------------------------------------------------------------------------------------------
    def reaches(self, points: Array) -> dict[str, tuple[float, float]]:
        """Return the range of positions along each guide and on each plane over all times, m.

        `points` (time, point, axis) are points of one realisation. The key of a guide is the component name. The keys
        of the axes of a plane are ``name/0`` and, in space, ``name/1``.
        """
        found = {}
        for part in self.parts:
            if part.symbol in ("slide", "cylinder", "line") and len(part.points) > 1 and part.directions:
                first, second = points[:, part.points[0]], points[:, part.points[1]]
                axis = points[:, part.directions[0]]
                axis = axis / np.linalg.norm(axis, axis=-1, keepdims=True)
                along = np.sum((second - first) * axis, axis=-1)
                along = along[np.isfinite(along)]
                low, high = (float(along.min()), float(along.max())) if len(along) else (0.0, 0.0)
                # include the origin of the guide, unless it is far away
                found[part.name] = (min(low, 0.0), max(high, 0.0)) if min(abs(low), abs(high)) < 1.0 else (low, high)
            if part.symbol in ON_GROUND and len(part.points) > 1 and part.directions:
                offset = points[:, part.points[-1]] - points[:, part.points[0]]
                axes = [across(normal) for normal in points[:, part.directions[0]]]
                for number in range(points.shape[-1] - 1):
                    along = [float(a[number] @ x) for a, x in zip(axes, offset, strict=True) if np.isfinite(x).all()]
                    # names contain no slash, so these keys are unambiguous
                    found[f"{part.name}/{number}"] = (min([0.0, *along]), max([0.0, *along]))
        return found

    def strokes(self, points: Array, unit: float) -> list[Stroke]:
        """Return the symbols of all components and marks.

        `points` (time, point, axis) are one realisation of `world`; their motion sets the length of guides. `unit` is
        the number of metres per inch; it sets the number of turns of springs.
        """
        reaches, make = self.reaches(points), Symbols(points.shape[-1])
        found: list[Stroke] = []
        for part in self.parts:
            found += self._component(make, part, points[0], reaches, unit)
        lined = {k for lines in self.lines.values() for line in lines for k in line}
        for k, kind in enumerate(self.kinds):
            dotted = kind == "observed" or (kind == "node" and k not in lined)
            found += make.centre_of_mass(k) if kind == "com" else [make.dot(k, clear=True)] * dotted
        return found

    def draw(
        self, sheet: Sheet, points: Array, strokes: Sequence[Stroke] | None = None, thick: float = 9.5
    ) -> list[Shape]:
        """Draw one pose.

        `sheet` is the page; `points` (point, axis) are one realisation and time of `world`. `strokes` are symbols
        of a whole motion, from the method `strokes`; the default is symbols of this pose. `thick` is the width of
        links, in typographic points.
        """
        shapes: list[Shape] = []
        if not np.isfinite(points).all():
            return shapes
        middles = np.array([points[self.points_of(body)].mean(axis=0) for body in self.bodies])
        behind = np.argsort(-sheet.depth(middles), kind="stable") if sheet.spatial else range(len(self.bodies))
        for order, k in enumerate(behind):
            body = self.bodies[k]
            outline = outline_of(sheet, points[self.points_of(body)])
            if body in self.lines:
                role, place = self.colour(body), 2 + 0.5 * order / len(self.bodies)
                for line in self.lines[body]:
                    shapes += link_shapes(sheet.project(points[line]), role, self.light(body), thick, place, along=True)
            elif body not in self.shaped and (body not in self.boxed or len(outline) > 1):
                role, place = self.colour(body), 2 + 0.5 * order / len(self.bodies)
                shapes += link_shapes(outline, role, self.light(body), thick, place)
        if self.shaped:
            shapes += self.solids.draw(sheet, points, [self.colour(body) for body in self.solids.owners])
        strokes = self.strokes(points[None], sheet.unit) if strokes is None else strokes
        taken = sheet.project(points[self.joints]) if self.joints else np.zeros((0, 2))
        for stroke in strokes:
            near = stroke.clear and np.hypot(*(taken - sheet.project(points[stroke.at[0]])).T).min(initial=1.0) <= CLEAR
            shape = None if near else projected(stroke, sheet, points, self.radii)
            shapes += [] if shape is None else [shape]
        return shapes

    @cached_property
    def boxed(self) -> set[str]:
        """Return the second bodies of sliders; the box of the slider replaces such a body if it is a single point."""
        return {p.bodies[1] for p in self.parts if p.symbol in ("slide", "cylinder") and len(p.bodies) > 1}

    @cached_property
    def joints(self) -> list[int]:
        """Return the indices of the points of components; marks near these points are omitted."""
        return [k for part in self.parts for k in part.points]

    def _component(
        self, make: Symbols, part: SketchPart, points: Array, reaches: dict[str, tuple[float, float]], unit: float
    ) -> list[Stroke]:
        """Return the symbol of a component; `points` (point, axis) belong to one pose."""
        axis = part.directions[0] if part.directions else None
        first, last = (part.points[0], part.points[-1]) if part.points else (None, None)
        found: list[Stroke] = []
        if part.symbol in POINTLIKE:
            for k in part.points:
                found += make.support(k) if self.owners[k] == "ground" else []
        if self.data.attrs.get("note") and part.symbol in CLOSED and first is not None and last is not None:
            found.append(make.gap(first, last))
        reach = reaches.get(part.name, (0.0, 0.0))
        match part.symbol:
            case "contact" | "wheel" if first is not None:
                turning = part.directions[1] if part.symbol == "wheel" and len(part.directions) > 1 else None
                # names contain no slash, so the prefix is unambiguous
                planes = [ends for name, ends in reaches.items() if name.startswith(f"{part.name}/")]
                if axis is not None and planes:
                    found += make.ground(first, axis, planes)
                for k in part.points[axis is not None and bool(planes) :]:
                    found += make.circle(k, self.colour(self.owners[k]), turning)
            case "hinge" if last is not None:
                found += make.hinge(last, axis)
            case "ball" if last is not None:
                found += make.ball(last)
            case "universal" if last is not None:
                found += make.universal(last, part.directions)
            case "weld" if last is not None:
                found.append(make.polygon(last, 1.1 * SQUARE, "ground", 1.0))
            case "slide" | "cylinder" if first is not None and last is not None and axis is not None:
                fixed = points[axis] if part.bodies[0] == "ground" else None
                found += make.guide(first, axis, reach, fixed)
                found += make.slide(last, axis, self.light(part.bodies[-1]), turns=part.symbol == "cylinder")
            case "line" if first is not None and last is not None and axis is not None:
                found += [make.line(first, axis, reach), make.dot(last)]
            case "skate" if last is not None and axis is not None:
                found.append(make.blade(last, axis))
            case "plane" if first is not None and last is not None and axis is not None:
                found += [make.plane(last, axis), make.dot(last)]
            case "rod" if first is not None and last is not None:
                found += make.rod(first, last)
            case "spring" if first is not None and last is not None:
                found += make.spring(first, last, float(np.linalg.norm(points[last] - points[first])) / unit)
            case "damper" if first is not None and last is not None:
                found += make.damper(first, last)
            case "coil" if part.anchor is not None:
                found += make.coil(part.anchor, axis)
            case "driver" if first is not None and last is not None and len(part.points) > 1:
                found += make.push(first, last, axis)
            case "driver" | "torque" if part.anchor is not None:
                found += make.arc(part.anchor, axis)
            case "force" if part.anchor is not None:
                found += make.force(part.anchor, axis)
            case _:
                # a component without a symbol is a link between its points or, without points, between its bodies
                ends = part.points if part.points else part.ends
                found += [make.link(ends[0], ends[-1])] if len(ends) > 1 else []
                diamond = 1.2 * np.array([[-1, 0], [0, -1], [1, 0], [0, 1]])
                found += [make.polygon(last, diamond, "paper", 1.1)] if last is not None else []
        return found

    def labels(self, sheet: Sheet, points: Array) -> list[Label]:
        """Return the names of bodies, then of components, each with the position of its part on the page."""
        found = []
        for body in self.bodies:
            middle = sheet.project(points[self.points_of(body)].mean(axis=0))
            found.append(Label(_short(body), middle, 9.0, self.colour(body), bold=True))
        for part in self.parts:
            where = [points[part.anchor]] if part.anchor is not None else [points[k] for k in part.ends]
            if part.symbol in ("rod", "spring", "damper", "contact", "wheel", "driver", "") and len(part.points) > 1:
                where = [points[part.points[0]], points[part.points[-1]]]
                if part.symbol in ON_GROUND and part.directions:
                    where = [foot(where[0], points[part.directions[0]], where[1])]
            if where:
                found.append(Label(_short(part.name), sheet.project(np.mean(where, axis=0)), 8.0, "dark"))
        return found


def _short(name: str) -> str:
    return name if len(name) <= 24 else name[:21] + "…"
