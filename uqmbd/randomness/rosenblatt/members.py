"""Decomposition of univariate distributions of chaospy, including parameters that are other variables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from uqmbd.randomness.rosenblatt.conditionals import AffineConditional, Conditional, Core, Cut, Mapped, Spanned
from uqmbd.randomness.rosenblatt.expressions import Expression, NotUnderstood, owners_of, read

__all__ = ["conditional"]


def conditional(distribution: Any, places: Mapping[tuple[int, int], int], component: int = 0) -> Conditional:
    """Return a univariate chaospy distribution, or a component of independent variables, given earlier members.

    See :func:`uqmbd.randomness.rosenblatt.expressions.read` for `places`. Raise NotUnderstood if the structure
    is unknown.
    """
    import chaospy

    given = distribution._parameters

    def number(name: str) -> Expression:
        return read(given[name], places, component)

    def inside(other: Any) -> Conditional:
        return conditional(other, places, component)

    if isinstance(distribution, chaospy.J):
        owned, owner = owners_of(distribution)[component]
        return conditional(owner, places, owned)
    if isinstance(distribution, chaospy.ItemDistribution):
        return conditional(given["parent"], places, int(given["index"]))
    if isinstance(distribution, chaospy.Trunc):
        # a missing bound is the end of the support, which arithmetic on arithmetic does not provide
        cut = [None if _is_end(distribution, side) else number(side) for side in ("lower", "upper")]
        return Cut(inside(distribution._dist), *cut)
    if isinstance(distribution, chaospy.ShiftScaleDistribution):
        return AffineConditional(inside(distribution._dist), number("shift"), number("scale"))
    if isinstance(distribution, chaospy.LowerUpperDistribution):
        return Spanned(inside(distribution._dist), number("lower"), number("upper"))
    if isinstance(distribution, chaospy.OperatorDistribution):
        return _operated(distribution, places, component)
    if isinstance(distribution, chaospy.SimpleDistribution) and len(distribution) == 1:
        return Core(distribution, tuple((name, read(value, places)) for name, value in given.items()))
    raise NotUnderstood(str(distribution))


def _is_end(cut: Any, side: str) -> bool:
    try:
        return bool(np.array_equal(getattr(cut._dist, side), cut._parameters[side]))
    except (AttributeError, TypeError):
        return False


def _operated(distribution: Any, places: Mapping[tuple[int, int], int], component: int) -> Conditional:
    import chaospy

    left, right = distribution._parameters["left"], distribution._parameters["right"]
    if isinstance(distribution, chaospy.Negative):
        return AffineConditional(conditional(left, places, component), 0.0, -1.0, True)
    try:
        inner, other, swapped = left, read(right, places, component), False
    except NotUnderstood:
        inner, other, swapped = right, read(left, places, component), True
    if not isinstance(inner, chaospy.Distribution):
        inner, other, swapped = right, read(left, places, component), True
    core = conditional(inner, places, component)
    if isinstance(distribution, chaospy.Add):
        return AffineConditional(core, other, 1.0, True)
    if isinstance(distribution, chaospy.Multiply):
        return AffineConditional(core, 0.0, other, True)
    if not isinstance(other, float) or core.discrete:
        raise NotUnderstood(str(distribution))
    if isinstance(distribution, chaospy.Logn):
        return Mapped(core, "logarithm", other)
    if isinstance(distribution, chaospy.Power):
        return Mapped(core, "exponential" if swapped else "power", other)
    raise NotUnderstood(str(distribution))
