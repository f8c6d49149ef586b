"""Screw joint."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, overload

import sympy

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Quantity, Vector
from uqmbd_joints.cylindrical import Cylindrical

__all__ = ["Screw"]


class Screw(Cylindrical):
    """A nut on a thread: a cylindrical joint that advances from the given pose by the pitch with each turn.

    Examples
    --------
    >>> Screw.signature()
    '(name, body_i, body_j, point_i, point_j, axis_i, axis_j, pitch)'
    """

    symbol = ""
    pitch = uqmbd.Parameter("m", "advance per turn; negative: left-handed")

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, axis_i: Vector,
            axis_j: Vector, pitch: Quantity,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, *,
            axis: Vector, pitch: Quantity,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis_i: Vector, axis_j: Vector,
            pitch: Quantity,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis: Vector, pitch: Quantity
        ) -> None: ...
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...

    def prepare(self) -> dict[str, Any]:
        """Return the relative rotation and the displacement in the given pose."""
        return {**super().prepare(), "drawn": self.drawn_quaternion(), "start": self.drawn_displacement()}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint | uqmbd.Auxiliary]:
        """Yield the constraint equations and the auxiliary state."""
        yield from super().terms(p)
        angle, turns = uqmbd.extend.counted_angle(p, "angle", p.body_i, p.body_j, p.drawn, p.axis_j)
        yield turns
        offset = p.body_j.point(p.point_j) - p.body_i.point(p.point_i)
        advance = p.body_i.direction(p.axis_i).dot(offset) - p.start
        yield uqmbd.Constraint(advance - p.pitch * angle / (2 * sympy.pi), "thread")
