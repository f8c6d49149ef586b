"""Intervals that contain all values of dependent variables."""

from __future__ import annotations

import numpy as np

from uqmbd.randomness.rosenblatt.conditionals import (
    COLLECTION,
    AffineConditional,
    Conditional,
    Core,
    Cut,
    Mapped,
    Spanned,
)
from uqmbd.randomness.rosenblatt.expressions import OPERATIONS, Expression, MemberValue, evaluated, used
from uqmbd.randomness.rosenblatt.laws import AffineJoint, Chain, Copulated, JointLaw, Single
from uqmbd.randomness.rosenblatt.vectors import Vector
from uqmbd.typing import Array

__all__ = ["supports_of"]


ANY = (-np.inf, np.inf)

Interval = tuple[float, float]


def supports_of(law: JointLaw, outer: Array | None = None) -> Array:
    """Return an interval for each component that contains all its values, shape (n, 2).

    The interval is wider than the support if the support depends on other variables without simple bounds. The interval
    is infinite if no bound is known. `outer` (m, 2) contains the intervals of the larger distribution, if any.

    >>> import chaospy
    >>> from uqmbd.randomness.rosenblatt.reading import joint_law
    >>> a = chaospy.Uniform(1, 2)
    >>> supports_of(joint_law(1 - 2 * chaospy.J(chaospy.Uniform(-a, a + 1), a))).tolist()
    [[-5.0, 5.0], [-3.0, -1.0]]
    """
    known = np.empty((0, 2)) if outer is None else outer
    if isinstance(law, Single):
        return np.array([_of_one(law.law, known)])
    if isinstance(law, Chain):
        found = np.concatenate([known[: law.outside], np.tile(ANY, (len(law.order), 1))])
        for step in law.steps:
            found[[law.outside + column for column in step.columns]] = supports_of(step.law, found)
        return found[law.outside :]
    if isinstance(law, Copulated):
        return supports_of(law.margins, known)
    if isinstance(law, AffineJoint):
        inner = supports_of(law.inner, known)
        rows = zip(inner, law.shift, law.scale, strict=True)
        return np.array([_affine((float(low), float(high)), a, b, known) for (low, high), a, b in rows])
    positive = isinstance(law, Vector) and law.exponential
    return np.tile((0.0, np.inf) if positive else ANY, (len(law.order), 1))


def _of_one(law: Conditional, known: Array) -> Interval:
    if isinstance(law, Core):
        return _of_core(law, known)
    if isinstance(law, AffineConditional):
        return _affine(_of_one(law.inner, known), law.shift, law.scale, known)
    if isinstance(law, Spanned):
        return _range(law.lower, known)[0], _range(law.upper, known)[1]
    if isinstance(law, Cut):
        low, high = _of_one(law.inner, known)
        return (
            low if law.lower is None else max(low, _range(law.lower, known)[0]),
            high if law.upper is None else min(high, _range(law.upper, known)[1]),
        )
    if isinstance(law, Mapped) and not law.given:  # monotone on the support of the inner variable
        low, high = (float(end[0]) for end in law.ends(np.empty((0, 1))))
        return ANY if np.isnan(low + high) else (low, high)
    return ANY


def _of_core(law: Core, known: Array) -> Interval:
    if not law.given:
        low, high = (float(end[0]) + 0.0 for end in law.ends(np.empty((0, 1))))  # no negative zero
        return low, high
    if not type(law.family).__module__.startswith(COLLECTION):
        return ANY
    ranges = [_range(expression, known) for _, expression in law.parameters]
    if not np.isfinite(ranges).all():
        return ANY
    corners = np.stack(np.meshgrid(*ranges, indexing="ij")).reshape(len(ranges), -1)
    placed = tuple((name, MemberValue(k)) for k, (name, _) in enumerate(law.parameters))
    with np.errstate(all="ignore"):
        lows, highs = Core(law.family, placed).ends(corners)
    # keep an end that is equal at all corners of the parameters; a varying end may be extreme between corners
    return (
        float(lows[0]) + 0.0 if np.all(lows == lows[0]) else -np.inf,
        float(highs[0]) + 0.0 if np.all(highs == highs[0]) else np.inf,
    )


def _affine(inner: Interval, shift: Expression, scale: Expression, known: Array) -> Interval:
    return _sum(_range(shift, known), _hull("product", _range(scale, known), inner))


def _range(expression: Expression, known: Array) -> Interval:
    """Return an interval that contains all values of an expression."""
    if isinstance(expression, MemberValue):
        return float(known[expression.place, 0]), float(known[expression.place, 1])
    if not used(expression) or isinstance(expression, float):
        value = float(evaluated(expression, np.empty((0, 1))))
        return value, value
    left, right = _range(expression.left, known), _range(expression.right, known)
    if expression.kind == "sum":
        return _sum(left, right)
    if expression.kind == "product":
        return _hull("product", left, right)
    if expression.kind == "power" and left[0] >= 0:  # monotone in both operands
        return _hull("power", left, right)
    return ANY


def _sum(left: Interval, right: Interval) -> Interval:
    low, high = left[0] + right[0], left[1] + right[1]
    return low if low == low else -np.inf, high if high == high else np.inf


def _hull(kind: str, left: Interval, right: Interval) -> Interval:
    """Return the range of an operation with extremes at the ends of its operands; zero times infinity is zero."""
    with np.errstate(all="ignore"):
        ends = [float(OPERATIONS[kind](np.float64(a), np.float64(b))) for a in left for b in right]
    if kind == "product":
        ends = [0.0 if np.isnan(end) else end for end in ends]
    return ANY if np.isnan(ends).any() else (min(ends), max(ends))
