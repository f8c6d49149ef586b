"""Checks of the numbers of a rigid body: mass, inertia, orientation."""

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
"""Size of a negative principal moment, relative to the largest, that counts as rounding."""

ROUNDED = 1e-2
"""Rounding of moments of inertia in user input, relative to the largest moment."""

TENSOR = "a 3 x 3 matrix, (Jxx, Jyy, Jzz) or (Jxx, Jyy, Jzz, Jxy, Jxz, Jyz)"


def mass_number(where: str, mass: Any) -> sympy.Expr:
    """Return the mass of a body, kg; raise `uqmbd.StudyError` if it is missing, infinite, or negative at the means."""
    if mass is None:
        raise StudyError(f"{where}: the mass is missing; give mass= in kg.")
    value = numbers(where, "mass", mass, 1, "kg", scalar=True)[0]
    at_means = _nominal(where, "mass", value)
    if at_means < 0:
        raise StudyError(f"{where}: the mass is {at_means:g} kg{_at_means(value)}; expected 0 or more.")
    return value


def inertia_entries(where: str, space: Space, inertia: Any) -> tuple[sympy.Expr, ...]:
    """Return the inertia of a body: no number for point masses, one in planar space, six entries in three dimensions.

    Raises `uqmbd.StudyError` if the inertia is missing, has the wrong form, or is physically impossible at the means of
    random variables.
    """
    if not space.turns:
        if inertia is not None:
            raise StudyError(
                f"{where}: inertia is given, but bodies in {type(space).__name__} space are point masses; omit inertia."
            )
        return ()
    if inertia is None:
        form = "one number" if space.dimension == 2 else TENSOR
        raise StudyError(
            f"{where}: the inertia is missing; give inertia= as {form}, about the centre of mass, in "
            "kg m^2 (0 for a point mass)."
        )
    if space.dimension == 2:
        value = numbers(where, "inertia", inertia, 1, "about the centre of mass, kg m^2", scalar=True)[0]
        at_means = _nominal(where, "inertia", value)
        if at_means < 0:
            raise StudyError(f"{where}: the inertia is {at_means:g} kg m^2{_at_means(value)}; expected 0 or more.")
        return (value,)
    return _tensor(where, inertia)


def _tensor(where: str, inertia: Any) -> tuple[sympy.Expr, ...]:
    """Return ``(Jxx, Jyy, Jzz, Jxy, Jxz, Jyz)`` of an inertia tensor."""
    parts = flatten(inertia)
    if len(parts) not in (3, 6, 9):
        raise StudyError(f"{where}: inertia is {shown(inertia)}; expected {TENSOR}, with tensor entries in kg m^2.")
    entries = numbers(where, "inertia", parts, len(parts), "kg m^2")
    if len(entries) == 9:
        matrix = np.array([_nominal(where, "inertia", x) for x in entries]).reshape(3, 3)
        if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=1e-12 * abs(matrix).max()):
            raise StudyError(
                f"{where}: the inertia matrix {matrix.tolist()} is not symmetric; expected a symmetric matrix."
            )
        entries = [entries[k] for k in (0, 4, 8, 1, 2, 5)]
    elif len(entries) == 3:
        entries += [sympy.S.Zero] * 3
    xx, yy, zz, xy, xz, yz = (_nominal(where, "inertia", x) for x in entries)
    moments = np.asarray(np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), dtype=np.float64)
    if moments[0] < -ROUNDING * abs(moments).max():
        listed = ", ".join(f"{x:.4g}" for x in moments)
        raise StudyError(
            f"{where}: the inertia tensor is not positive semi-definite (principal moments {listed} kg "
            f"m^2{_at_means(*entries)}). Check the signs of the products of inertia; the tensor entry "
            "J[0, 2] is +Jxz."
        )
    if not is_tensor_of_body(moments):
        listed = ", ".join(f"{x:.4g}" for x in moments)
        raise StudyError(
            f"{where}: the inertia tensor is physically impossible. Its principal moments are {listed} kg "
            f"m^2{_at_means(*entries)}, and the largest exceeds the sum of the other two ({moments[2]:.4g} > "
            f"{moments[0] + moments[1]:.4g}). Give the tensor about the centre of mass."
        )
    return tuple(entries)


def is_tensor_of_body(moments: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return whether a mass distribution can have principal moments of inertia (..., 3), ascending, kg m^2: (...).

    No moment may be negative, and no moment may exceed the sum of the other two.  Rounding to 1 % is tolerated.
    """
    slack = ROUNDED * np.abs(moments[..., 2])
    fine: NDArray[np.bool_] = (moments[..., 0] >= -ROUNDING * np.abs(moments).max(axis=-1)) & (
        moments[..., 2] <= moments[..., 0] + moments[..., 1] + slack
    )
    return fine


def orientation(
    where: str, space: Space, angle: Any = None, quaternion: Any = None, rotation: Any = None
) -> tuple[sympy.Expr, ...]:
    """Return the given quaternion of a body: a half-angle pair in planar space, empty for point masses.

    Raises `uqmbd.StudyError` if the orientation is given twice, in a form for another space, or is not a rotation.
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
            f"{where}: the quaternion {shown(quaternion)} has the length {length:.4g}{_at_means(*entries)}; expected "
            "the length 1, with the scalar part first."
        )
    # q and -q are the same orientation: choose the sign so that the first non-zero number is positive
    lead = next(x for x in at_means if abs(x) > 1e-9)
    return unit([x if lead > 0 else -x for x in entries])


def _require_form(where: str, space: Space, given: Mapping[str, Any]) -> None:
    """Raise if an orientation is given more than once, or in a form for another space."""
    name = type(space).__name__
    if not space.turns:
        right, remedy = set(), f"bodies in {name} space do not rotate; omit it"
    elif space.dimension == 2:
        right, remedy = {"angle"}, "in planar space the orientation is angle= in rad"
    else:
        right = {"quaternion", "rotation"}
        remedy = "in three dimensions the orientation is quaternion=(e0, e1, e2, e3) or rotation=3x3"
    for key in given:
        if key not in right:
            raise StudyError(f"{where}: {key} is given, but {remedy}.")
    if len(given) > 1:
        raise StudyError(f"{where}: both {' and '.join(given)} are given; give only one of them.")


def _nominal(where: str, key: str, value: sympy.Expr) -> float:
    try:
        return nominal(value)
    except StudyError as error:
        raise StudyError(f"{where}: {key}: {error}") from None


def _at_means(*values: sympy.Expr) -> str:
    """Return a note that a number in a message applies at the means, if any value is random."""
    return "" if all(x.is_number for x in values) else " at the means of the random variables"
