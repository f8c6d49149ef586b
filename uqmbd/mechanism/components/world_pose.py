"""Definition of joints by one point or axis in the world frame instead of points and axes in two body frames."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any, ClassVar, Protocol

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.components.parameter import Parameter
from uqmbd.mechanism.expressions import numbers, shown
from uqmbd.mechanism.geometry import Frame, Space
from uqmbd.units import without_quantities

__all__ = ["KEYWORDS", "Declared", "localised", "replaced"]

KEYWORDS = {"at": "point", "axis": "axis"}
"""Argument of a component -> beginning of the names of the replaced parameters."""

KINDS = {"at": ("point",), "axis": ("axis", "turning_axis")}

ROUNDING = 1e-15
"""Size, relative to the largest entry, below which an entry of a turned vector is rounding."""


class Declared(Protocol):
    """Component class, with its declarations."""

    bodies: ClassVar[tuple[str, ...]]
    grounded: ClassVar[tuple[str, ...]]
    drawn_by: ClassVar[tuple[str, ...]]
    symbol: ClassVar[str]
    __signature__: ClassVar[inspect.Signature]

    @classmethod
    def parameters(cls) -> dict[str, Parameter]:
        """Return the declared parameters by name."""


class _Drawn(Declared, Protocol):
    """Component whose arguments may be given in the world frame."""

    given: dict[str, Any]
    world_pose: dict[str, Any]

    @property
    def attached(self) -> Mapping[str, Any]: ...

    @classmethod
    def body_of(cls, parameter: str) -> str: ...

    def drawn_frame(self, role: str) -> Frame: ...


def replaced(component: type[Declared], keyword: str) -> list[str]:
    """Return the parameters that ``at`` or ``axis`` replaces; empty if the component does not accept the keyword.

    >>> import uqmbd
    >>> class Pin(uqmbd.Component):
    ...     point_i = uqmbd.Parameter("m", "joint point, frame of body i", kind="point")
    ...     point_j = uqmbd.Parameter("m", "joint point, frame of body j", kind="point")
    >>> replaced(Pin, "at"), replaced(Pin, "axis")
    (['point_i', 'point_j'], [])
    """
    declared = component.parameters()
    if keyword not in component.drawn_by or keyword in declared:
        return []
    names = [f"{KEYWORDS[keyword]}_{end}" for end in "ij"]
    found = [x for x in names if x in declared and declared[x].kind in KINDS[keyword]]
    # a single point would leave the other point undefined
    return [] if keyword == "at" and len(found) < 2 else found


def localised(where: str, component: _Drawn, space: Space) -> dict[str, Any]:
    """Return the arguments of a component, with points and axes converted from the world frame to body frames.

    Raises `uqmbd.StudyError` if a point or axis is given in both frames or contains a non-number. Raises it also if a
    body is drawn in a random pose.
    """
    given = dict(component.given)
    declared = component.parameters()
    for keyword, value in component.world_pose.items():
        names = replaced(type(component), keyword)
        twice = [name for name in names if name in given]
        if twice:
            raise StudyError(
                f"{where}: both {keyword} and {twice[0]} are given. Give either {keyword} in world axes, for the "
                f"given pose, or {' and '.join(names)} in the frames of the bodies."
            )
        size = max(declared[name].size(space) for name in names)
        if size == 0:
            raise StudyError(
                f"{where}: {keyword} is given, but in planar space all rotations have the same axis; omit it."
            )
        value = without_quantities(f"{where}: {keyword}", value, declared[names[0]].units)
        entries = numbers(where, keyword, value, size, "world axes, given pose")
        _require_fixed(f"{where}: {keyword} is {shown(value)}, which", entries, names)
        for name in names:
            given[name] = _seen_from(where, component, keyword, name, entries)
    return given


def _seen_from(where: str, component: _Drawn, keyword: str, name: str, entries: list[sympy.Expr]) -> list[float]:
    """Convert a point or an axis from the world frame to the drawn frame of its body."""
    role = component.body_of(name)
    frame = component.drawn_frame(role)
    body = f"{role} {getattr(component.attached[role], 'name', '')!r}"
    used = (*frame.q[: frame.space.dimension], *frame.quaternion) if keyword == "at" else frame.quaternion
    _require_fixed(f"{where}: {keyword} is given, but the given pose of {body}", list(used), [name])
    vector = sympy.Matrix(entries) - (frame.position if keyword == "at" else sympy.zeros(len(entries), 1))
    found = [float(x) for x in frame.rotation.T * vector]
    size = max(1.0, *map(abs, found))
    return [0.0 if abs(x) < ROUNDING * size else x for x in found]


def _require_fixed(what: str, entries: list[sympy.Expr], names: list[str]) -> None:
    strangers = sorted({str(s) for x in entries for s in x.free_symbols})
    if strangers:
        raise StudyError(
            f"{what} depends on {', '.join(strangers)}; a joint can be defined in world axes only if its geometry is "
            f"neither random nor time-dependent. Give {' and '.join(names)} in the frames of the bodies."
        )
