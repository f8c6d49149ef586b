"""Points of bodies for figures, from the description of a mechanism."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.bodies import AttachedFrame, Body, carrier_name, local_in_body
from uqmbd.mechanism.components import Component, CoordinateSet, StateSymbol
from uqmbd.mechanism.expressions import as_symbolic, t
from uqmbd.mechanism.mechanism import Mechanism
from uqmbd.randomness import RandomVariable

__all__ = ["Mark", "collect_skeleton"]

QUARTER_TURNS = {2: ((1, 0), (1, 1)), 3: ((1, 0, 0, 0), (1, 1, 0, 0), (1, 0, 1, 0), (1, 0, 0, 1))}
"""Quaternions, not normalised, of the rotations of every axis onto every other axis."""


@dataclass(frozen=True)
class Mark:
    """Point or direction fixed in a body."""

    # "point", "direction", "com" (centre of mass), "corner" (of a shape), "observed" (a point of an output), "node" (of
    # a line of a deformable body)
    kind: str
    body: str  # name of the body, or "ground"
    component: str  # name of the owning component, or empty
    role: str  # name of the component's parameter, or of the output
    # coordinates in the frame of the body, m, as expressions in random variables; a direction has any length
    local: tuple[sympy.Expr, ...]
    radius: sympy.Expr = sympy.S.Zero  # radius of the sphere or wheel about a point, m; 0 for most points
    # for a point that moves in its body: its coordinates as expressions in coordinates of components as well
    moving: tuple[sympy.Expr, ...] = ()


def collect_skeleton(mechanism: Mechanism, time: float = 0.0) -> list[Mark]:
    """Collect the known shape of each body: joint points, ends of springs, centres of mass, observed points.

    Points and directions of a component are its parameters of the kinds ``point``, ``axis``,
    ``turning_axis`` or ``vector``.  They are in the frame of the body argument that `Parameter.body` names.
    Time-dependent points are evaluated at `time`, s.
    """
    found = [mark for component in mechanism.components.values() for mark in _marks(component, mechanism, time)]
    for body in mechanism.bodies.values():
        if body.terms.values["mass"] != 0:
            found.append(Mark("com", body.name, "", "com", _points(list(body.terms.values["com"]), time) or ()))
    found += list(_observed(mechanism))
    found += [mark for body in mechanism.bodies.values() for mark in _corners(body)]
    bare = set(mechanism.bodies) - {m.body for m in found if m.kind != "direction" and m.local}
    origin = (sympy.S.Zero,) * mechanism.space.dimension
    found += [Mark("point", body, "", "origin", origin) for body in mechanism.bodies if body in bare]
    found += [mark for component in mechanism.components.values() for mark in _nodes(component)]
    return [mark for mark in found if mark.local]


def _corners(body: Body) -> Iterator[Mark]:
    """Yield the corners of the box around each shape of a body, in the axes of the shape."""
    d = body.space.dimension
    for k, shape in enumerate(body.shapes):
        ends = shape.bounds
        for signs in range(8):
            corner = [ends[signs >> axis & 1][axis] for axis in range(3)]
            turned = [sum(sympy.Float(r) * x for r, x in zip(row, corner, strict=True)) for row in shape.rotation]
            local = tuple(p + x for p, x in zip(shape.position[:d], turned[:d], strict=True))
            yield Mark("corner", body.name, "", f"shape {k + 1}", local)


def _marks(component: Component, mechanism: Mechanism, time: float) -> Iterator[Mark]:
    dimension = mechanism.space.dimension
    for key, parameter in component.parameters().items():
        value = component.values.get(key)
        if not isinstance(value, (tuple, list)) or len(value) == 0:
            continue
        frame = component.attached[component.body_of(key)]
        body = carrier_name(frame)
        if parameter.kind == "point":
            local = _points(list(local_in_body(frame, value)), time)
            if local:
                moving = _moving(frame, value, time)
                yield Mark("point", body, component.name, key, local, _radius(component, key), moving)
        elif parameter.kind in ("axis", "turning_axis", "vector") or (parameter.kind == "moment" and dimension == 3):
            turned = body if parameter.kind in ("axis", "turning_axis") or parameter.axes == "body" else "ground"
            local = tuple(_still(x, time) for x in value)
            if turned == body:
                local = local_in_body(frame, local, direction=True)
            if any(x != 0 for x in local):
                yield Mark("direction", turned, component.name, key, local)


def _moving(frame: Any, value: Any, time: float) -> tuple[sympy.Expr, ...]:
    """Return a point of a frame as expressions in coordinates of components, or () if it is fixed in its body."""
    if not isinstance(frame, AttachedFrame):
        return ()
    local = frame.space.rotation(frame.turned) * sympy.Matrix(list(value)) + sympy.Matrix(frame.offset)
    entries = tuple(as_symbolic(x).xreplace({t: sympy.Float(time)}) for x in local)
    return entries if _known(entries) and not all(map(_settled, entries)) else ()


def _nodes(component: Component) -> Iterator[Mark]:
    """Yield the points of the lines that a component draws, at zero values of its coordinates."""
    lines = component.drawn_lines()
    if not lines:
        return
    carrier = component.attached[component.bodies[0]]
    body, dimension = carrier_name(carrier), carrier.space.dimension
    for k, line in enumerate(lines):
        for point in line:
            entries = tuple(map(as_symbolic, point))
            if len(entries) != dimension or not _known(entries):
                raise StudyError(
                    f"{type(component).__name__} {component.name!r}: drawn_lines() contains the point {point!r:.80}; "
                    f"expected {dimension} expressions in coordinates of components and random variables."
                )
            still = tuple(x.xreplace(dict.fromkeys(_coordinates((x,)), sympy.S.Zero)) for x in entries)
            yield Mark("node", body, "", f"{component.name} line {k + 1}", still, moving=entries)


def _coordinates(entries: tuple[sympy.Expr, ...]) -> set[StateSymbol]:
    """Return the coordinates of components in expressions, without rates."""
    symbols = {s for x in entries for s in x.free_symbols if isinstance(s, StateSymbol)}
    return {s for s in symbols if isinstance(s.owner, CoordinateSet) and s.quantity == "q"}


def _known(entries: tuple[sympy.Expr, ...]) -> bool:
    """Return whether expressions contain only random variables and coordinates of components."""
    symbols = {s for x in entries for s in x.free_symbols if not isinstance(s, RandomVariable)}
    return symbols == _coordinates(entries)


def _radius(component: Component, point: str) -> sympy.Expr:
    """Return the radius about a point, m; 0 if the point has no radius."""
    value = as_symbolic(component.values.get(component.radius_of(point)) or 0)
    return value if _settled(value) else sympy.S.Zero


def _points(value: list[Any], time: float) -> tuple[sympy.Expr, ...] | None:
    """Return a point at a time, s; None if the point depends on the motion."""
    entries = tuple(as_symbolic(x).xreplace({t: sympy.Float(time)}) for x in value)
    return entries if all(_settled(x) for x in entries) else None


def _still(value: Any, time: float) -> sympy.Expr:
    """Return an entry of a direction; use 1 for an entry that depends on time or motion, unless it is always zero."""
    entry = as_symbolic(value)
    return entry if _settled(entry) else sympy.S.One


def _settled(value: sympy.Expr) -> bool:
    return all(isinstance(s, RandomVariable) for s in value.free_symbols)


def _observed(mechanism: Mechanism) -> Iterator[Mark]:
    """Yield points with recorded positions, ``body.point(local)[k]``, recovered from the expressions of outputs."""
    for output in mechanism.outputs.values():
        owners = {s.owner for s in output.expression.free_symbols if isinstance(s, StateSymbol)}
        body = next(iter(owners), None)
        if len(owners) == 1 and isinstance(body, Body):
            local = _point_of(output.expression, body)
            if local is not None:
                yield Mark("observed", body.name, "", output.name, local)


def _point_of(expression: sympy.Expr, body: Body) -> tuple[sympy.Expr, ...] | None:
    """Return the point of a body with a world coordinate equal to an expression, or None."""
    space = body.space
    d = space.dimension
    places = [k for k in range(d) if expression.coeff(body.q[k]) == 1]
    if len(places) != 1:
        return None
    k = places[0]
    rest = sympy.expand(expression - body.q[k])
    turning = tuple(body.q[d:])
    if not all(isinstance(s, RandomVariable) or s in turning for s in rest.free_symbols):
        return None
    if not turning:
        return (sympy.S.Zero,) * d if rest == 0 else None
    local = [sympy.S.Zero] * d
    for quaternion in QUARTER_TURNS[d]:
        row = space.rotation(quaternion)[k, :]
        hits = [j for j in range(d) if row[j] != 0]
        if len(hits) == 1:
            local[hits[0]] = rest.xreplace(dict(zip(turning, map(sympy.Integer, quaternion), strict=True)))
            local[hits[0]] /= row[hits[0]]
    left = sympy.expand(rest - (space.rotation(turning) * sympy.Matrix(local))[k])
    size = max([abs(c) for c in rest.as_coefficients_dict().values()], default=sympy.S.One)
    close = all(abs(c) <= 1e-9 * size for c in left.as_coefficients_dict().values())
    return tuple(local) if close else None
