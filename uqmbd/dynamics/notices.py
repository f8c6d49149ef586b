"""What may be meant, and often is not: bodies that assembly moves far, and contacts that start deep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import sympy

from uqmbd.dynamics.equations import TIME, Instance, Model
from uqmbd.errors import StudyError
from uqmbd.mechanism import Frame, Mechanism, nominal, skeleton
from uqmbd.typing import Array

__all__ = ["Move", "deep_contacts", "moved_bodies", "moves", "size_of"]


FAR = 1.0
"""A body that assembly moves by more than this, in sizes of the drawn mechanism, is told of."""

TURNED = np.pi / 4
"""The same of a turn, rad."""

DEEP = 0.1
"""The same of the depth of a contact of points, in sizes of the mechanism."""

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
        cosine = abs(before[d:] @ after[d:]) / (np.linalg.norm(before[d:]) * np.linalg.norm(after[d:]) or 1.0)
        turn = 2 * np.arccos(min(float(cosine), 1.0)) if model.size > d else 0.0
        found.append(Move(name, float(np.linalg.norm(after[:d] - before[:d])), float(turn)))
    return tuple(found)


def size_of(mechanism: Mechanism) -> float:
    """Largest extent of the mechanism as drawn, m, at the means: of all points that are known of its bodies."""
    frames = {name: Frame(mechanism.space, body.pose.q) for name, body in mechanism.bodies.items()}
    frames["ground"] = Frame(mechanism.space)
    places = []
    for mark in skeleton(mechanism):
        if mark.kind == "direction":
            continue
        try:
            places.append([nominal(x) for x in frames[mark.body].point(mark.local)])
        except StudyError:  # no finite number at the means: told elsewhere
            continue
    return float(np.linalg.norm(np.ptp(np.array(places), axis=0))) if places else 0.0


def moved_bodies(mechanism: Mechanism, model: Model, drawn: Array, assembled: Array) -> tuple[str, ...]:
    """Say which bodies assembly moved far, or turned by much: one sentence, or none."""
    limit = FAR * size_of(mechanism)
    far = [m for m in moves(model, drawn, assembled) if m.turn > TURNED or m.distance > limit + 1e-9]
    if not far:
        return ()
    bodies, were = ("bodies", "they were") if len(far) > 1 else ("body", "it was")
    return (
        f"mechanism {mechanism.name!r}: assembly moved {bodies} {', '.join(map(str, far))} from where {were} drawn; is "
        "this the pose that is meant? Draw them closer to it (uqmbd check --figure shows the mechanism)",
    )


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
    found = []
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
