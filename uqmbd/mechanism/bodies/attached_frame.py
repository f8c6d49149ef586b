"""Frames that move relative to their body, such as nodes of a deformed body."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import sympy

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.bodies.body import Body, BodyPose
from uqmbd.mechanism.components import CoordinateSet, StateSymbol
from uqmbd.mechanism.expressions import as_symbolic, numbers, shown
from uqmbd.mechanism.geometry import Frame, NamedFrame, Space

__all__ = ["AttachedFrame", "carrier_name", "flow_of", "local_in_body", "owners_in"]


class AttachedFrame(NamedFrame):
    """Frame that moves relative to a body by coordinates of components; joints and forces accept it as a body.

    Parameters
    ----------
    name : str
        Name of the frame, for messages and figures, such as ``"rod.node(7)"``.
    body : body
        Body that carries the frame.
    offset : sequence of expressions
        Origin of the frame, in the axes of the body, m: expressions in coordinates of components
        (``component.coordinate(name)``), numbers and random variables.
    turned : sequence of expressions, optional
        Unit quaternion of the frame relative to the body, scalar first; in planar space the half-angle pair. Default:
        the frame is parallel to the body.

    Raises
    ------
    uqmbd.StudyError
        If `body` is not a body, or the number of expressions does not fit the space.

    Examples
    --------
    A telescope is a coordinate of a component; a spring pulls at its tip:

    >>> import uqmbd
    >>> from uqmbd_springs import SpringDamper
    >>> class Telescope(uqmbd.Component):
    ...     bodies, spaces = ("body",), (uqmbd.Translational,)
    ...     mass = uqmbd.Parameter("kg", "mass of the tip")
    ...     def coordinates(self):
    ...         return {"extension": uqmbd.extend.Coordinate("m", initial=1)}
    ...     def terms(self, p):
    ...         yield uqmbd.Kinetic(p.mass * p.coordinate("extension", 1) ** 2 / 2)
    >>> mechanism = uqmbd.Mechanism("crane", uqmbd.Translational())
    >>> base = mechanism.body("base", mass=1e9)
    >>> telescope = mechanism.add(Telescope("telescope", base, mass=4))
    >>> tip = uqmbd.extend.AttachedFrame("tip", base, (telescope.coordinate("extension"), 0))
    >>> spring = mechanism.add(SpringDamper("spring", base, tip, (0, 0), (0, 0), stiffness=16))
    >>> mechanism.output("x", tip.position[0], units="m")
    >>> round(float(uqmbd.simulate(mechanism, [0, 1.5])["x"][-1]), 4)  # cos(2 t)
    -0.99
    """

    @typechecked
    def __init__(self, name: str, body: Any, offset: Sequence[Any], turned: Sequence[Any] | None = None) -> None:
        if not isinstance(body, Body):
            raise StudyError(
                f"AttachedFrame {name!r}: body is {shown(body)}; expected a body from mechanism.body(...)."
            )
        space = body.space
        where, size = f"AttachedFrame {name!r}", space.size - space.dimension
        moved = numbers(where, "offset", offset, space.dimension, "axes of the body, m")
        still = (1,) + (0,) * (size - 1) if size else ()
        local = numbers(where, "turned", still if turned is None else turned, size, "unit quaternion")
        self.name, self.body, self.offset, self.turned = name, body, tuple(moved), tuple(local)
        self.space, self.is_ground = space, False
        self.q = tuple(map(as_symbolic, _coordinates(space, body.q, self.offset, self.turned)))
        self._moving = flow_of([body, *owners_in(self.q)])

    # the base class stores rates; here they are derived when they are first needed, which takes long for modal bodies
    @cached_property
    def v(self) -> tuple[sympy.Expr, ...]:  # type: ignore[override]
        """Time derivatives of the coordinates."""
        return tuple(self._rate(sympy.Matrix(self.q)))

    @cached_property
    def _a(self) -> tuple[sympy.Expr, ...]:  # type: ignore[override]
        return tuple(self._rate(sympy.Matrix(self.v)))

    def _flow(self) -> Any:
        return self._moving.items()

    @property
    def rates(self) -> dict[sympy.Expr, sympy.Expr]:
        """Coordinates on which position and rotation of the frame depend, and their rates."""
        return {x: dx for x, dx in self._moving.items() if isinstance(x, StateSymbol) and x.quantity == "q"}

    def in_terms(self) -> Frame:
        """Return the frame for the terms of components, in the symbols of the body and the coordinates."""
        return self

    @property
    def terms(self) -> Any:
        """Component with the inertia of the body that carries the frame."""
        return self.body.terms

    @property
    def pose(self) -> Any:
        """Given pose of the frame."""
        body = self.body
        offset, turned = drawn_in_body(self)
        angle = body.pose.angle
        if len(turned) == 2:
            angle = angle + 2 * sympy.atan2(turned[1], turned[0])
        q = tuple(as_symbolic(x) for x in _coordinates(self.space, body.pose.q, offset, turned))
        return BodyPose(q, None, None, body.pose.hold, angle)

    @property
    def drafts(self) -> dict[str, str]:
        """Kinds, by name, of components on the body that have not been added to the mechanism."""
        return self.body.drafts

    def __repr__(self) -> str:
        return f"<frame {self.name!r} of body {self.body.name!r}>"


def _coordinates(space: Space, q: Sequence[Any], offset: Sequence[Any], turned: Sequence[Any]) -> tuple[Any, ...]:
    frame = Frame(space, q)
    place = frame.position + frame.rotation * sympy.Matrix(list(offset))
    return (*place, *(frame.attitude(turned) if space.turns else ()))


def drawn_in_body(frame: AttachedFrame) -> tuple[list[sympy.Expr], list[sympy.Expr]]:
    """Return offset and quaternion of a frame relative to its body, in the given pose."""
    drawn: dict[sympy.Basic, sympy.Expr] = {}
    for owner in owners_in((*frame.offset, *frame.turned)):
        if isinstance(owner, CoordinateSet):
            drawn |= dict(zip(owner.q, owner.initial, strict=True))
    offset, turned = ([as_symbolic(x).xreplace(drawn) for x in part] for part in (frame.offset, frame.turned))
    return offset, turned


def local_in_body(frame: Any, local: Sequence[Any], *, direction: bool = False) -> tuple[Any, ...]:
    """Return a point or direction of a frame in the frame of its body, in the given pose."""
    if not isinstance(frame, AttachedFrame):
        return tuple(local)
    offset, turned = drawn_in_body(frame)
    found = frame.space.rotation(turned) * sympy.Matrix(list(local))
    return tuple(found if direction else found + sympy.Matrix(offset))


def carrier_name(frame: Any) -> str:
    """Return the name of the body that carries a frame; for a body or the ground, return its own name."""
    return str(getattr(frame.body if isinstance(frame, AttachedFrame) else frame, "name", "ground"))


def owners_in(expressions: Sequence[Any]) -> list[Any]:
    """Return the bodies and coordinate sets whose symbols occur in expressions, each once, in a fixed order."""
    found: dict[int, Any] = {}
    for e in expressions:
        for symbol in sorted(getattr(e, "free_symbols", ()), key=str):
            if isinstance(symbol, StateSymbol):
                found.setdefault(id(symbol.owner), symbol.owner)
    return list(found.values())


def flow_of(owners: Sequence[Any]) -> dict[sympy.Expr, sympy.Expr]:
    """Return coordinates with their rates, and rates with their accelerations, of bodies and coordinate sets."""
    found: dict[sympy.Expr, sympy.Expr] = {}
    for owner in owners:
        a = owner.a if isinstance(owner, CoordinateSet) else (*owner.acceleration, *owner.quaternion_acceleration)
        found |= dict(zip((*owner.q, *owner.v), (*owner.v, *a), strict=True))
    return found
