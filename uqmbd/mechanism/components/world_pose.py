"""Joints given by a pose in the world, as drawn, instead of points and axes in the frames of two bodies."""

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
"""Argument of a component -> beginning of the names of the parameters that it replaces."""

KINDS = {"at": ("point",), "axis": ("axis", "turning_axis")}

ROUNDING = 1e-15
"""Size, relative to the largest entry, below which an entry of a turned vector is rounding."""


class Declared(Protocol):
    """Declarations of a class of components."""

    bodies: ClassVar[tuple[str, ...]]
    grounded: ClassVar[tuple[str, ...]]
    drawn_by: ClassVar[tuple[str, ...]]
    symbol: ClassVar[str]
    __signature__: ClassVar[inspect.Signature]

    @classmethod
    def parameters(cls) -> dict[str, Parameter]:
        """Return the declared parameters by name."""


class _Drawn(Declared, Protocol):
    """A component whose arguments may be given in the world frame."""

    given: dict[str, Any]
    world_pose: dict[str, Any]

    @property
    def attached(self) -> Mapping[str, Any]: ...

    @classmethod
    def body_of(cls, parameter: str) -> str: ...

    def drawn_frame(self, role: str) -> Frame: ...


def replaced(component: type[Declared], keyword: str) -> list[str]:
    """Return the parameters that a pose in the world replaces; none where a component does not accept one.

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
    # one point alone would leave the other one open
    return [] if keyword == "at" and len(found) < 2 else found


def localised(where: str, component: _Drawn, space: Space) -> dict[str, Any]:
    """Return the arguments of a component, with poses in the world converted to points and axes of the bodies.

    Raises `uqmbd.StudyError` if a point or axis is given in both ways, is not a number, or a body is drawn in a random
    pose.
    """
    given = dict(component.given)
    declared = component.parameters()
    for keyword, value in component.world_pose.items():
        names = replaced(type(component), keyword)
        twice = [name for name in names if name in given]
        if twice:
            raise StudyError(
                f"{where}: both {keyword} and {twice[0]} are given; give {keyword} in world axes as drawn, "
                f"or {' and '.join(names)} in the frames of the bodies."
            )
        size = max(declared[name].size(space) for name in names)
        if size == 0:
            raise StudyError(
                f"{where}: {keyword} is given; in the plane everything turns about the same axis, so leave it out."
            )
        value = without_quantities(f"{where}: {keyword}", value, declared[names[0]].units)
        entries = numbers(where, keyword, value, size, "world axes, as drawn")
        _require_fixed(f"{where}: {keyword} is {shown(value)}, which", entries, names)
        for name in names:
            given[name] = _seen_from(where, component, keyword, name, entries)
    return given


def _seen_from(where: str, component: _Drawn, keyword: str, name: str, entries: list[sympy.Expr]) -> list[float]:
    """Point or axis in the frame of the body it belongs to, as drawn."""
    role = component.body_of(name)
    frame = component.drawn_frame(role)
    body = f"{role} {getattr(component.attached[role], 'name', '')!r}"
    used = (*frame.q[: frame.space.dimension], *frame.quaternion) if keyword == "at" else frame.quaternion
    _require_fixed(f"{where}: {keyword} is given, but the pose of {body} as drawn", list(used), [name])
    vector = sympy.Matrix(entries) - (frame.position if keyword == "at" else sympy.zeros(len(entries), 1))
    found = [float(x) for x in frame.rotation.T * vector]
    size = max(1.0, *map(abs, found))
    return [0.0 if abs(x) < ROUNDING * size else x for x in found]


def _require_fixed(what: str, entries: list[sympy.Expr], names: list[str]) -> None:
    strangers = sorted({str(s) for x in entries for s in x.free_symbols})
    if strangers:
        raise StudyError(
            f"{what} depends on {', '.join(strangers)}; a joint is given in the world only where its geometry is not "
            f"random and does not move. Give {' and '.join(names)} in the frames of the bodies."
        )
