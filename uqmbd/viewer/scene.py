"""Data of the viewer's page: pose, parts and inputs of a mechanism, and displacements of bodies by the assembly."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.dynamics import ParameterMap, moves
from uqmbd.mechanism import carrier_name
from uqmbd.report.live import collect_player_data
from uqmbd.report.mechanisms import CLOSED, Sketch, drawn_pose, stated_pose, world
from uqmbd.typing import Array

if TYPE_CHECKING:
    from uqmbd.mechanism import Body, Mechanism
    from uqmbd.propagation import Study
    from uqmbd.report.mechanisms import PoseData

__all__ = ["motion_scene", "pose_scene", "structure"]

ENDS = (0.001, 0.999)
"""Probabilities of the quantiles of an input at the ends of its slider."""

CLOSE = 1e-6
"""Distance up to which two points coincide, relative to the size of the mechanism."""

SLACK = 1e-9
"""Magnitude of a negative squared semi-axis, relative to the largest one, up to which it counts as rounding."""


def structure(mechanism: Mechanism, study: Study | None) -> dict[str, Any]:
    """Return the parts and the inputs of a mechanism, which do not change with the values of its inputs."""
    from uqmbd.report.mechanisms import stated_pose

    sketch = Sketch(stated_pose(mechanism, time=_start(study)))
    symbols = {part.name: part for part in sketch.parts}
    used = {name for component in mechanism.components.values() for name in _bodies(component)}
    return {
        "mechanism": mechanism.name,
        "study": None if study is None else study.name,
        "space": mechanism.space.name,
        "times": None if study is None or len(study.times) < 2 else [float(study.times[0]), float(study.times[-1])],
        "bodies": [{"name": name, "free": name not in used} for name in mechanism.bodies],
        "components": [
            {
                "name": name,
                "type": type(component).__name__,
                "bodies": _bodies(component),
                "points": [*symbols[name].points, *([] if symbols[name].points else symbols[name].ends)],
                "directions": list(symbols[name].directions),
            }
            for name, component in mechanism.components.items()
        ],
        "inputs": _inputs(mechanism),
        "outputs": [*mechanism.outputs, *mechanism.scalars],
    }


def pose_scene(mechanism: Mechanism, values: Mapping[str, float], time: float) -> dict[str, Any]:
    """Return the assembled and the given pose of a mechanism at values of its inputs.

    The key ``gaps`` lists joints whose points do not coincide in the given pose, and whether the assembly closed the
    joints. ``moved`` lists displacements of bodies by the assembly.
    """
    assembled, stated = drawn_pose(mechanism, values, time), stated_pose(mechanism, values, time)
    note = str(assembled.attrs["note"])
    return {
        "note": note,
        "player": collect_player_data(assembled),
        "stated": collect_player_data(stated),
        "ellipsoids": _ellipsoids(mechanism, assembled),
        "gaps": _gaps(stated, closed=not note),
        "moved": [] if note else _moved(mechanism, stated, assembled),
        "values": _values(assembled),
    }


def motion_scene(mechanism: Mechanism, motion: PoseData) -> dict[str, Any]:
    """Return a motion of a mechanism as data of the page."""
    return {
        "player": collect_player_data(motion),
        "ellipsoids": _ellipsoids(mechanism, motion),
        "stopped": str(motion.attrs.get("stopped", "")),
        "values": _values(motion),
    }


def _start(study: Study | None) -> float:
    return 0.0 if study is None or not len(study.times) else float(study.times[0])


def _bodies(component: Any) -> list[str]:
    return [carrier_name(component.attached[role]) for role in component.bodies]


def _values(data: PoseData) -> dict[str, float]:
    if "inputs" not in data:
        return {}
    return {str(name): float(x) for name, x in zip(data["input"].values, data["inputs"].values[0], strict=True)}


def _inputs(mechanism: Mechanism) -> list[dict[str, Any]]:
    """Return name, units, mean and slider range of each random input, with the other inputs at their medians."""
    inputs = mechanism.inputs
    count = len(inputs)
    if not count:
        return []
    levels = np.full((2 * count, count), 0.5)
    for k in range(count):
        levels[2 * k : 2 * k + 2, k] = ENDS
    ends = inputs.from_uniform(levels)
    found = []
    for k, variable in enumerate(inputs.variables):
        low, high = sorted(ends[2 * k : 2 * k + 2, k].tolist())
        mean = float(inputs.means[k])
        found.append(
            {
                "name": variable.name,
                "units": variable.units,
                "description": variable.description,
                "mean": mean,
                "low": min(low, mean),
                "high": max(high, mean),
            }
        )
    return found


def _gaps(stated: PoseData, *, closed: bool) -> list[dict[str, Any]]:
    """Return joints whose points should coincide but do not in the given pose, with the distance of the points, m."""
    sketch, points = Sketch(stated), world(stated)[0, 0]
    size = float(np.linalg.norm(np.ptp(sketch.extent(points), axis=0))) or 1.0
    found = []
    for part in sketch.parts:
        if part.symbol in CLOSED and len(part.points) > 1:
            distance = float(np.linalg.norm(points[part.points[0]] - points[part.points[-1]]))
            if distance > CLOSE * size:
                found.append({"component": part.name, "distance": distance, "closed": closed})
    return sorted(found, key=lambda one: -float(one["distance"]))


def _moved(mechanism: Mechanism, stated: PoseData, assembled: PoseData) -> list[dict[str, Any]]:
    """Return displacements of bodies by the assembly: distance of the origin in m, and angle in rad."""
    before, after = (data["pose"].values[0, 0].astype(float) for data in (stated, assembled))
    found = moves(list(mechanism.bodies), stated.sizes["axis"], before, after)
    size = float(np.linalg.norm(np.ptp(Sketch(stated).extent(world(stated)[0, 0]), axis=0))) or 1.0
    return [
        {"body": one.body, "distance": one.distance, "turn": one.turn, "text": str(one)}
        for one in found
        if one.distance > CLOSE * size or one.turn > 1e-3
    ]


def _ellipsoids(mechanism: Mechanism, data: PoseData) -> list[dict[str, Any] | None]:
    """Return centre of mass and ellipsoid of each body, in its frame; None for a body without mass.

    The ellipsoid is the solid of uniform density with the mass and the inertia of the body; in the plane it is a disc.
    ``axes`` contains its semi-axes as columns of a matrix, m.
    """
    values = data["inputs"].values[:1] if "inputs" in data else np.zeros((1, 0))
    return [_ellipsoid(body, mechanism, values) for body in mechanism.bodies.values()]


def _ellipsoid(body: Body, mechanism: Mechanism, values: Array) -> dict[str, Any] | None:
    entries = body.terms.inertia or ()
    numbers = ParameterMap.of([body.mass, *body.com, *entries], mechanism.inputs.variables)(values)[0]
    mass, d = float(numbers[0]), mechanism.space.dimension
    centre, moments = numbers[1 : 1 + d], numbers[1 + d :]
    if not mass > 0 or not np.isfinite(numbers).all():
        return None
    found: dict[str, Any] = {"mass": mass, "com": centre.tolist(), "inertia": moments.tolist(), "axes": None}
    if d == 1:
        upright = mechanism.space.gravity[0] != 0
        found["com"] = [0.0, float(centre[0])] if upright else [float(centre[0]), 0.0]
    if len(moments) == 1 and moments[0] > 0:
        found["axes"] = (np.sqrt(2 * moments[0] / mass) * np.eye(2)).tolist()
    if len(moments) == 6:
        xx, yy, zz, xy, xz, yz = moments
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        principal, turned = np.linalg.eigh(tensor)
        squares = 2.5 / mass * (principal.sum() - 2 * principal)
        if squares.max() > 0 and squares.min() > -SLACK * squares.max():
            found["axes"] = (turned * np.sqrt(np.maximum(squares, 0.0))).tolist()
    return found
