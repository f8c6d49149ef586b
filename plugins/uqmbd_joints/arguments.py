"""Common arguments of several joints, with overloads for type checkers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, overload

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.typing import Vector

__all__ = ["PointsAndAxes", "PointsAndAxis"]


class PointsAndAxis(uqmbd.Component):
    """Component with a point of each body, and an axis of body i."""

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, axis_i: Vector
        ) -> None: ...
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, *,
            axis: Vector,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis_i: Vector
        ) -> None: ...
        @overload
        def __init__(self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis: Vector) -> None: ...
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...


class PointsAndAxes(uqmbd.Component):
    """Component with a point and an axis of each body."""

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, axis_i: Vector,
            axis_j: Vector,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector, *,
            axis: Vector,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis_i: Vector, axis_j: Vector
        ) -> None: ...
        @overload
        def __init__(self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, axis: Vector) -> None: ...
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...
