"""Construction of a body from its checked arguments."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.bodies import Body, BodyPose, BodyTerms, inertia_entries, mass_number, orientation
from uqmbd.mechanism.components import settle
from uqmbd.mechanism.declared import Described, require_known
from uqmbd.mechanism.expressions import as_symbolic, check_dimensions, numbers, shown
from uqmbd.mechanism.geometry import check_shapes
from uqmbd.units import without_quantities

__all__ = ["make_body"]

UNITS = {
    "mass": "kg", "inertia": "kg m^2", "com": "m", "position": "m", "angle": "rad", "quaternion": "1", "rotation": "1",
    "velocity": "m/s", "angular_velocity": "rad/s",
}  # fmt: skip
"""Units of the numbers of a body."""


def make_body(mechanism: Described, name: str, stated: Mapping[str, Any], hold: Any, shape: Any = None) -> Body:
    """Return a body that is not yet added to its mechanism, from a checked name and arguments of `Mechanism.body`.

    None represents an omitted number.  Raises `uqmbd.StudyError` if a value is missing, has the wrong dimension, or is
    physically impossible.
    """
    where, space, d = f"body {name!r}", mechanism.space, mechanism.space.dimension
    stated = {key: without_quantities(f"{where}: {key}", value, UNITS[key]) for key, value in stated.items()}
    if not isinstance(hold, bool):
        raise StudyError(f"{where}: hold is {shown(hold)}; expected True or False.")
    if stated["angular_velocity"] is not None and not space.turns:
        raise StudyError(
            f"{where}: angular_velocity is given, but bodies in {type(space).__name__} space do not rotate; omit it."
        )
    shapes = check_shapes(where, shape)
    for one in shapes:
        require_known(mechanism, f"{where}: shape", one.expressions, "number")
    for key, value in stated.items():
        require_known(mechanism, f"{where}: {key}", value, "number")
    moments = inertia_entries(where, space, stated["inertia"])
    heavy = mass_number(where, stated["mass"])
    angle = stated["angle"]
    turned = orientation(where, space, angle, stated["quaternion"], stated["rotation"])

    def vector(key: str, size: int, hint: str, default: Any = None) -> tuple[sympy.Expr, ...] | None:
        value = default if stated[key] is None else stated[key]
        found = () if value is None else tuple(numbers(where, key, value, size, f"{hint}, {UNITS[key]}"))
        for entry in found:
            check_dimensions(f"{where}: {key}", entry, UNITS[key])
        return None if value is None else found

    origin = (0,) * d
    pose = BodyPose(
        q=(*(vector("position", d, "world axes", origin) or ()), *turned),
        velocity=vector("velocity", d, "world axes"),
        angular_velocity=vector("angular_velocity", 3 if d == 3 else 1, "body axes"),
        hold=hold,
        angle=as_symbolic(0 if angle is None else angle),
    )
    centre = vector("com", d, "centre of mass, body frame", origin)
    terms = BodyTerms(name, mechanism.ground, mass=heavy, com=centre, inertia=moments, gravity=space.gravity)
    body = Body(name, space, terms, pose, shapes)
    terms.attached = {"body": body}
    settle(where, terms, space)
    return body
