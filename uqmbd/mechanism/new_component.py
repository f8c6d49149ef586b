"""Preparation of a component for its mechanism: checks, and conversion of its values."""

from __future__ import annotations

from typing import Any

from uqmbd.errors import StudyError
from uqmbd.mechanism.bodies import AttachedFrame, Body, Ground, owners_in
from uqmbd.mechanism.components import Component, CoordinateSet, require_effects, settle
from uqmbd.mechanism.declared import Described, require_free, require_holonomic, require_known
from uqmbd.mechanism.expressions import flatten, shown

__all__ = ["prepare_component"]


def prepare_component(mechanism: Described, given: Any) -> Component:
    """Check a given component and return it, without adding it to the mechanism.

    Omitted body arguments become the ground.  Raises `uqmbd.StudyError` if the object is not a component of this space,
    its name is taken, a body is unknown, or a value is invalid.
    """
    part = _require_component(mechanism, given)
    for body in part.attached.values():
        getattr(body, "drafts", {}).pop(part.name, None)
    where = f"{type(part).__name__} {part.name!r}"
    if mechanism.components.get(part.name) is part:
        raise StudyError(f"{where}: the component has already been added to mechanism {mechanism.name!r}.")
    require_free(mechanism, part.name, where)
    left_out = [role for role in part.grounded if part.attached[role] is None]
    part.attached.update(dict.fromkeys(left_out, mechanism.ground))
    _require_bodies(mechanism, where, part)
    for key, value in settle(where, part, mechanism.space).items():
        declared = part.parameters().get(key)
        if declared is None or declared.kind != "option":
            require_known(mechanism, f"{where}: {key}", value, "law")
    require_holonomic(where, part, mechanism.space)
    require_effects(where, part, mechanism.space, mechanism.effective)
    return part


def _require_component(mechanism: Described, given: Any) -> Component:
    """Return the component to add; raise unless it is a component for the space of the mechanism."""
    if isinstance(given, type) and issubclass(given, Component):
        raise StudyError(
            f"mechanism {mechanism.name!r}: the argument of add() is the class {given.__name__}; expected an object, "
            f"e.g. {given.__name__}{given.signature()}."
        )
    if not isinstance(given, Component):
        raise StudyError(
            f"mechanism {mechanism.name!r}: the argument of add() is {shown(given)}; expected a component such as a "
            "joint, a spring or a force."
        )
    if not isinstance(mechanism.space, given.spaces):
        fitting = ", ".join(space.__name__ for space in given.spaces)
        raise StudyError(
            f"{type(given).__name__} {given.name!r}: the component does not support {type(mechanism.space).__name__} "
            f"space, the space of mechanism {mechanism.name!r}; it supports: {fitting}."
        )
    return given


def _require_bodies(mechanism: Described, where: str, component: Component) -> None:
    """Raise if bodies of a component are equal, invalid or of another mechanism, or if all bodies are the ground."""
    known = f"The bodies of {mechanism.name!r} are: {', '.join(['ground', *mechanism.bodies])}."
    roles: dict[str, str] = {}
    for role, body in component.attached.items():
        if isinstance(body, Ground) and body is not mechanism.ground:
            raise StudyError(
                f"{where}: {role} is the ground of another mechanism; use the ground of {mechanism.name!r}."
            )
        carrier = body.body if isinstance(body, AttachedFrame) else body
        if isinstance(carrier, Body) and mechanism.bodies.get(carrier.name) is not carrier:
            raise StudyError(f"{where}: {role} is body {carrier.name!r} of another mechanism. {known}")
        for owner in owners_in(body.q) if isinstance(body, AttachedFrame) else ():
            if isinstance(owner, CoordinateSet) and mechanism.components.get(owner.name) is not owner.component:
                raise StudyError(
                    f"{where}: {role} is {body.name!r}, which contains coordinates of {owner.name!r}, a component of "
                    f"another mechanism than {mechanism.name!r}."
                )
        if not isinstance(body, (Body, Ground, AttachedFrame)):
            raise StudyError(
                f"{where}: {role} is {shown(body)}; expected a body from mechanism.body(...), or "
                f"mechanism.ground. {known}"
            )
        if isinstance(body, (Body, AttachedFrame)) and body.name in roles:
            raise StudyError(
                f"{where}: {roles[body.name]} and {role} are the same body {body.name!r}; "
                "a component acts between two different bodies, or between a body and the ground."
            )
        roles[body.name] = role
    moves = type(component).coordinates is not Component.coordinates
    moves |= any(owners_in(flatten(value)) for value in component.given.values())
    if component.attached and not moves and all(body is mechanism.ground for body in component.attached.values()):
        named = " and ".join(component.attached)
        verb = "is" if len(component.attached) == 1 else "are"
        raise StudyError(
            f"{where}: {named} {verb} the ground, which does not move, so the component has no effect; at least one "
            f"end must be a body. {known}"
        )
