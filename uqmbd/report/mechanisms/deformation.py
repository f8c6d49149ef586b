"""Points that move in their bodies by coordinates of components, such as the nodes of a flexible body."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.typing import Array

if TYPE_CHECKING:
    import sympy
    import xarray as xr

    from uqmbd.mechanism import CoordinateSet, Mark, Mechanism
    from uqmbd.report.mechanisms.pose_data import PoseData

__all__ = [
    "MAGNIFIED",
    "coordinate_sets",
    "displaced_points",
    "displacement_entries",
    "displacements",
    "in_the_plane",
    "magnification",
    "rest_points",
]

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


def rest_points(mechanism: Mechanism, marks: Sequence[Mark]) -> list[sympy.Expr]:
    """Return the coordinates of points in the frames of their bodies, at zero coordinates of components."""
    zero: dict[Any, Any] = {symbol: 0 for one in coordinate_sets(mechanism) for symbol in one.q}
    return [x.xreplace(zero) for mark in marks for x in mark.moving or mark.local]


def displacement_entries(mechanism: Mechanism, time: float) -> dict[tuple[int, int], sympy.Expr]:
    """Return the displacements of points that move in their bodies, relative to their points at zero coordinates.

    The keys are the index of the point among the moving points, and the axis of its body. Displacements that are always
    zero are omitted. `time` is the initial time, s.
    """
    from uqmbd.mechanism import collect_skeleton

    symbols = {symbol for one in coordinate_sets(mechanism) for symbol in one.q}
    marks = [mark for mark in collect_skeleton(mechanism, time) if mark.moving]
    rest = iter(rest_points(mechanism, marks))
    found = {(n, axis): x - next(rest) for n, mark in enumerate(marks) for axis, x in enumerate(mark.moving)}
    return {key: x for key, x in found.items() if x.free_symbols & symbols}


def displacements(mechanism: Mechanism, entries: Sequence[sympy.Expr], q: Array, values: Array) -> Array:
    """Return displacements (realisation, time, entry), m.

    `entries` are expressions in random variables and in coordinates of components. `q` (realisation, time, coordinate)
    contains the coordinates of bodies and components, and `values` (realisation, input) the inputs.
    """
    from uqmbd.dynamics import ParameterMap

    symbols = [symbol for one in coordinate_sets(mechanism) for symbol in one.q]
    first = len(mechanism.bodies) * mechanism.space.size
    own = q[..., first : first + len(symbols)]
    given = ParameterMap.of(entries, [*mechanism.inputs.variables, *symbols])
    inputs = np.broadcast_to(values[:, None, :], (*own.shape[:2], values.shape[1]))
    rows = np.concatenate([inputs, own], axis=-1).reshape(-1, values.shape[1] + len(symbols))
    return given(rows).reshape(*own.shape[:2], len(entries))


def displaced_points(
    mechanism: Mechanism, marks: Sequence[Mark], q: Array, values: Array, local: Array
) -> dict[str, Any]:
    """Return displacements of points relative to `local` as variables of a dataset; empty if no point moves.

    `q` (realisation, time, coordinate) contains the coordinates of bodies and components. `values` (realisation, input)
    are inputs. `local` (realisation, point, axis), m, contains the points at zero coordinates of components.
    """
    places = [k for k, mark in enumerate(marks) if mark.moving]
    if not places:
        return {}
    moved = displacements(mechanism, [x for k in places for x in marks[k].moving], q, values)
    moved = in_the_plane(mechanism, moved.reshape(*moved.shape[:2], len(places), -1))
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
