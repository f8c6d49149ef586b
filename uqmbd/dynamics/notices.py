"""What may be meant, and often is not: bodies that assembly moves far, and contacts that start deep."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy

from uqmbd.dynamics.assembly import positions
from uqmbd.dynamics.equations import TIME, Instance, Model, ParameterMap, plain
from uqmbd.errors import StudyError
from uqmbd.mechanism import (
    AngleSymbol,
    Component,
    Frame,
    Mechanism,
    angles_in,
    joint_frames,
    nominal,
    relative_quaternion,
    skeleton,
    t,
)
from uqmbd.typing import Array

__all__ = ["Move", "deep_contacts", "hidden_turns", "looked_at", "moved_bodies", "moves", "size_of"]


FAR = 1.0
"""A body that assembly moves by more than this, in sizes of the drawn mechanism, is told of."""

TURNED = np.pi / 4
"""The same of a turn, rad."""

DEEP = 0.1
"""The same of the depth of a contact of points, in sizes of the mechanism."""

REALISATIONS = 256
"""Realisations that are looked at for angles of drivers that start more than half a turn from the drawn pose."""

LEAST = 1.0
"""Mechanisms are taken to be this large at least, m."""


@dataclass(frozen=True)
class Move:
    """How far assembly moved a body from where it was drawn, at the means of the inputs.

    Attributes
    ----------
    body : str
        Its name.
    distance : float
        Of the frame's origin, m.
    turn : float
        Angle of the rotation, rad, from 0 to pi.
    """

    body: str
    distance: float
    turn: float

    def __str__(self) -> str:
        parts = [f"by {self.distance:.3g} m"] if self.distance > 0 else []
        parts += [f"by {np.degrees(self.turn):.3g} degrees"] if self.turn > 1e-3 else []
        return f"{self.body!r} {' and '.join(parts)}"


def moves(model: Model, drawn: Array, assembled: Array) -> tuple[Move, ...]:
    """Compare poses, one of each, shape (coordinate,); one move for each body."""
    d, found = model.dimension, []
    pairs = zip(drawn.reshape(-1, model.size), assembled.reshape(-1, model.size), strict=True)
    for name, (before, after) in zip(model.bodies, pairs, strict=True):
        e, f = (x[d:] / (np.linalg.norm(x[d:]) or 1.0) for x in (before, after))
        apart, together = sorted((float(np.linalg.norm(e - f)), float(np.linalg.norm(e + f))))  # of either sign
        turn = 4 * math.atan2(apart, together)
        found.append(Move(name, float(np.linalg.norm(after[:d] - before[:d])), turn))
    return tuple(found)


def size_of(mechanism: Mechanism) -> float:
    """Largest extent of the mechanism as drawn, m, at the means: of all points that are known of its bodies."""
    poses: dict[str, Sequence[sympy.Expr]] = {name: body.pose.q for name, body in mechanism.bodies.items()}
    poses["ground"] = mechanism.ground.q
    frames: dict[str, Frame] = {}
    places = []
    for mark in skeleton(mechanism):
        if mark.kind == "direction":
            continue
        try:
            if mark.body not in frames:  # numbers first: SymPy takes long to turn expressions
                frames[mark.body] = Frame(mechanism.space, [nominal(x) for x in poses[mark.body]])
            places.append([float(x) for x in frames[mark.body].point([nominal(x) for x in mark.local])])
        except StudyError:  # no finite number at the means: told elsewhere
            continue
    return float(np.linalg.norm(np.ptp(np.array(places), axis=0))) if places else 0.0


def moved_bodies(mechanism: Mechanism, model: Model, drawn: Array, assembled: Array) -> tuple[str, ...]:
    """Say which bodies assembly moved far, or turned by much: one sentence, or none."""
    moved = [m for m in moves(model, drawn, assembled) if m.turn > TURNED or m.distance > 1e-9]
    limit = FAR * size_of(mechanism) if moved else 0.0  # which takes SymPy longer than a model that is in the cache
    far = [m for m in moved if m.turn > TURNED or m.distance > limit + 1e-9]
    if not far:
        return ()
    bodies, were = ("bodies", "they were") if len(far) > 1 else ("body", "it was")
    return (
        f"mechanism {mechanism.name!r}: assembly moved {bodies} {', '.join(map(str, far))} from where {were} drawn; is "
        "this the pose that is meant? Draw them closer to it (uqmbd check --figure shows the mechanism)",
    )


def hidden_turns(mechanism: Mechanism, model: Model) -> tuple[str, ...]:
    """Say which drivers start whole turns away from the angles that are counted: a sentence each.

    Counted angles start within half a turn of the drawn pose.  A driver whose angle is a function of time starts at the
    value of that function; a driver that follows other joints, at its value in the assembled pose.
    """
    seen = [x for o in mechanism.outputs.values() for x in o.expression.free_symbols]
    if not (model.layout.states or any(isinstance(x, AngleSymbol) for x in seen)):
        return ()
    drivers = [x for x in mechanism.all_components() if x.prescribed_angle and not _turns_are_stated(mechanism, x)]
    starts = [(x, *angles) for x, angles in zip(drivers, _starts(mechanism, model, drivers), strict=True)]
    found = []
    for component, angles, poses in starts:
        far = np.abs(angles - poses) > np.pi * (1 + 1e-9)
        if not far.any():
            continue
        share = "" if far.all() else f" in {100 * far.mean():.2g} % of the realisations"
        advice = "Draw the body there, or state" if model.dimension == 2 else "State"
        followed = " and ".join(map(str, _followed(component)))
        others = f". State {followed} as well, which the driver follows" if followed else ""
        found.append(
            f"mechanism {mechanism.name!r}: driver {component.name!r} starts at {angles[far][0]:.4g} rad{share}, more "
            f"than half a turn from the drawn pose, {poses[far][0]:.4g} rad; whole turns between them are not counted "
            f"by angles of bodies and joints, and by springs. {advice} the turns by mechanism.start(joint.angle, "
            f"value), with the value at which the driver starts{others}"
        )
    return tuple(found)


def _turns_are_stated(mechanism: Mechanism, component: Component) -> bool:
    """Whether start conditions hold an angle of the driven bodies, and all angles that the driver follows.

    A follower alone does not decide: its condition moves what it follows.
    """
    conditions = [c for c in mechanism.conditions.values() if not c.of_velocities]
    stated, followed = angles_in([c.residual for c in conditions]), _followed(component)
    bodies = [component.attached[role] for role in ("body_i", "body_j")]
    driven = [x for x in stated if x not in followed and any(getattr(s, "owner", None) in bodies for s in x.states)]
    return bool(driven) and all(x in stated for x in followed)


def _followed(component: Component) -> list[AngleSymbol]:
    """Return the counted angles in the expression of a driver's angle."""
    return angles_in([component.values[component.prescribed_angle]])


def _starts(mechanism: Mechanism, model: Model, drivers: Sequence[Component]) -> list[tuple[Array, Array]]:
    """Angles at which drivers start and are drawn, rad, in the realisations that are looked at."""
    if not drivers:
        return []
    rows = looked_at(mechanism)
    places = [x for body in mechanism.bodies.values() for x in body.q]
    expressions = [(_angle_at_start(x, model.time), plain(_drawn_angle(x))) for x in drivers]
    symbols, known = list(mechanism.inputs.variables), rows
    if any(start.free_symbols & set(places) for start, _ in expressions):
        parameters = model.parameters(rows)
        # start conditions move followed joints and their followers together, and turns are counted on the way
        drawn, free = parameters[:, model.drawn], replace(model, conditions=None)
        q, messages = positions(free, drawn, model.time, parameters, model.layout.kept_holonomic)
        assembled = np.flatnonzero([not message for message in messages])
        symbols, known = [*symbols, *places], np.concatenate([rows, q], axis=1)[assembled]
    values = [ParameterMap.of(pair, symbols)(known) for pair in expressions]
    return [(x[:, 0], x[:, 1]) for x in values]


def _angle_at_start(component: Component, time: float) -> sympy.Expr:
    """Angle of a driver at the initial time, rad, in inputs and coordinates; followed angles as their counts begin."""
    counted = {
        x: x.angle.at_start(x.angle.whole(x.angle.cosine), x.angle.whole(x.angle.sine), x.angle.near)
        for x in _followed(component)
    }
    angle = plain(component.values[component.prescribed_angle]).xreplace(counted)
    return plain(angle.xreplace({t: sympy.Float(time)}))


def looked_at(mechanism: Mechanism) -> Array:
    """Return the values of the inputs that notices depend on, shape (K, input): the means, and where drivers turn more.

    The latter where an angle is prescribed, at points that are spread over the inputs.
    """
    inputs = mechanism.inputs
    means = inputs.means[None, :]
    if not len(inputs) or not any(component.prescribed_angle for component in mechanism.all_components()):
        return means
    from scipy.stats import qmc

    points = qmc.Halton(len(inputs), scramble=False).random(REALISATIONS + 1)[1:]
    return np.concatenate([means, inputs.from_uniform(points)])


def _drawn_angle(component: Component) -> sympy.Expr:
    """Angle that two bodies are drawn at, as a driver of rotation understands it, rad; in space at the means."""
    i, j = (component.drawn_frame(body) for body in ("body_i", "body_j"))
    if i.space.dimension == 2:
        return component.drawn_angle()
    frames = joint_frames(component.values["axis_i"], component.values["axis_j"])
    r = relative_quaternion(*(f.attitude(x) for f, x in zip((i, j), frames, strict=True)))
    half = float(np.arctan2(float(nominal(r[-1])), float(nominal(r[0]))))
    return sympy.Float((2 * half + np.pi) % (2 * np.pi) - np.pi)


def deep_contacts(
    mechanism: Mechanism, model: Model, instances: list[Instance], q: Array, parameters: Array
) -> tuple[str, ...]:
    """Say which contacts start deep, at the means: a sentence each.

    Parameters
    ----------
    mechanism, model, instances
        What is looked at.
    q, parameters : array, shape (coordinate,), (parameter,)
        Assembled pose, and parameters.
    """
    found: list[str] = []
    if not any(instance.type.gaps for instance in instances):
        return ()
    size = max(LEAST, size_of(mechanism))
    order = {name: k for k, name in enumerate(mechanism.bodies)}
    first = 0
    for instance in instances:
        chosen = parameters[first : first + len(instance.parameters)].tolist()
        values = {sympy.Symbol(f"_p{k}", real=True): sympy.Float(x) for k, x in enumerate(chosen)}
        first += len(instance.parameters)
        if not instance.type.gaps:
            continue
        local = np.concatenate([q[order[b.name] * model.size :][: model.size] for b in instance.bodies])
        values |= {sympy.Symbol(f"_q{k}", real=True): sympy.Float(x) for k, x in enumerate(local.tolist())}
        values[TIME] = sympy.Float(model.time)
        for gap, reach in instance.type.gaps:
            depth, usual = (_number(instance.type.whole(e).xreplace(values)) for e in (-gap, reach))
            usual = min(usual, DEEP * size) if usual > 0 else DEEP * size
            if depth > usual:
                kind = type(instance.component).__name__
                found.append(
                    f"{kind} {instance.component.name!r} starts {depth:.3g} m deep: bodies overlap before anything has "
                    "happened, and are thrown apart. Look at its points, normal and radii, and at the drawn poses"
                )
    return tuple(found)


def _number(value: sympy.Expr) -> float:
    """Return a number; NaN for what has none, as a gap that depends on states of its own."""
    try:
        return float(value.doit())
    except TypeError:
        return float("nan")
