"""Spherical joint."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, overload

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Vector

__all__ = ["Spherical"]


class Spherical(uqmbd.Component):
    """A ball joint: two points coincide.

    Examples
    --------
    >>> Spherical.signature()
    '(name, body_i, body_j, point_i, point_j)'
    """

    symbol = "ball"
    point_i = uqmbd.Parameter("m", "joint point, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "joint point, frame of body j", kind="point", body="body_j")

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector
        ) -> None: ...
        @overload
        def __init__(self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector) -> None: ...
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Constraint]:
        """Yield the constraint equations."""
        yield uqmbd.Constraint(p.body_j.point(p.point_j) - p.body_i.point(p.point_i), "point")
