"""What the player of a mechanism draws, as data for JSON: `player.js` reads it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.report.charts import packed
from uqmbd.report.drawing import ROLES, mixed
from uqmbd.report.mechanisms import Film

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.report.mechanisms import Stroke

__all__ = ["collect_player_data"]

MOST_NUMBERS = 250_000
"""Numbers of poses in a page, which are 1.3 MB; of more, fewer realisations are shown."""


def collect_player_data(motion: xr.Dataset, most: int = MOST_NUMBERS) -> dict[str, Any]:
    """Return poses of a mechanism, and how they are drawn.

    `motion`: of `uqmbd.report.motion`, or the node ``motion`` of results; `most`: numbers of poses that there is room
    for. Return ``poses`` (realisation, time, body, width), the first of which is at the means; ``local``
    (realisation, point, axis) in the frames of the bodies; ``owners``, numbers of bodies, -1 is the ground;
    ``symbols``, strokes whose points are numbers of ``lists``; ``roles``, colours on a light and on a dark page;
    ``corners``, the points that outline each body; ``bounds`` of all that is drawn; ``start``, the frame at which
    realisations are farthest apart.
    """
    count = int(np.clip(most // max(motion["pose"][0].size, 1), 1, motion.sizes["realisation"]))
    data = motion.isel(realisation=slice(0, count))
    film = Film(data, 6.4, 100)
    sketch = film.sketch
    number = {name: k for k, name in enumerate(sketch.bodies)}
    bounds = film.bounds
    symbols, lists = _symbols(film.strokes)
    roles = {role for stroke in film.strokes for role in (stroke.edge, stroke.face)}
    bodies = [sketch.colour(body) for body in sketch.bodies]
    roles |= {*bodies, *(f"pale-{role}" for role in bodies)}
    return {
        "mechanism": str(data.attrs.get("mechanism", "")),
        "bodies": list(number),
        "roles": {role: list(ROLES[role]) for role in sorted(filter(ROLES.get, map(str, roles)))},
        "colours": bodies,
        "clouds": [[mixed(a, b, 0.3) for a, b in zip(ROLES[role], ROLES["ink"], strict=True)] for role in bodies],
        "dimension": data.sizes["axis"],
        "width": data.sizes["coordinate"],
        "realisations": count,
        "times": packed(data["time"].values),
        "poses": packed(data["pose"].values, "float32"),
        "local": packed(data["local"].values, "float32"),
        "radii": sketch.radii,
        "kinds": sketch.kinds,
        "owners": [number.get(owner, -1) for owner in sketch.owners],
        "symbols": symbols,
        "lists": lists,
        "joints": sketch.joints,
        "boxed": [number[body] for body in sorted(sketch.boxed & set(number))],
        "corners": [list(map(int, corners)) for _, corners in film.corners],
        "bounds": [bounds.min(axis=0).tolist(), bounds.max(axis=0).tolist()],
        "followed": film.followed,
        "moving": film.moving,
        "start": film.widest,
    }


def _symbols(strokes: Sequence[Stroke]) -> tuple[list[dict[str, Any]], list[Any]]:
    """Return strokes without what is as usual, and the lists of points that they have: many are the same."""
    lists: dict[str, int] = {}
    found = []
    for stroke in strokes:
        one: dict[str, Any] = {}
        for given in fields(stroke):
            value = getattr(stroke, given.name)
            if isinstance(value, np.ndarray):
                # 1e-4 of an inch; lengths in metres may be of any size
                known = np.round(value, 4) + 0.0 if given.name != "metres" else np.vectorize(_short)(value)
                text = json.dumps(known.tolist())
                one[given.name] = lists.setdefault(text, len(lists))
            elif value != given.default:
                one[given.name] = value
        found.append(one)
    return found, [json.loads(text) for text in lists]


def _short(value: float) -> float:
    return float(f"{value:.7g}")
