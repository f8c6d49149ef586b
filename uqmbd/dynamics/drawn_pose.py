"""Given pose: known points of bodies, size of the mechanism, and displacements of bodies by the assembly."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy

from uqmbd.dynamics.assembly import positions
from uqmbd.dynamics.equations import Model
from uqmbd.errors import StudyError
from uqmbd.mechanism import Frame, Mark, Mechanism, carrier_name, collect_skeleton, nominal
from uqmbd.typing import Array

__all__ = ["Move", "apart", "extent_of", "drawn_points", "moved", "moves", "size_of"]

MOVED = 0.01
"""Displacement by the assembly, relative to the size of the given pose, that counts as zero."""

TILTED = np.radians(1)
"""Rotation in rad by the assembly that counts as zero."""


@dataclass(frozen=True)
class Move:
    """Displacement of a body from its given pose by the assembly, at the means of the inputs."""

    body: str
    distance: float  # displacement of the frame's origin, in `units`
    turn: float  # angle of the rotation, rad, from 0 to pi
    units: str = "m"  # units of `distance`
    coordinate: bool = False  # whether `body` is a coordinate of a component, and `distance` its change

    def __str__(self) -> str:
        parts = [f"by {self.distance:.3g} {self.units}"] if self.distance > 0 else []
        parts += [f"by {np.degrees(self.turn):.3g} degrees"] if self.turn > 1e-3 else []
        return f"{self.body!r} {' and '.join(parts)}"


def moves(bodies: Sequence[str], dimension: int, drawn: Array, assembled: Array) -> tuple[Move, ...]:
    """Compare a drawn and an assembled pose, (body, coordinate) each; return one move for each body."""
    d, found = dimension, []
    for name, before, after in zip(bodies, drawn, assembled, strict=True):
        e, f = (x[d:] / (np.linalg.norm(x[d:]) or 1.0) for x in (before, after))
        apart, together = sorted((float(np.linalg.norm(e - f)), float(np.linalg.norm(e + f))))  # either sign
        turn = 4 * math.atan2(apart, together)
        found.append(Move(name, float(np.linalg.norm(after[:d] - before[:d])), turn))
    return tuple(found)


def drawn_points(mechanism: Mechanism) -> dict[str, list[tuple[Mark, Array]]]:
    """Return the known, finite points of each body in m, in the given pose at the means."""
    poses: dict[str, Sequence[sympy.Expr]] = {name: body.pose.q for name, body in mechanism.bodies.items()}
    poses["ground"] = mechanism.ground.q
    frames: dict[str, Frame] = {}
    found: dict[str, list[tuple[Mark, Array]]] = {}
    for mark in collect_skeleton(mechanism):
        if mark.kind in ("direction", "node"):
            continue
        try:
            if mark.body not in frames:  # convert to numbers first, because SymPy rotates expressions slowly
                frames[mark.body] = Frame(mechanism.space, [nominal(x) for x in poses[mark.body]])
            place = [float(x) for x in frames[mark.body].point([nominal(x) for x in mark.local])]
        except StudyError:  # not finite at the means; reported elsewhere
            continue
        found.setdefault(mark.body, []).append((mark, np.array(place)))
    return found


def extent_of(places: Sequence[Array]) -> float:
    """Return the diagonal of the box around points, m; 0 without points."""
    return float(np.linalg.norm(np.ptp(np.array(places), axis=0))) if places else 0.0


def size_of(mechanism: Mechanism) -> float:
    """Return the largest extent in m of the given pose at the means, from all known points of the bodies."""
    return extent_of([place for found in drawn_points(mechanism).values() for _, place in found])


def moved(mechanism: Mechanism, model: Model, size: float | None = None) -> tuple[Move, ...]:
    """Return bodies noticeably moved by the assembly at the means; moves by start conditions are intended."""
    parameters = model.parameters(mechanism.inputs.means[None, :])
    drawn = parameters[:, model.drawn]
    free = replace(model, conditions=None)
    q, _ = positions(free, drawn, model.time, parameters, model.layout.independent_holonomic)
    pairs = moves(model.bodies, model.dimension, model.by_body(drawn[0]), model.by_body(q[0]))
    found = [m for m in pairs if m.turn > TILTED or m.distance > 1e-9]
    limit = 0.0
    if found:  # this is slow in SymPy
        limit = MOVED * (size_of(mechanism) if size is None else size)
    apart = tuple(m for m in found if m.turn > TILTED or m.distance > max(limit, 1e-9))
    return apart + _changed(model, drawn[0], q[0])


def _changed(model: Model, drawn: Array, assembled: Array) -> tuple[Move, ...]:
    """Return coordinates of components with a stated value, other than zero, that the assembly noticeably changed."""
    before, after = (x[model.of_bodies :] for x in (drawn, assembled))
    return tuple(
        Move(f"{component}.{name}", float(abs(y - x)), 0.0, units, coordinate=True)
        for (component, name, units), x, y in zip(model.own, before, after, strict=True)
        if x != 0 and abs(y - x) > MOVED * abs(x)
    )


def apart(mechanism: Mechanism) -> tuple[tuple[str, ...], ...]:
    """Return groups of bodies without connections by components to each other or the ground."""
    group = {name: {name} for name in ("ground", *mechanism.bodies)}
    for component in mechanism.components.values():
        names = [carrier_name(component.attached[role]) for role in component.bodies]
        joined = set().union(*(group[name] for name in names))
        group |= dict.fromkeys(joined, joined)
    found = {name: tuple(n for n in mechanism.bodies if n in group[name]) for name in mechanism.bodies}
    return tuple(dict.fromkeys(names for name, names in found.items() if name not in group["ground"]))
