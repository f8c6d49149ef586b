"""Spring-dampers along the line between two points, and along an axis."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, overload

import sympy

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Quantity, Vector

__all__ = ["SlidingSpringDamper", "SpringDamper"]


class SpringDamper(uqmbd.extend.TypedComponent):
    """A linear spring and damper along the line between two points.

    For the vector ``d`` between the points, the length is ``sqrt(d . d + (1e-9 m)^2)``, so that a start at zero length
    is possible. On a line, the length is positive while the points have the order of the given pose. The length is
    negative when the points have passed each other, and the force remains linear. Points at one place need
    ``free_length=0``.

    Examples
    --------
    >>> SpringDamper.signature()
    '(name, body_i, body_j, point_i, point_j, stiffness, damping=0, free_length=0)'
    """

    symbol = "spring"
    spaces = (*uqmbd.Component.spaces, uqmbd.Line)
    drawn_by = ()
    body_i: uqmbd.extend.NamedFrame
    body_j: uqmbd.extend.NamedFrame
    point_i: uqmbd.Parameter[Vector] = uqmbd.Parameter("m", "end, frame of body i", kind="point", body="body_i")
    point_j: uqmbd.Parameter[Vector] = uqmbd.Parameter("m", "end, frame of body j", kind="point", body="body_j")
    stiffness: uqmbd.Parameter[Quantity] = uqmbd.Parameter("N/m", "spring rate", one_sign=True)
    damping: uqmbd.Parameter[Quantity] = uqmbd.Parameter("N s/m", "damper rate", default=0, one_sign=True)
    free_length: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "m", "length without force; negative: wound with initial tension", default=0
    )

    def prepare(self) -> dict[str, Any]:
        """Return, for a mechanism on a line, the side of point i (1 or -1) on which point j is in the given pose."""
        return (
            {"side": self.drawn_side(either=bool(sympy.sympify(self.free_length, strict=True).is_zero))}
            if len(self.point_i) == 1
            else {}
        )

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Potential | uqmbd.VirtualWork]:
        """Yield energy and dissipation."""
        d = p.body_j.point(p.point_j) - p.body_i.point(p.point_i)
        length = p.side * d[0] if p.space.dimension == 1 else sympy.sqrt(d.dot(d) + sympy.Float(1e-18))
        # for zero free length, the energy is a polynomial without a root
        yield uqmbd.Potential(p.stiffness * (d.dot(d) if p.free_length == 0 else (length - p.free_length) ** 2) / 2)
        if p.damping != 0:
            speed = p.body_j.point_velocity(p.point_j) - p.body_i.point_velocity(p.point_i)
            rate = p.side * speed[0] if p.space.dimension == 1 else d.dot(speed) / length
            yield uqmbd.VirtualWork(-p.damping * rate, rate)


class SlidingSpringDamper(uqmbd.Component):
    """A linear spring and damper along an axis fixed in body i; the length has a sign, as in a prismatic joint.

    Examples
    --------
    >>> SlidingSpringDamper.signature()
    '(name, body_i, body_j, point_i, point_j, axis_i, stiffness, damping=0, free_displacement=0)'
    """

    symbol = "spring"
    spaces = (*uqmbd.Component.spaces, uqmbd.Line)
    drawn_by = ("axis",)
    point_i = uqmbd.Parameter("m", "point of zero displacement, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "the point that slides, frame of body j", kind="point", body="body_j")
    axis_i = uqmbd.Parameter("1", "direction, frame of body i", kind="axis", body="body_i")
    stiffness = uqmbd.Parameter("N/m", "spring rate", one_sign=True)
    damping = uqmbd.Parameter("N s/m", "damper rate", default=0, one_sign=True)
    free_displacement = uqmbd.Parameter("m", "displacement without force", default=0)

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, axis_i: Vector,
            stiffness: Quantity, damping: Quantity = 0, free_displacement: Quantity = 0,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, *,
            axis: Vector, stiffness: Quantity, damping: Quantity = 0, free_displacement: Quantity = 0,
        ) -> None: ...  # fmt: skip
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Potential | uqmbd.VirtualWork]:
        """Yield energy and dissipation."""
        offset = p.let("offset", p.body_j.point(p.point_j) - p.body_i.point(p.point_i))
        displacement = p.let("axis", p.body_i.direction(p.axis_i)).dot(offset)
        yield uqmbd.Potential(p.stiffness * (displacement - p.free_displacement) ** 2 / 2)
        if p.damping != 0:
            speed = p.rate_of(displacement)
            yield uqmbd.VirtualWork(-p.damping * speed, speed)
