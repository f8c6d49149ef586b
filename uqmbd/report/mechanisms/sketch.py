"""From the dataset of poses to shapes: which points belong to which body, and how each component is drawn."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.report.mechanisms.contact import across, draw_contact, extremes, foot
from uqmbd.report.mechanisms.labels import Label
from uqmbd.report.mechanisms.sheet import Sheet
from uqmbd.report.mechanisms.symbols import Pen
from uqmbd.typing import Array

__all__ = ["Part", "Sketch", "world"]


POINTLIKE = ("hinge", "ball", "universal", "weld", "rod", "spring", "damper", "")
"""Symbols whose point on the ground is shown as held by it."""

ON_GROUND = ("contact", "wheel")
"""Symbols of what lies or rolls on a plane, whose normal is its first direction."""

CLOSED = ("hinge", "ball", "universal", "weld")
"""Symbols of joints that hold two points together."""


def world(data: xr.Dataset) -> Array:
    """Return all points and directions in world axes.

    Parameters
    ----------
    data : xarray.Dataset
        Of `uqmbd.report.motion`.

    Returns
    -------
    array, shape (realisation, time, point, axis)
        m; directions are turned with their bodies, but not moved.
    """
    pose, local = data["pose"].values.astype(float), data["local"].values
    d = local.shape[-1]
    bodies = [str(name) for name in data["body"].values]
    result = np.empty((*pose.shape[:2], *local.shape[1:]))
    for k, body in enumerate(data["point_body"].values.astype(str)):
        if body not in bodies:
            result[:, :, k] = local[:, None, k]
            continue
        q = pose[:, :, bodies.index(body)]
        result[:, :, k] = _turned(q[..., d:], np.broadcast_to(local[:, None, k], (*q.shape[:2], d)))
        if data["point_kind"].values[k] != "direction":
            result[:, :, k] += q[..., :d]
    return result


def _turned(e: Array, vector: Array) -> Array:
    """Turn vectors (..., 2 or 3) by half-angle pairs or quaternions (..., 2 or 4); without any, nothing turns."""
    if e.shape[-1] == 0:
        return vector
    if e.shape[-1] == 2:
        c, s = e[..., 0] ** 2 - e[..., 1] ** 2, 2 * e[..., 0] * e[..., 1]
        return np.stack([c * vector[..., 0] - s * vector[..., 1], s * vector[..., 0] + c * vector[..., 1]], axis=-1)
    once = 2 * np.cross(e[..., 1:], vector)
    turned: Array = vector + e[..., :1] * once + np.cross(e[..., 1:], once)
    return turned


@dataclass(frozen=True)
class Part:
    """A component: its symbol, bodies, points and directions (indices), and where it is."""

    name: str
    symbol: str
    bodies: tuple[str, ...]
    points: tuple[int, ...]
    directions: tuple[int, ...]
    anchor: int | None
    ends: tuple[int, ...]


@dataclass(frozen=True)
class Sketch:
    """How a mechanism is drawn, for any of its poses.

    Parameters
    ----------
    data : xarray.Dataset
        Of `uqmbd.report.motion`.
    """

    data: xr.Dataset

    @cached_property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return tuple(str(name) for name in self.data["body"].values)

    @cached_property
    def kinds(self) -> list[str]:
        """What each point is."""
        return [str(kind) for kind in self.data["point_kind"].values]

    @cached_property
    def owners(self) -> list[str]:
        """Body of each point."""
        return [str(body) for body in self.data["point_body"].values]

    @cached_property
    def placed(self) -> NDArray[np.bool_]:
        """Which of the points are points, no directions."""
        return np.array([kind != "direction" for kind in self.kinds])

    def points_of(self, body: str) -> list[int]:
        """Points of a body."""
        return [k for k, owner in enumerate(self.owners) if owner == body and self.placed[k]]

    def colour(self, body: str) -> str:
        """Return the role of a body."""
        return f"c{self.bodies.index(body) % 5}" if body in self.bodies else "ground"

    def light(self, body: str) -> str:
        """Return the role of its faces."""
        return f"pale-{self.colour(body)}"

    @cached_property
    def radii(self) -> list[float]:
        """Radius of the circle about each point, m; 0 for most."""
        if "point_radius" not in self.data:
            return [0.0] * len(self.kinds)
        return [abs(float(r)) for r in self.data["point_radius"].values[0]]

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """Its components."""
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
            anchor = points[-1] if points else self._beside(name, attached, given)
            if anchor is None and len(attached[name]) == 1:
                anchor = ends[0]
            directions = tuple(k for k in given[name] if not self.placed[k])
            known = tuple(k for k in ends if k is not None)
            made.append(Part(name, str(symbol), attached[name], points, directions, anchor, known))
        return tuple(made)

    def _middle(self, body: str) -> int | None:
        """Where a body is, in one point: its centre of mass, else the first of its points."""
        points = self.points_of(body)
        heavy = [k for k in points if self.kinds[k] == "com"]
        return next(iter([*heavy, *points]), None)

    def _beside(self, name: str, attached: dict[str, tuple[str, ...]], given: dict[str, list[int]]) -> int | None:
        """Where a component without points is: at the joint between the same bodies."""
        for other, bodies in attached.items():
            if other != name and set(bodies) == set(attached[name]) and len(bodies) > 1:
                points = [k for k in given[other] if self.placed[k]]
                if points:
                    return points[-1]
        return None

    def extent(self, points: Array) -> Array:
        """Points that a picture must hold, shape (N, axis), m, from `points` (..., point, axis)."""
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
        """How far something slides along each guide over all times, m, from `points` (time, point, axis)."""
        found = {}
        for part in self.parts:
            if part.symbol in ("slide", "cylinder", "line") and len(part.points) > 1 and part.directions:
                first, second = points[:, part.points[0]], points[:, part.points[1]]
                axis = points[:, part.directions[0]]
                axis = axis / np.linalg.norm(axis, axis=-1, keepdims=True)
                along = np.sum((second - first) * axis, axis=-1)
                along = along[np.isfinite(along)]
                low, high = (float(along.min()), float(along.max())) if len(along) else (0.0, 0.0)
                # the origin of a guide is on it, unless it is far away
                found[part.name] = (min(low, 0.0), max(high, 0.0)) if min(abs(low), abs(high)) < 1.0 else (low, high)
            if part.symbol in ON_GROUND and len(part.points) > 1 and part.directions:
                offset = points[:, part.points[-1]] - points[:, part.points[0]]
                axes = [across(normal) for normal in points[:, part.directions[0]]]
                for number in range(points.shape[-1] - 1):
                    along = [float(a[number] @ x) for a, x in zip(axes, offset, strict=True) if np.isfinite(x).all()]
                    # names never contain a slash
                    found[f"{part.name}/{number}"] = (min([0.0, *along]), max([0.0, *along]))
        return found

    def draw(
        self,
        sheet: Sheet,
        points: Array,
        reaches: dict[str, tuple[float, float]] | None = None,
        thick: float = 9.5,
    ) -> Pen:
        """Draw one pose.

        Parameters
        ----------
        sheet : Sheet
            What it is drawn on.
        points : array, shape (point, axis)
            In the world, one realisation and time of `world`.
        reaches : dict, optional
            Of `reaches`, where guides shall not change with the pose.
        thick : float
            Width of links, points.
        """
        pen = Pen(sheet, thick)
        if not np.isfinite(points).all():
            return pen
        reaches = self.reaches(points[None]) if reaches is None else reaches
        middles = np.array([points[self.points_of(body)].mean(axis=0) for body in self.bodies])
        behind = np.argsort(-sheet.depth(middles), kind="stable") if sheet.spatial else range(len(self.bodies))
        boxed = {p.bodies[1] for p in self.parts if p.symbol in ("slide", "cylinder") and len(p.bodies) > 1}
        for order, k in enumerate(behind):
            body = self.bodies[k]
            mine = points[self.points_of(body)]
            if body not in boxed or len(pen.outline(mine)) > 1:
                pen.body(mine, self.colour(body), self.light(body), 2 + 0.5 * order / len(self.bodies))
        for part in self.parts:
            self._component(pen, part, points, reaches)
        joints = [k for part in self.parts for k in part.points]
        taken = sheet.project(points[joints]) if joints else np.zeros((0, 2))
        for k, kind in enumerate(self.kinds):
            if kind == "com":
                near = np.hypot(*(taken - sheet.project(points[k])).T)
                if not len(near) or near.min() > 0.1:
                    pen.centre_of_mass(points[k])
            elif kind == "observed":
                near = np.hypot(*(taken - sheet.project(points[k])).T)
                if not len(near) or near.min() > 0.1:
                    pen.dot(points[k])
        return pen

    def _component(self, pen: Pen, part: Part, points: Array, reaches: dict[str, tuple[float, float]]) -> None:
        places = [points[k] for k in part.points]
        axes = [points[k] for k in part.directions]
        axis = axes[0] if axes else None
        first, last = (places[0], places[-1]) if places else (None, None)
        at = points[part.anchor] if part.anchor is not None else None
        body = part.bodies[-1]
        if part.symbol in POINTLIKE:
            for k in part.points:
                if self.owners[k] == "ground":
                    pen.support(points[k])
        if self.data.attrs.get("note") and part.symbol in CLOSED and first is not None and last is not None:
            pen.gap(first, last)
        match part.symbol:
            case "contact" | "wheel" if first is not None:
                shown = [(low, high) for name, (low, high) in reaches.items() if name.startswith(f"{part.name}/")]
                radii, colours = (
                    [self.radii[k] for k in part.points],
                    [self.colour(self.owners[k]) for k in part.points],
                )
                turning = axes[1] if part.symbol == "wheel" and len(axes) > 1 else None
                draw_contact(pen, places, radii, colours, axis if shown else None, shown, turning)
            case "hinge" if last is not None:
                pen.hinge(last, axis)
            case "ball" if last is not None:
                pen.ball(last)
            case "universal" if last is not None:
                pen.universal(last, axes)
            case "weld" if last is not None:
                pen.weld(last)
            case "slide" | "cylinder" if first is not None and last is not None and axis is not None:
                grounded = part.bodies[0] == "ground"
                pen.guide(first, axis, reaches.get(part.name, (0.0, 0.0)), grounded=grounded)
                pen.slide(last, axis, self.light(body), round_=part.symbol == "cylinder")
            case "line" if first is not None and last is not None and axis is not None:
                pen.line(first, axis, reaches.get(part.name, (0.0, 0.0)))
                pen.dot(last)
            case "skate" if last is not None and axis is not None:
                pen.blade(last, axis)
            case "plane" if first is not None and last is not None and axis is not None:
                pen.plane(first, axis, last)
                pen.dot(last)
            case "rod" if first is not None and last is not None:
                pen.rod(first, last)
            case "spring" if first is not None and last is not None:
                pen.spring(first, last)
            case "damper" if first is not None and last is not None:
                pen.damper(first, last)
            case "coil" if at is not None:
                pen.coil(at, axis)
            case "driver" if first is not None and last is not None and len(places) > 1:
                pen.push(first, last, axis)
            case "driver" | "torque" if at is not None:
                pen.arc(at, axis)
            case "force" if at is not None:
                pen.force(at, axis)
            case _:
                self._other(pen, part, places, points)

    def _other(self, pen: Pen, part: Part, places: list[Any], points: Array) -> None:
        """Draw what has no symbol: where it attaches, or between which bodies it is."""
        if len(places) > 1:
            pen.link(places[0], places[-1])
        elif not places and len(part.ends) > 1:
            pen.link(points[part.ends[0]], points[part.ends[-1]])
        if places:
            pen.diamond(places[-1])

    def labels(self, sheet: Sheet, points: Array) -> list[Label]:
        """Names of the bodies, then of the components, each with the place on the page that it names."""
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
