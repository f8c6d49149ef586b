"""Fixed joint."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, overload

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Vector

__all__ = ["Fixed"]


class Fixed(uqmbd.Component):
    """Two rigidly connected bodies: two points coincide, and the rotation of body j relative to body i is constant.

    The equations set the vector part of the relative quaternion to zero, so no mirror image satisfies them.

    Examples
    --------
    >>> Fixed.signature()
    '(name, body_i, body_j, point_i, point_j, rotation=None)'
    """

    symbol = "weld"
    spaces = (*uqmbd.Component.spaces, uqmbd.Line)
    point_i = uqmbd.Parameter("m", "joint point, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "joint point, frame of body j", kind="point", body="body_j")
    rotation = uqmbd.Parameter(
        "1", "rotation of body j relative to body i; None: as in the given pose", kind="rotation", default=None
    )

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector,
            rotation: Vector | Sequence[Vector] | None = None,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector,
            rotation: Vector | Sequence[Vector] | None = None,
        ) -> None: ...  # fmt: skip
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...

    def prepare(self) -> dict[str, Any]:
        """Return the relative rotation of the given pose if the argument `rotation` is omitted."""
        return {"turn": self.drawn_quaternion() if self.rotation is None else self.rotation}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the constraint equations."""
        i, j = p.body_i, p.body_j
        yield uqmbd.Constraint(j.point(p.point_j) - i.point(p.point_i), "point")
        if p.space.turns:
            yield uqmbd.Constraint(uqmbd.extend.relative_quaternion(i.attitude(p.turn), j.quaternion)[1:], "rotation")
