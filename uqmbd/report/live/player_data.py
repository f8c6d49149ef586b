"""Data for the player of a mechanism, as JSON that `player.js` reads."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.report.charts import packed, packed_within
from uqmbd.report.drawing import ROLES, mixed
from uqmbd.report.mechanisms import Film, PoseData, Sketch, magnification
from uqmbd.report.stored_motion import NamedPose, named_poses, without_named
from uqmbd.typing import Array

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.report.mechanisms import Stroke

__all__ = ["collect_player_data"]

MOST_NUMBERS = 250_000
"""Maximum number of pose values in a page (1.3 MB); above it, the page contains fewer realisations."""

RESOLVED = 2e-5
"""Allowed error of positions, relative to the extent of the drawing: 1/50 of a pixel if the drawing has 1000 pixels."""


def collect_player_data(motion: xr.Dataset | PoseData, most: int = MOST_NUMBERS) -> dict[str, Any]:
    """Return the poses of a mechanism, and the style in which they are drawn.

    `motion` is the result of `uqmbd.report.motion`, the node ``motion`` of results, or a drawn pose. `most` is the
    maximum number of pose values. These keys of the result need an explanation:

    ``poses``: array (realisation, time, body, width). The first realisation is at the means. After ``realisations``
    unnamed realisations come the named realisations. ``named``: names of these, with their times, s. ``local``: points
    (realisation, point, axis) in the frames of the bodies. ``owners``: index of the body of each point; -1 is the
    ground. ``symbols``: strokes, whose points are indices in ``lists``, the lists of points. ``roles``: colours on a
    light and on a dark page. ``corners``: points of each outline; ``outlined``: its body. ``bounds``: bounds of the
    drawing. ``start``: index of the time with the largest distance between realisations. ``solids``: surfaces of
    shapes, only if bodies have shapes. ``displaced``: displacements of points that move in their bodies, and the factor
    that magnifies them; ``lines``: lines through points that show each body. Both are present only if points move.
    """
    named: list[NamedPose] = []
    others = motion
    if not isinstance(motion, PoseData):
        named, others = named_poses(motion), without_named(motion)
    size = motion["pose"][0].size + (motion["displacement"][0].size if "displacement" in motion else 0)
    room = most // max(size, 1) - len(named)
    count = int(np.clip(room, 1, others.sizes["realisation"]))
    data = others.isel(realisation=slice(0, count))
    rows = [one.realisation for one in named]
    shown = motion.isel(realisation=[*[k for k in range(len(motion["pose"])) if k not in rows][:count], *rows])
    film = Film(data, 6.4, 100)
    sketch = film.sketch
    number = {name: k for k, name in enumerate(sketch.bodies)}
    bounds = Film(shown, 6.4, 100).bounds
    symbols, lists = _symbols(film.strokes)
    roles = {role for stroke in film.strokes for role in (stroke.edge, stroke.face)}
    bodies = [sketch.colour(body) for body in sketch.bodies]
    roles |= {*bodies, *(f"pale-{role}" for role in bodies)}
    found: dict[str, Any] = {
        "mechanism": str(data.attrs.get("mechanism", "")),
        "bodies": list(number),
        "roles": {role: list(ROLES[role]) for role in sorted(filter(ROLES.get, map(str, roles)))},
        "colours": bodies,
        "clouds": [[mixed(a, b, 0.3) for a, b in zip(ROLES[role], ROLES["ink"], strict=True)] for role in bodies],
        "dimension": data.sizes["axis"],
        "width": data.sizes["coordinate"],
        "realisations": count,
        "times": packed(data["time"].values),
        "named": [{"name": one.name, "time": one.time} for one in named],
        "poses": _packed_poses(shown["pose"].values, bounds, data.sizes["axis"]),
        "local": packed(shown["local"].values, "float32"),
        "radii": sketch.radii,
        "kinds": sketch.kinds,
        "owners": [number.get(owner, -1) for owner in sketch.owners],
        "symbols": symbols,
        "lists": lists,
        "joints": sketch.joints,
        "boxed": [number[body] for body in sorted(sketch.boxed & set(number))],
        "corners": [list(map(int, corners)) for _, corners in film.corners],
        "outlined": [number[body] for body, _ in film.corners],
        "bounds": [bounds.min(axis=0).tolist(), bounds.max(axis=0).tolist()],
        "followed": film.followed,
        "moving": film.moving,
        "start": film.widest,
    }
    return found | ({"solids": _solids(data)} if sketch.shaped else {}) | _deformation(shown, sketch, bounds)


def _deformation(data: xr.Dataset | PoseData, sketch: Sketch, bounds: Array) -> dict[str, Any]:
    """Return points that move in their bodies: displacements, lines through them, and a factor that makes them visible.

    The result is empty if no point moves.
    """
    if "displacement" not in data:
        return {}
    size, values = float(np.ptp(bounds, axis=0).max(initial=0.0)) or 1.0, data["displacement"].values
    factor = magnification(data, size)
    flat = packed_within(
        values.reshape(*values.shape[:2], -1), RESOLVED * size / factor, "float32", lags=[values[0, 0].size]
    )
    return {
        "displaced": {
            "points": data["moved_point"].values.tolist(),
            "values": flat | {"shape": list(values.shape)},
            "factor": factor,
        },
        "lines": [sketch.lines.get(body, []) for body in sketch.bodies],
    }


def _solids(data: xr.Dataset | PoseData) -> dict[str, Any]:
    """Return the surfaces of shapes: vertices, first corner of the shape of each vertex, and triangles."""
    return {
        "vertices": packed(data["solid_vertex"].values, "float32"),
        "corners": packed(data["solid_corner"].values, "int32"),
        "faces": packed(data["solid_face"].values, "int32"),
    }


def _packed_poses(poses: Array, bounds: Array, dimension: int) -> dict[str, Any]:
    """Pack poses (realisation, time, body, width) with the resolution of a screen: positions and rotations."""
    allowed = np.full(poses.shape[2:], RESOLVED)
    # rotation errors move a point by at most the error times the width of the drawing
    allowed[:, :dimension] *= float(np.ptp(bounds, axis=0).max(initial=0.0)) or 1.0
    flat = packed_within(poses.reshape(*poses.shape[:2], -1), allowed.ravel(), "float32", lags=[allowed.size])
    return flat | {"shape": list(poses.shape)}


def _symbols(strokes: Sequence[Stroke]) -> tuple[list[dict[str, Any]], list[Any]]:
    """Return strokes without default values, and the shared lists of their points."""
    lists: dict[str, int] = {}
    found = []
    for stroke in strokes:
        one: dict[str, Any] = {}
        for given in fields(stroke):
            value = getattr(stroke, given.name)
            if isinstance(value, np.ndarray):
                # round inches to 1e-4; lengths in metres may have any magnitude, so shorten their digits
                known = np.round(value, 4) + 0.0 if given.name != "metres" else np.vectorize(_short)(value)
                text = json.dumps(known.tolist())
                one[given.name] = lists.setdefault(text, len(lists))
            elif value != given.default:
                one[given.name] = value
        found.append(one)
    return found, [json.loads(text) for text in lists]


def _short(value: float) -> float:
    return float(f"{value:.7g}")
