"""What the player of a mechanism draws, as data for JSON: `player.js` reads it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.report.charts import packed
from uqmbd.report.drawing import ROLES
from uqmbd.report.mechanisms import Film

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.report.mechanisms import Part

__all__ = ["player_data"]

MOST_NUMBERS = 250_000
"""Numbers of poses in a page, which are 1.3 MB; of more, fewer realisations are shown."""


def player_data(motion: xr.Dataset, most: int = MOST_NUMBERS) -> dict[str, Any]:
    """Return poses of a mechanism, and how they are drawn.

    Parameters
    ----------
    motion : xarray.Dataset
        Of `uqmbd.report.motion`, or the node ``motion`` of results.
    most : int
        Numbers of poses that there is room for.

    Returns
    -------
    dict
        ``poses`` (realisation, time, body, width), the first of which is at the means; ``local`` (realisation, point,
        axis) in the frames of the bodies; ``owners``, numbers of bodies, -1 is the ground; ``parts``, the components;
        ``corners``, the points that outline each body; ``bounds`` of all that is drawn; ``start``, the frame at which
        realisations are farthest apart.
    """
    count = int(np.clip(most // max(motion["pose"][0].size, 1), 1, motion.sizes["realisation"]))
    data = motion.isel(realisation=slice(0, count))
    film = Film(data, 6.4, 100)
    sketch = film.sketch
    number = {name: k for k, name in enumerate(sketch.bodies)}
    reaches = film.reaches
    bounds = film.bounds
    return {
        "mechanism": str(data.attrs.get("mechanism", "")),
        "bodies": list(number),
        "colours": [list(ROLES[sketch.colour(body)]) for body in sketch.bodies],
        "dimension": data.sizes["axis"],
        "width": data.sizes["coordinate"],
        "realisations": count,
        "times": packed(data["time"].values),
        "poses": packed(data["pose"].values, "float32"),
        "local": packed(data["local"].values, "float32"),
        "radii": sketch.radii,
        "kinds": sketch.kinds,
        "owners": [number.get(owner, -1) for owner in sketch.owners],
        "parts": [_part(part, number, reaches) for part in sketch.parts],
        "corners": [list(map(int, corners)) for _, corners in film.corners],
        "bounds": [bounds.min(axis=0).tolist(), bounds.max(axis=0).tolist()],
        "followed": film.followed,
        "moving": film.moving,
        "start": film.widest,
    }


def _part(part: Part, number: dict[str, int], reaches: dict[str, tuple[float, float]]) -> dict[str, Any]:
    return {
        "symbol": part.symbol,
        "bodies": [number.get(body, -1) for body in part.bodies],
        "points": list(part.points),
        "directions": list(part.directions),
        "anchor": part.anchor,
        "ends": list(part.ends),
        "reach": list(reaches.get(part.name, (0.0, 0.0))),
        # names never contain a slash
        "planes": [list(ends) for name, ends in reaches.items() if name.startswith(f"{part.name}/")],
    }
