"""Frames of bodies, with quantities for components and outputs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import sympy

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions import as_symbolic, flatten, numbers, shown, unknown_symbol
from uqmbd.mechanism.geometry.matrix import Matrix
from uqmbd.mechanism.geometry.quaternions import quaternion_product
from uqmbd.mechanism.geometry.space import Space
from uqmbd.names import checked
from uqmbd.randomness import Symbolic
from uqmbd.typing import Vector
from uqmbd.units import without_quantities

__all__ = ["Frame", "NamedFrame"]


class Frame:
    """Position, rotation and velocity of a body frame, as SymPy expressions.

    In `Component.terms`, each body argument is a frame.  Outputs use the subclass `Body`.  Vectors are columns
    (`sympy.Matrix`) of `space.dimension` numbers in world axes, unless stated otherwise.

    Parameters
    ----------
    space : Space
        Space of the mechanism.
    q, v, a : sequence of expressions, or None
        Coordinates and their first and second time derivatives.  None: the fixed ground.

    Raises
    ------
    uqmbd.StudyError
        If the number of coordinates does not fit the space.

    Examples
    --------
    >>> import sympy, uqmbd
    >>> x, y, c, s = sympy.symbols("x y c s")
    >>> frame = Frame(uqmbd.Planar(), (x, y, c, s), sympy.symbols("vx vy vc vs"))
    >>> frame.point((1, 0)).T
    Matrix([[c**2 - s**2 + x, 2*c*s + y]])
    """

    @typechecked
    def __init__(
        self,
        space: Space,
        q: Sequence[Any] | None = None,
        v: Sequence[Any] | None = None,
        a: Sequence[Any] | None = None,
    ) -> None:
        self.space = space
        d = space.dimension
        self.is_ground = q is None
        still = (0,) * d + (1,) + (0,) * (space.size - d - 1) if space.turns else (0,) * d
        for name, given in (("q", q), ("v", v), ("a", a)):
            if given is not None and len(given) != space.size:
                raise StudyError(f"Frame: {name} is {shown(given)}; expected {space.size} coordinates of the space.")
        self.q: tuple[sympy.Expr, ...] = tuple(map(as_symbolic, still if q is None else q))
        self.v: tuple[sympy.Expr, ...] = tuple(map(as_symbolic, (0,) * space.size if v is None else v))
        self._a = tuple(map(as_symbolic, (0,) * space.size if a is None else a))

    @property
    def position(self) -> Matrix:
        """Position of the frame's origin."""
        return sympy.Matrix(self.q[: self.space.dimension])

    @property
    def velocity(self) -> Matrix:
        """Velocity of the frame's origin."""
        return sympy.Matrix(self.v[: self.space.dimension])

    @property
    def acceleration(self) -> Matrix:
        """Acceleration of the frame's origin (outputs only)."""
        return sympy.Matrix(self._a[: self.space.dimension])

    @property
    def quaternion(self) -> Matrix:
        """Unit quaternion, body to world, scalar first, a column; in planar space the half-angle pair."""
        return sympy.Matrix(self.q[self.space.dimension :])

    @property
    def quaternion_rate(self) -> Matrix:
        """Time derivative of the quaternion, a column."""
        return sympy.Matrix(self.v[self.space.dimension :])

    @property
    def quaternion_acceleration(self) -> Matrix:
        """Second time derivative of the quaternion, a column (outputs only)."""
        return sympy.Matrix(self._a[self.space.dimension :])

    @property
    def rotation(self) -> Matrix:
        """Rotation matrix, body to world."""
        return self.space.rotation(self.quaternion)

    @property
    def angular_velocity(self) -> Matrix:
        """Angular velocity, world axes; in planar space a column of one number."""
        return self.space.angular_velocity(self.quaternion, self.quaternion_rate)

    @property
    def body_angular_velocity(self) -> Matrix:
        """Angular velocity, body axes; in planar space a column of one number."""
        return self.space.body_angular_velocity(self.quaternion, self.quaternion_rate)

    @property
    def angular_acceleration(self) -> Matrix:
        """Angular acceleration, world axes (outputs only)."""
        return self._rate(self.angular_velocity)

    @checked
    def attitude(self, local: Sequence[Any]) -> tuple[sympy.Expr, ...]:
        """Return the quaternion (frame to world) of another frame, given its quaternion `local` relative to this frame.

        Examples
        --------
        >>> import sympy
        >>> import uqmbd
        >>> mechanism = uqmbd.Mechanism("arm", uqmbd.Planar())
        >>> arm = mechanism.body("arm", mass=1, inertia=1, angle=sympy.pi / 2, angular_velocity=3)
        >>> arm.attitude((1, 0)) == tuple(arm.quaternion)  # a frame parallel to the arm
        True
        """
        return quaternion_product(self.quaternion, local)

    @checked
    def direction(self, local: Vector) -> Matrix:
        """Transform a vector from body axes to world axes.

        Examples
        --------
        >>> import sympy
        >>> import uqmbd
        >>> mechanism = uqmbd.Mechanism("arm", uqmbd.Planar())
        >>> arm = mechanism.body("arm", mass=1, inertia=1, angle=sympy.pi / 2, angular_velocity=3)
        >>> mechanism.output("y", arm.direction((1, 0))[1])
        >>> round(float(uqmbd.simulate(mechanism, [0, 1])["y"][0]), 6)
        1.0
        """
        return self.rotation * self._column(local, "direction", "vector")

    @checked
    def point(self, local: Vector) -> Matrix:
        """Return the world position of a point given in the body frame.

        Examples
        --------
        >>> import sympy
        >>> import uqmbd
        >>> mechanism = uqmbd.Mechanism("arm", uqmbd.Planar())
        >>> arm = mechanism.body("arm", mass=1, inertia=1, angle=sympy.pi / 2, angular_velocity=3)
        >>> mechanism.output("x", arm.point((2, 0))[0], units="m")
        >>> mechanism.output("y", arm.point((2, 0))[1], units="m")
        >>> found = uqmbd.simulate(mechanism, [0, 1])
        >>> round(float(found["x"][0]), 6), round(float(found["y"][0]), 6)
        (0.0, 2.0)
        """
        return self.position + self.rotation * self._column(local, "point", "point")

    @checked
    def point_velocity(self, local: Vector) -> Matrix:
        """Return the world velocity of a point fixed in the body: ``r' + d/dt(A c)``.

        ``r`` is the position, ``A`` the rotation matrix, quadratic in the quaternion, and ``c`` the argument `local`.

        Examples
        --------
        >>> import sympy
        >>> import uqmbd
        >>> mechanism = uqmbd.Mechanism("arm", uqmbd.Planar())
        >>> arm = mechanism.body("arm", mass=1, inertia=1, angle=sympy.pi / 2, angular_velocity=3)
        >>> mechanism.output("speed", arm.point_velocity((2, 0))[0], units="m/s")
        >>> round(float(uqmbd.simulate(mechanism, [0, 1])["speed"][0]), 6)
        -6.0
        """
        return self._rate(self.point(local))

    @checked
    def point_acceleration(self, local: Vector) -> Matrix:
        """Return the world acceleration of a point fixed in the body (outputs only).

        Examples
        --------
        >>> import sympy
        >>> import uqmbd
        >>> mechanism = uqmbd.Mechanism("arm", uqmbd.Planar())
        >>> arm = mechanism.body("arm", mass=1, inertia=1, angle=sympy.pi / 2, angular_velocity=3)
        >>> mechanism.output("a", arm.point_acceleration((2, 0))[1], units="m/s^2")
        >>> round(float(uqmbd.simulate(mechanism, [0, 1])["a"][0]), 4)  # -3^2 * 2
        -18.0
        """
        return self._rate(self.point_velocity(local))

    def _column(self, local: Any, method: str, kind: str) -> Matrix:
        """Return components as a column; raise if their number differs from the dimension."""
        local = without_quantities(f"{method}(): its argument local", local, "m" if kind == "point" else "")
        given = flatten(local)
        if len(given) != self.space.dimension or any(isinstance(x, (str, bytes)) for x in given):
            raise StudyError(
                f"{method}(): the argument local is {shown(local)}; expected {self.space.dimension} numbers, one for "
                f"each axis of the body. If it is a parameter of a component, declare it with kind={kind!r}, as in "
                f"uqmbd.Parameter(..., kind={kind!r})."
            )
        return sympy.Matrix(numbers(f"{method}()", "its argument local", given, self.space.dimension))

    def _rate(self, vector: sympy.Matrix) -> Matrix:
        if self.is_ground:
            return vector * 0
        result = sympy.zeros(*vector.shape)
        for x, dx in self._flow():
            result += vector.diff(x) * dx
        return result

    def _flow(self) -> Iterable[tuple[sympy.Expr, sympy.Expr]]:
        """Return the symbols of the frame's motion with their rates."""
        return zip((*self.q, *self.v), (*self.v, *self._a), strict=True)


class NamedFrame(Frame):
    """Frame of a body of a mechanism, or of its ground.

    Examples
    --------
    The ground is a named frame, as are links of an imported file that are fixed to a body:

    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("empty", uqmbd.Planar())
    >>> isinstance(mechanism.ground, uqmbd.extend.NamedFrame), mechanism.ground.name, mechanism.ground.point((1, 2)).T
    (True, 'ground', Matrix([[1, 2]]))
    """

    name: str

    @property
    def rates(self) -> dict[sympy.Expr, sympy.Expr]:
        """Coordinates of the frame, and their rates."""
        return {x: dx for x, dx in zip(self.q, self.v, strict=True) if x.is_Symbol}

    def in_terms(self) -> Frame:
        """Return the frame for the terms of components, in the symbols of the body."""
        return Frame(self.space, self.q, self.v)

    def _column(self, local: Any, method: str, kind: str) -> Matrix:
        column = super()._column(local, method, kind)
        for symbol in sorted(column.free_symbols, key=str):
            if not isinstance(symbol, Symbolic):
                raise StudyError(f"{method}(): its argument local contains {unknown_symbol(symbol)}")
        return column
