"""The two bodies of a clearance: their shapes, and the expressions that their motion contains."""

from __future__ import annotations

import hashlib
import importlib.util
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy

import uqmbd
from uqmbd.shapes import BodyShape

__all__ = ["Pair", "Side", "pair_of"]


@dataclass(frozen=True, eq=False)
class Side:
    """One body in a clearance: its shapes, and the expressions that the motion contains."""

    shapes: tuple[BodyShape, ...]
    dimension: int  # dimension of the space; 0: fixed to the ground
    turns: bool
    # parameters of the shapes; NaN: a random parameter, whose value is in the motion
    fixed: tuple[tuple[float, ...], ...]

    @property
    def coordinates(self) -> int:
        """Number of coordinates among the expressions."""
        turning = {2: 2, 3: 4}.get(self.dimension, 0) if self.turns else 0
        return self.dimension + turning

    @property
    def random(self) -> int:
        """Number of random parameters of the shapes."""
        return int(np.isnan(np.concatenate(self.fixed)).sum())


@dataclass(frozen=True, eq=False)
class Pair:
    """The two bodies of a clearance."""

    sides: tuple[Side, Side]
    digest: str  # of the shapes, and of the form of the expressions


def pair_of(where: str, body_a: Any, body_b: Any) -> tuple[list[sympy.Expr], Pair, str]:
    """Return the expressions that a motion contains, the two bodies, and a text for messages and results."""
    if importlib.util.find_spec("fcl") is None:
        raise uqmbd.StudyError(f"{where}: python-fcl is not installed; install uqmbd[geometry].")
    expressions: list[sympy.Expr] = []
    sides = (_side(where, body_a, "body_a", expressions), _side(where, body_b, "body_b", expressions))
    if not sides[0].dimension:
        raise uqmbd.StudyError(
            f"{where}: body_a is a shape that is fixed to the ground; expected a body with shapes. Give the "
            "shape as body_b."
        )
    names = [getattr(body, "name", repr(body)) for body in (body_a, body_b)]
    return expressions, Pair(sides, _digest(sides)), f"clearance({', '.join(names)})"


def _side(where: str, body: Any, name: str, expressions: list[sympy.Expr]) -> Side:
    """Return one side, and add its coordinates and random numbers to the expressions."""
    shapes = (body,) if isinstance(body, BodyShape) else getattr(body, "shapes", ())
    if not shapes or not all(isinstance(one, BodyShape) for one in shapes):
        shown = getattr(body, "name", repr(body))
        raise uqmbd.StudyError(
            f"{where}: {name} is {shown!r}, which has no shape; give shape= in mechanism.body, such as "
            "uqmbd.shapes.Box((0.1, 0.2, 0.3))."
        )
    dimension, turns = 0, False
    if not isinstance(body, BodyShape):
        dimension, turns = body.space.dimension, body.space.turns
        expressions += [body.position[k] for k in range(dimension)]
        expressions += list(body.quaternion) if turns and dimension > 1 else []
    fixed = []
    for shape in shapes:
        numbers = []
        for value in shape.expressions:
            if value.is_number:
                numbers.append(float(value))
            else:
                numbers.append(float("nan"))
                expressions.append(value)
        fixed.append(tuple(numbers))
    return Side(tuple(shapes), dimension, turns and dimension > 1, tuple(fixed))


def _digest(sides: Sequence[Side]) -> str:
    """Return a hash of the shapes and of the form of the expressions."""
    found = hashlib.sha256()
    for side in sides:
        found.update(repr((side.dimension, side.turns, side.fixed)).encode())
        for shape in side.shapes:
            found.update(type(shape).__name__.encode() + np.asarray(shape.rotation, dtype=float).tobytes())
            for name in ("vertices", "faces"):
                found.update(np.ascontiguousarray(getattr(shape, name, np.zeros(0))).tobytes())
    return found.hexdigest()
