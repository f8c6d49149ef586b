"""Points that move in their bodies by coordinates of components, such as the nodes of a flexible body."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.typing import Array

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.mechanism import CoordinateSet, Mark, Mechanism
    from uqmbd.report.mechanisms.pose_data import PoseData

__all__ = ["MAGNIFIED", "coordinate_sets", "displaced_points", "in_the_plane", "magnification"]

MAGNIFIED = 0.05
"""Largest magnified displacement, relative to the extent of the drawing."""


def coordinate_sets(mechanism: Mechanism) -> list[CoordinateSet]:
    """Return the coordinates of components, in the order in which they follow the coordinates of bodies."""
    from uqmbd.mechanism import CoordinateSet

    return [one for one in mechanism.coordinate_owners() if isinstance(one, CoordinateSet)]


def in_the_plane(mechanism: Mechanism, positions: Array) -> Array:
    """Map positions (..., axes) on a line into the plane: upwards with gravity, otherwise to the right."""
    space = mechanism.space
    if space.dimension > 1:
        return positions
    x = positions[..., :1]
    return np.concatenate([x, 0 * x] if space.gravity[0].is_zero else [0 * x, x], axis=-1)


def displaced_points(
    mechanism: Mechanism, marks: Sequence[Mark], q: Array, values: Array, local: Array
) -> dict[str, Any]:
    """Return displacements of points relative to `local` as variables of a dataset; empty if no point moves.

    `q` (realisation, time, coordinate) contains the coordinates of bodies and components; it may end after the bodies,
    and the points are then fixed. `values` (realisation, input) are inputs.  `local` (realisation, point, axis), m, is
    changed: points that move become their points at zero coordinates.
    """
    from uqmbd.dynamics import ParameterMap

    symbols = [symbol for one in coordinate_sets(mechanism) for symbol in one.q]
    places = [k for k, mark in enumerate(marks) if mark.moving]
    first = len(mechanism.bodies) * mechanism.space.size
    if not places or q.shape[-1] < first + len(symbols):
        return {}
    given = ParameterMap.of([x for k in places for x in marks[k].moving], [*mechanism.inputs.variables, *symbols])
    own = q[..., first : first + len(symbols)]
    inputs = np.broadcast_to(values[:, None, :], (*own.shape[:2], values.shape[1]))
    rows = np.concatenate([inputs, own], axis=-1).reshape(-1, values.shape[1] + len(symbols))
    moved = in_the_plane(mechanism, given(rows).reshape(*own.shape[:2], len(places), -1))
    still = given(np.concatenate([values, np.zeros((len(values), len(symbols)))], axis=1))
    local[:, places] = in_the_plane(mechanism, still.reshape(len(values), len(places), -1))
    return {
        "moved_point": ("moved", np.array(places, dtype=np.int32)),
        "displacement": (
            ("realisation", "time", "moved", "axis"),
            (moved - local[:, None, places]).astype(np.float32),
            {"units": "m", "comment": "in the axes of the body, relative to local"},
        ),
    }


def magnification(data: xr.Dataset | PoseData, size: float) -> float:
    """Return the factor (1, 2 or 5 times a power of 10) that makes the displacements of a motion visible.

    `size` is the extent of the drawing, m.

    >>> import xarray as xr
    >>> data = xr.Dataset({"displacement": (("realisation", "time", "moved", "axis"), [[[[0.0, 1e-4]]]])})
    >>> magnification(data, 1.0)
    500.0
    """
    if "displacement" not in data:
        return 1.0
    largest = float(np.nanmax(np.linalg.norm(data["displacement"].values.astype(float), axis=-1), initial=0.0))
    wanted = MAGNIFIED * size / largest if largest > 0 else 1.0
    if not 1 < wanted < 1e12:
        return 1.0
    power = 10.0 ** np.floor(np.log10(wanted) + 1e-9)
    return float(max(k for k in (1, 2, 5) if k * power <= wanted * (1 + 1e-9)) * power)
