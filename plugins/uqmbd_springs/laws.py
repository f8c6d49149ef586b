"""Springs whose force is any expression of length and rate."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import sympy

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.laws import law_at, law_values, length, rate
from uqmbd.typing import Quantity, Vector
from uqmbd_springs.turning import rotation_rate

__all__ = ["NonlinearSpringDamper", "NonlinearTorsionSpringDamper", "length", "rate"]


class NonlinearSpringDamper(uqmbd.extend.TypedComponent):
    """A force between two points, along their connecting line, by any law of length and rate.

    A positive force pulls the points together. The law is an expression in ``uqmbd_springs.length`` and
    ``uqmbd_springs.rate``, and may contain random variables and `uqmbd.t`. On a line, the length is positive while
    the points have the order of the given pose. The length is negative when the points have passed each other. If both
    points are at one place in the given pose, the law must be odd: opposite signs of length and rate give the opposite
    force.

    Examples
    --------
    >>> from uqmbd_springs import length
    >>> NonlinearSpringDamper.signature()
    '(name, body_i, body_j, point_i, point_j, law)'
    >>> cubic = 1000 * (length - 0.3) ** 3
    """

    symbol = "spring"
    spaces = (*uqmbd.Component.spaces, uqmbd.Line)
    drawn_by = ()
    body_i: uqmbd.extend.NamedFrame
    body_j: uqmbd.extend.NamedFrame
    point_i: uqmbd.Parameter[Vector] = uqmbd.Parameter("m", "end, frame of body i", kind="point", body="body_i")
    point_j: uqmbd.Parameter[Vector] = uqmbd.Parameter("m", "end, frame of body j", kind="point", body="body_j")
    law: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "N", "tension", kind="option", example=3 * (length - 0.4) ** 3 + rate * sympy.Abs(rate) / 5
    )

    def prepare(self) -> dict[str, Any]:
        """Return the coefficients of the law for each realisation; on a line, also the side of point j."""
        found = law_values(self.law, length, rate, package="uqmbd_springs")
        return {**found, "side": self.drawn_side(either=_is_odd(self.law))} if len(self.point_i) == 1 else found

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.VirtualWork]:
        """Yield the virtual work of the force."""
        d = p.body_j.point(p.point_j) - p.body_i.point(p.point_i)
        if p.space.dimension == 1:
            speed = p.side * (p.body_j.point_velocity(p.point_j) - p.body_i.point_velocity(p.point_i))[0]
            yield uqmbd.VirtualWork(-law_at(p, p.law, {length: p.side * d[0], rate: speed}), speed)
            return
        size = sympy.sqrt(d.dot(d) + sympy.Float(1e-18))
        speed = d.dot(p.body_j.point_velocity(p.point_j) - p.body_i.point_velocity(p.point_i)) / size
        yield uqmbd.VirtualWork(-law_at(p, p.law, {length: size, rate: speed}), speed)


class NonlinearTorsionSpringDamper(uqmbd.Component):
    """A moment about a common axis of two bodies, by any law of the unwrapped angle and its rate.

    A positive moment reduces the angle. The law is an expression in ``uqmbd_springs.length``, which is the angle here,
    and ``uqmbd_springs.rate``.

    Examples
    --------
    >>> NonlinearTorsionSpringDamper.signature()
    '(name, body_i, body_j, law, axis_i, axis_j)'
    """

    symbol = "coil"
    spaces = (uqmbd.Spatial, uqmbd.Planar)
    law = uqmbd.Parameter("N m", "moment", kind="option", example=2 * length**3 + rate / 5)
    axis_i = uqmbd.Parameter("1", "axis, frame of body i (omit it in planar space)", kind="turning_axis", body="body_i")
    axis_j = uqmbd.Parameter("1", "axis, frame of body j (omit it in planar space)", kind="turning_axis", body="body_j")

    if TYPE_CHECKING:

        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, law: Quantity, axis_i: Vector = (),
            axis_j: Vector = (), *, axis: Vector = (),
        ) -> None: ...  # fmt: skip

    def prepare(self) -> dict[str, Any]:
        """Return the coefficients of the law for each realisation, and a joint frame in each body."""
        found = law_values(self.law, length, rate, package="uqmbd_springs")
        if not self.axis_i:
            return {**found, "drawn": self.drawn_angle()}
        frame_i, frame_j = uqmbd.extend.joint_frames(self.axis_i, self.axis_j)
        near = getattr(self.joint_angle(), "near", 0)
        return {**found, "frame_i": frame_i, "frame_j": frame_j, "near": near}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Auxiliary | uqmbd.VirtualWork]:
        """Yield the counted angle and the virtual work."""
        speed, start = rotation_rate(p)
        angle = p.state("angle")
        yield uqmbd.Auxiliary(angle, speed, start)
        yield uqmbd.VirtualWork(-law_at(p, p.law, {length: angle, rate: speed}), speed)


def _is_odd(law: Any) -> bool:
    """Return whether a law is odd in (length, rate): the order of the two points is then irrelevant."""
    value = sympy.sympify(law, strict=True)
    return bool(sympy.expand(value + value.subs({length: -length, rate: -rate}, simultaneous=True)) == 0)
