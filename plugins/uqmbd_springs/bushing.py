"""Bushing: an elastic, damped connection in all directions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, overload

import numpy as np
import sympy

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.laws import law_values
from uqmbd.typing import Vector

__all__ = ["Bushing"]


class Bushing(uqmbd.Component):
    """Forces and moments that are linear in the relative displacement, rotation and their rates, in frame i.

    Frame i is the frame of body i. The rotation is relative to the given pose. The measure of the rotation is twice the
    vector part of the relative quaternion, which equals the rotation vector for small rotations. In a matrix that
    couples translation and rotation, the rows and columns of the displacement come first.

    Examples
    --------
    >>> Bushing.signature()
    '(name, body_i, body_j, point_i, point_j, stiffness, damping=0)'
    """

    symbol = "spring"
    spaces = (uqmbd.Spatial, uqmbd.Planar)
    point_i = uqmbd.Parameter("m", "point without force, frame of body i", kind="point", body="body_i")
    point_j = uqmbd.Parameter("m", "point without force, frame of body j", kind="point", body="body_j")
    stiffness = uqmbd.Parameter(
        "N/m, N m/rad",
        "diagonal (3 + 3 numbers, 2 + 1 in planar space), symmetric matrix, or one number for N/m and for N m/rad",
        kind="option",
        example=2.0,
    )
    damping = uqmbd.Parameter("N s/m, N m s/rad", "in a form of the stiffness; 0: no damping", kind="option", default=0)

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector,
            stiffness: Vector | Sequence[Vector], damping: Vector | Sequence[Vector] = 0,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector,
            stiffness: Vector | Sequence[Vector], damping: Vector | Sequence[Vector] = 0,
        ) -> None: ...  # fmt: skip
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...

    def prepare(self) -> dict[str, Any]:
        """Return stiffness and damping as matrices, and the relative quaternion at which the moment is zero."""
        turn = self.drawn_quaternion()
        size = 6 if len(turn) == 4 else 3
        return {
            "turn": turn,
            "k": _matrix("stiffness", self.stiffness, size),
            "c": _matrix("damping", self.damping, size),
        }

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Potential | uqmbd.VirtualWork]:
        """Yield energy and dissipation."""
        i, j = p.body_i, p.body_j
        offset, into = j.point(p.point_j) - i.point(p.point_i), i.rotation.T
        relative = uqmbd.extend.relative_quaternion(i.attitude(p.turn), j.quaternion)
        # q and -q are the same rotation, so the vector part is multiplied by the scalar part
        angle = 2 * relative[0] * sympy.Matrix(relative[1:])
        # convert the rotation from the axes of body j in the given pose to the axes of body i
        if p.space.dimension == 3:
            back = (p.turn[0], *(-x for x in p.turn[1:]))
            angle = sympy.Matrix(
                uqmbd.extend.quaternion_product(uqmbd.extend.quaternion_product(p.turn, (0, *angle)), back)[1:]
            )
        size = p.space.dimension + len(angle)
        k, c = (sympy.Matrix(size, size, list(x)) for x in (p.k, p.c))
        strain = sympy.Matrix([*(into * offset), *angle])
        yield uqmbd.Potential((strain.T * k * strain)[0] / 2)
        if any(x != 0 for x in c):
            spin = j.angular_velocity - i.angular_velocity
            arm = (
                i.angular_velocity.cross(offset)
                if p.space.dimension == 3
                else i.angular_velocity[0] * _perpendicular(offset)
            )
            speed = into * (j.point_velocity(p.point_j) - i.point_velocity(p.point_i) - arm)
            rates = sympy.Matrix([*speed, *(into * spin if p.space.dimension == 3 else spin)])
            yield uqmbd.VirtualWork(-c * rates, rates)


def _perpendicular(vector: sympy.Matrix) -> sympy.Matrix:
    """Return a vector of the plane, rotated by a right angle."""
    return sympy.Matrix([-vector[1], vector[0]])


def _matrix(what: str, value: Any, size: int) -> list[Any]:
    """Return the entries, row by row, of a matrix given as one number, its diagonal, or all entries."""
    try:
        given = np.asarray(value, dtype=object).ravel().tolist()
    except ValueError:
        given = [value]
    for entry in given:
        try:
            law_values(entry, what=what)
        except uqmbd.StudyError:
            raise uqmbd.StudyError(
                f"{what} is {value!r}; expected numbers, or expressions in random variables."
            ) from None
    parts = [sympy.sympify(x, strict=True) for x in given]
    if len(parts) == 1:
        parts *= size
    if len(parts) == size:
        return [parts[i] if i == j else sympy.Integer(0) for i in range(size) for j in range(size)]
    if len(parts) != size * size:
        raise uqmbd.StudyError(
            f"{what} has {len(parts)} entries; expected one number, {size} (forces, then moments), or a matrix of "
            f"{size} x {size}."
        )
    matrix = sympy.Matrix(size, size, parts)
    if matrix != matrix.T:
        raise uqmbd.StudyError(f"{what} is not a symmetric matrix; expected equal entries (i, j) and (j, i).")
    return parts
