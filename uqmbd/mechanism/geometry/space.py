"""Spaces: coordinates of bodies, and rotations as functions of these coordinates.

Rotations are unit quaternions, scalar first, from the body to the world; in planar space the half-angle pair
``(cos(theta/2), sin(theta/2))``.  This module uses no trigonometric functions of coordinates.
"""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import sympy

from uqmbd.mechanism.expressions import numbers
from uqmbd.names import check_arguments
from uqmbd.units import without_quantities

__all__ = ["Line", "Planar", "Space", "Spatial", "Translational"]


@dataclass(frozen=True)
class Space:
    """Space in which bodies of a mechanism move.

    Parameters
    ----------
    gravity : sequence of numbers or expressions
        Acceleration of gravity, world axes, m/s^2; on a line one number.
    """

    gravity: Any = None

    name: ClassVar[str]
    dimension: ClassVar[int]
    coordinates: ClassVar[tuple[str, ...]]
    turns: ClassVar[bool] = True

    def __new__(cls, *arguments: Any, **keywords: Any) -> Self:
        """Raise for unknown arguments."""
        check_arguments(cls.__name__, inspect.signature(cls.__init__), (None, *arguments), keywords, bound=True)
        return super().__new__(cls)

    def __post_init__(self) -> None:
        given = without_quantities(f"{type(self).__name__}: gravity", self.gravity, "m/s^2")
        gravity = (0.0,) * self.dimension if given is None else given
        example = -9.81 if self.dimension == 1 else (0.0,) * (self.dimension - 1) + (-9.81,)
        hint = f"world axes, m/s^2, e.g. {example}"
        entries = numbers(type(self).__name__, "gravity", gravity, self.dimension, hint)
        object.__setattr__(self, "gravity", tuple(entries))

    @property
    def size(self) -> int:
        """Number of coordinates of a body."""
        return len(self.coordinates)

    def rotation(self, e: Sequence[Any]) -> sympy.Matrix:
        """Rotation matrix (body to world) of a unit quaternion."""
        raise NotImplementedError

    def angular_velocity(self, e: Sequence[Any], rate: Sequence[Any]) -> sympy.Matrix:
        """Angular velocity in world axes; in planar space one number."""
        raise NotImplementedError

    def body_angular_velocity(self, e: Sequence[Any], rate: Sequence[Any]) -> sympy.Matrix:
        """Angular velocity in body axes; in planar space one number."""
        raise NotImplementedError

    def moment(self, e: Sequence[Any], force: Sequence[Any]) -> sympy.Matrix:
        """Moment about the body's origin, world axes, of a generalised force on the quaternion (``E Q / 2``)."""
        raise NotImplementedError


@dataclass(frozen=True)
class Spatial(Space):
    """Three-dimensional space: ``q = (x, y, z, e0, e1, e2, e3)``.

    Parameters
    ----------
    gravity : sequence
        Acceleration of gravity, m/s^2: three components, which may be random. Default: none.

    Examples
    --------
    >>> Spatial(gravity=(0, 0, -9.81)).size
    7
    """

    name: ClassVar[str] = "spatial"
    dimension: ClassVar[int] = 3
    coordinates: ClassVar[tuple[str, ...]] = ("x", "y", "z", "e0", "e1", "e2", "e3")

    def rotation(self, e: Sequence[Any]) -> sympy.Matrix:
        """Rotation matrix, homogeneous of degree two in the quaternion."""
        a, b, c, d = e
        return sympy.Matrix(
            [
                [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
                [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
                [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
            ]
        )

    @staticmethod
    def _world(e: Sequence[Any]) -> sympy.Matrix:
        a, b, c, d = e
        return sympy.Matrix([[-b, a, -d, c], [-c, d, a, -b], [-d, -c, b, a]])

    @staticmethod
    def _body(e: Sequence[Any]) -> sympy.Matrix:
        a, b, c, d = e
        return sympy.Matrix([[-b, a, d, -c], [-c, -d, a, b], [-d, c, -b, a]])

    def angular_velocity(self, e: Sequence[Any], rate: Sequence[Any]) -> sympy.Matrix:
        """World axes, three numbers."""
        return 2 * self._world(e) * sympy.Matrix(rate)

    def body_angular_velocity(self, e: Sequence[Any], rate: Sequence[Any]) -> sympy.Matrix:
        """Body axes, three numbers."""
        return 2 * self._body(e) * sympy.Matrix(rate)

    def moment(self, e: Sequence[Any], force: Sequence[Any]) -> sympy.Matrix:
        """World axes, three numbers."""
        return self._world(e) * sympy.Matrix(force) / 2


@dataclass(frozen=True)
class Planar(Space):
    """Plane with rotation: ``q = (x, y, e0, e1)``.

    Parameters
    ----------
    gravity : sequence
        Acceleration of gravity, m/s^2: two components, which may be random. Default: none.

    Examples
    --------
    >>> Planar(gravity=(0, -9.81)).coordinates
    ('x', 'y', 'e0', 'e1')
    """

    name: ClassVar[str] = "planar"
    dimension: ClassVar[int] = 2
    coordinates: ClassVar[tuple[str, ...]] = ("x", "y", "e0", "e1")

    def rotation(self, e: Sequence[Any]) -> sympy.Matrix:
        """Rotation matrix of the half-angle pair."""
        c, s = e
        return sympy.Matrix([[c * c - s * s, -2 * c * s], [2 * c * s, c * c - s * s]])

    def angular_velocity(self, e: Sequence[Any], rate: Sequence[Any]) -> sympy.Matrix:
        """One number."""
        return sympy.Matrix([2 * (e[0] * rate[1] - e[1] * rate[0])])

    def body_angular_velocity(self, e: Sequence[Any], rate: Sequence[Any]) -> sympy.Matrix:
        """Return one number, the same as in world axes."""
        return self.angular_velocity(e, rate)

    def moment(self, e: Sequence[Any], force: Sequence[Any]) -> sympy.Matrix:
        """One number."""
        return sympy.Matrix([(e[0] * force[1] - e[1] * force[0]) / 2])


@dataclass(frozen=True)
class _Turnless(Space):
    """Base class of spaces of point masses."""

    turns: ClassVar[bool] = False

    def rotation(self, e: Sequence[Any]) -> sympy.Matrix:
        """Return the identity: points do not turn."""
        return sympy.eye(self.dimension)

    def angular_velocity(self, e: Sequence[Any], rate: Sequence[Any]) -> sympy.Matrix:
        """Return zero: points do not turn."""
        return sympy.zeros(1, 1)

    def body_angular_velocity(self, e: Sequence[Any], rate: Sequence[Any]) -> sympy.Matrix:
        """Return zero: points do not turn."""
        return sympy.zeros(1, 1)

    def moment(self, e: Sequence[Any], force: Sequence[Any]) -> sympy.Matrix:
        """Return zero: points do not turn."""
        return sympy.zeros(1, 1)


@dataclass(frozen=True)
class Translational(_Turnless):
    """Plane without rotation, for point masses: ``q = (x, y)``.

    Parameters
    ----------
    gravity : sequence
        Acceleration of gravity, m/s^2: two components, which may be random. Default: none.

    Examples
    --------
    >>> Translational(gravity=(0, -9.81)).turns
    False
    """

    name: ClassVar[str] = "translational"
    dimension: ClassVar[int] = 2
    coordinates: ClassVar[tuple[str, ...]] = ("x", "y")


@dataclass(frozen=True)
class Line(_Turnless):
    """One-dimensional space for sliding point masses: ``q = (x,)``.

    Points, positions, velocities, forces and gravity are single numbers, or sequences of one number.  An axis is ``1``
    or ``-1``.  ``body.position`` is a column of one symbol.  Components for lines declare this space in
    `Component.spaces`.

    The order of two points in the given pose defines their side: one point is ahead of the other. Lengths of springs,
    distances and gaps of spheres are positive towards this side. These values become negative, without a kink, when the
    points pass each other.

    Parameters
    ----------
    gravity : number or expression
        Acceleration of gravity along the line, m/s^2.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("fall", uqmbd.Line(gravity=-10))
    >>> stone = mechanism.body("stone", mass=1, position=20, velocity=1)
    >>> mechanism.output("height", stone.position, units="m")
    >>> round(float(uqmbd.simulate(mechanism, [0, 1])["height"][-1]), 6)
    16.0
    """

    name: ClassVar[str] = "line"
    dimension: ClassVar[int] = 1
    coordinates: ClassVar[tuple[str, ...]] = ("x",)
