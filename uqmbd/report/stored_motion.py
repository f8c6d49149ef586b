"""Named realisations of the node ``motion`` of results: their list, and the motion without them."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
import xarray as xr

__all__ = ["NamedPose", "named_poses", "without_named"]


@dataclass(frozen=True)
class NamedPose:
    """Entry of the attribute ``named`` of a stored motion: index of the realisation, name, and time, s."""

    realisation: int
    name: str
    time: float
    pictured: bool


def named_poses(data: xr.Dataset) -> list[NamedPose]:
    """Return the named realisations of a stored motion; none if another program wrote the attribute."""
    try:
        found = [
            NamedPose(int(one["realisation"]), str(one["name"]), float(one["time"]), bool(one.get("pictured", True)))
            for one in json.loads(str(data.attrs.get("named", "[]")))
        ]
    except (AttributeError, KeyError, OverflowError, TypeError, ValueError):
        return []
    return [one for one in found if 0 < one.realisation < data.sizes.get("realisation", 0) and np.isfinite(one.time)]


def without_named(data: xr.Dataset) -> xr.Dataset:
    """Return poses without the named realisations, which are not samples of the inputs."""
    rows = {one.realisation for one in named_poses(data)}
    if not rows:
        return data
    found = data.isel(realisation=[k for k in range(data.sizes["realisation"]) if k not in rows])
    found.attrs = {name: value for name, value in data.attrs.items() if name != "named"}
    return found
