"""The numbers of a rigid body, checked: mass, inertia, orientation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions import check_dimensions, flatten, numbers, shown
from uqmbd.mechanism.geometry import Space, nominal, quaternion_of_matrix, unit

__all__ = ["inertia_entries", "is_tensor_of_body", "mass_number", "orientation"]

ROUNDING = 1e-12
"""A negative principal moment of this size, relative to the largest, is rounding."""

ROUNDED = 1e-2
"""Moments of inertia as people give them are rounded to this, relative to the largest."""

TENSOR = "a 3 x 3 matrix, (Jxx, Jyy, Jzz) or (Jxx, Jyy, Jzz, Jxy, Jxz, Jyz)"


def mass_number(where: str, mass: Any) -> sympy.Expr:
    """Return the mass of a body, kg; raise `uqmbd.StudyError` if it is missing, infinite, or negative at the means."""
    if mass is None:
        raise StudyError(f"{where}: its mass is missing; give mass= in kg.")
    value = numbers(where, "mass", mass, 1, "kg", scalar=True)[0]
    at_means = _nominal(where, "mass", value)
    if at_means < 0:
        raise StudyError(f"{where}: its mass is {at_means:g} kg{_at_means(value)}; a mass cannot be negative.")
    return value


def inertia_entries(where: str, space: Space, inertia: Any) -> tuple[sympy.Expr, ...]:
    """Return the inertia of a body: none for point masses, one number in the plane, six tensor entries in space.

    Raises `uqmbd.StudyError` if it is missing, has the wrong form, or is physically impossible at the means of the
    random variables.
    """
    if not space.turns:
        if inertia is not None:
            raise StudyError(
                f"{where}: inertia is given, but bodies in {type(space).__name__} space are point masses; leave it out."
            )
        return ()
    if inertia is None:
        form = "one number" if space.dimension == 2 else TENSOR
        raise StudyError(
            f"{where}: its inertia is missing; give inertia= as {form}, about the centre of mass, in kg m^2 "
            "(0 for a point mass)."
        )
    if space.dimension == 2:
        value = numbers(where, "inertia", inertia, 1, "about the centre of mass, kg m^2", scalar=True)[0]
        at_means = _nominal(where, "inertia", value)
        if at_means < 0:
            raise StudyError(f"{where}: its inertia is {at_means:g} kg m^2{_at_means(value)}; it cannot be negative.")
        return (value,)
    return _tensor(where, inertia)


def _tensor(where: str, inertia: Any) -> tuple[sympy.Expr, ...]:
    """Return ``(Jxx, Jyy, Jzz, Jxy, Jxz, Jyz)`` of an inertia tensor."""
    parts = flatten(inertia)
    if len(parts) not in (3, 6, 9):
        raise StudyError(f"{where}: inertia is {shown(inertia)}; expected {TENSOR}, all tensor entries, in kg m^2.")
    entries = numbers(where, "inertia", parts, len(parts), "kg m^2")
    if len(entries) == 9:
        matrix = np.array([_nominal(where, "inertia", x) for x in entries]).reshape(3, 3)
        if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=1e-12 * abs(matrix).max()):
            raise StudyError(f"{where}: the inertia matrix {matrix.tolist()} is not symmetric.")
        entries = [entries[k] for k in (0, 4, 8, 1, 2, 5)]
    elif len(entries) == 3:
        entries += [sympy.S.Zero] * 3
    xx, yy, zz, xy, xz, yz = (_nominal(where, "inertia", x) for x in entries)
    moments = np.asarray(np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), dtype=np.float64)
    if moments[0] < -ROUNDING * abs(moments).max():
        listed = ", ".join(f"{x:.4g}" for x in moments)
        raise StudyError(
            f"{where}: its inertia tensor is not positive semi-definite (principal moments {listed} kg m^2"
            f"{_at_means(*entries)}); check the products of inertia: they are tensor entries, J[0, 2] = +Jxz."
        )
    if not is_tensor_of_body(moments):
        listed = ", ".join(f"{x:.4g}" for x in moments)
        raise StudyError(
            f"{where}: no body has this inertia tensor: its principal moments are {listed} kg m^2"
            f"{_at_means(*entries)}, and the largest is more than the sum of the other two "
            f"({moments[2]:.4g} > {moments[0] + moments[1]:.4g}). It is that about the centre of mass."
        )
    return tuple(entries)


def is_tensor_of_body(moments: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return whether ascending principal moments of inertia (..., 3), kg m^2, belong to a mass distribution: (...).

    None is negative, and none exceeds the sum of the other two.  Numbers that were rounded to 1 % pass.
    """
    slack = ROUNDED * np.abs(moments[..., 2])
    fine: NDArray[np.bool_] = (moments[..., 0] >= -ROUNDING * np.abs(moments).max(axis=-1)) & (
        moments[..., 2] <= moments[..., 0] + moments[..., 1] + slack
    )
    return fine


def orientation(
    where: str, space: Space, angle: Any = None, quaternion: Any = None, rotation: Any = None
) -> tuple[sympy.Expr, ...]:
    """Return the drawn quaternion of a body: a half-angle pair in the plane, nothing where bodies do not turn.

    Raises `uqmbd.StudyError` if the orientation has a form of another space, has two forms at once, or is no rotation.
    """
    forms = {"angle": angle, "quaternion": quaternion, "rotation": rotation}
    given = {key: value for key, value in forms.items() if value is not None}
    _require_form(where, space, given)
    if not space.turns:
        return ()
    if space.dimension == 2:
        turn = numbers(where, "angle", 0 if angle is None else angle, 1, "rad", scalar=True)[0]
        check_dimensions(f"{where}: angle", turn, "rad")
        half = turn / 2
        if half.is_number:
            return (sympy.Float(math.cos(float(half))), sympy.Float(math.sin(float(half))))
        return (sympy.cos(half), sympy.sin(half))
    if rotation is not None:
        numbers(where, "rotation", flatten(rotation), 9, "a 3 x 3 matrix, body to world")
        try:
            return quaternion_of_matrix(rotation)
        except StudyError as error:
            raise StudyError(f"{where}: {error}") from None
    entries = numbers(where, "quaternion", (1, 0, 0, 0) if quaternion is None else quaternion, 4, "scalar first")
    at_means = [_nominal(where, "quaternion", x) for x in entries]
    length = math.hypot(*at_means)
    if abs(length - 1) > 1e-3:
        raise StudyError(
            f"{where}: the quaternion {shown(quaternion)} has length {length:.4g}{_at_means(*entries)}; "
            "expected 1 (scalar first)."
        )
    # q and -q are one orientation: take the one whose first non-zero number is positive
    lead = next(x for x in at_means if abs(x) > 1e-9)
    return unit([x if lead > 0 else -x for x in entries])


def _require_form(where: str, space: Space, given: Mapping[str, Any]) -> None:
    """Raise unless an orientation is given at most once, in the form that belongs to the space."""
    name = type(space).__name__
    if not space.turns:
        right, remedy = set(), f"bodies in {name} space do not turn; leave it out"
    elif space.dimension == 2:
        right, remedy = {"angle"}, "in the plane the orientation is angle= in rad"
    else:
        right = {"quaternion", "rotation"}
        remedy = "in space the orientation is quaternion=(e0, e1, e2, e3) or rotation=3x3"
    for key in given:
        if key not in right:
            raise StudyError(f"{where}: {key} is given, but {remedy}.")
    if len(given) > 1:
        raise StudyError(f"{where}: both {' and '.join(given)} are given; give one of them.")


def _nominal(where: str, key: str, value: sympy.Expr) -> float:
    try:
        return nominal(value)
    except StudyError as error:
        raise StudyError(f"{where}: {key}: {error}") from None


def _at_means(*values: sympy.Expr) -> str:
    """Return a note for a message that a number is the one at the means, if anything is random."""
    return "" if all(x.is_number for x in values) else " at the means of the random variables"
