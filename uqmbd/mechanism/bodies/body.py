"""Bodies and the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import sympy

from uqmbd.mechanism.components import (
    AngleSymbol,
    Component,
    Constraint,
    JointAngle,
    Kinetic,
    Local,
    Parameter,
    Potential,
    StateSymbol,
    Term,
)
from uqmbd.mechanism.expressions import as_symbolic
from uqmbd.mechanism.geometry import BodyShape, Frame, NamedFrame, Space

__all__ = ["Body", "Ground"]


UNITS = {"q": "m", "v": "m/s", "a": "m/s^2"}
"""Units of positions and of their rates; quaternions are dimensionless."""


class PlaneScalar(StateSymbol):
    """Rotation in planar space: a scalar that also accepts the index ``[0]``, like a vector."""

    _iterable = False  # SymPy must not treat the symbol as a sequence

    def __getitem__(self, index: int) -> PlaneScalar:
        if index not in (0, -1):
            raise IndexError(f"{self.name} has one component in planar space")
        return self


class Ground(NamedFrame):
    """The ground: a fixed body.  Points and axes on the ground are in world coordinates."""

    name = "ground"

    def __init__(self, space: Space) -> None:
        super().__init__(space)


@dataclass(frozen=True)
class BodyPose:
    """The given pose of a body: expressions in random variables."""

    q: tuple[sympy.Expr, ...]
    velocity: tuple[sympy.Expr, ...] | None
    angular_velocity: tuple[sympy.Expr, ...] | None
    hold: bool
    angle: sympy.Expr


class Body(NamedFrame):
    """Rigid body (in translational space a point mass).

    `Mechanism.body` creates bodies.  The properties `position`, `velocity`, `acceleration`, `rotation`, `quaternion`,
    `angle`, `angular_velocity`, `angular_acceleration`, `point(local)` and `point_velocity(local)` are SymPy
    expressions for outputs.

    Examples
    --------
    >>> import sympy
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("arm", uqmbd.Planar())
    >>> arm = mechanism.body("arm", mass=2, inertia=0.5, angle=sympy.pi / 2, angular_velocity=3)
    >>> arm.mass, arm.inertia, list(arm.com)
    (2, 0.500000000000000, [0, 0])
    >>> mechanism.output("tip", arm.point((1, 0))[1], units="m")
    >>> mechanism.output("speed", arm.point_velocity((1, 0))[0], units="m/s")
    >>> motion = uqmbd.simulate(mechanism, [0, 1])
    >>> round(float(motion["tip"][0]), 6), round(float(motion["speed"][0]), 6)
    (1.0, -3.0)
    """

    def __init__(
        self, name: str, space: Space, inertia: BodyTerms, pose: BodyPose, shapes: tuple[BodyShape, ...] = ()
    ) -> None:
        self.name = name
        self.shapes = shapes
        """Shapes of the body, in its frame."""
        self.terms = inertia
        self.pose = pose
        self.drafts: dict[str, str] = {}  # kinds, by name, of components not added yet
        marks = {"q": "", "v": "'", "a": "''"}
        symbols = {
            kind: [
                StateSymbol(self, kind, i, f"{name}.{c}{mark}", UNITS[kind] if i < space.dimension else "")
                for i, c in enumerate(space.coordinates)
            ]
            for kind, mark in marks.items()
        }
        super().__init__(space, symbols["q"], symbols["v"], symbols["a"])

    @property
    def angle(self) -> sympy.Symbol:
        """Angle in planar space, rad, counted over any number of turns, for use in outputs, parameters and laws."""
        if self.space.dimension != 2 or not self.space.turns:
            raise AttributeError(
                f"body {self.name!r} has no .angle: only bodies in Planar space do; use .quaternion or .rotation."
            )
        cosine, sine = self.quaternion
        rate = self.space.angular_velocity(self.quaternion, self.quaternion_rate)[0]
        angle = JointAngle(cosine, sine, half=True, signed=True, near=self.pose.angle, rate=rate)
        return AngleSymbol(self, f"{self.name}.angle", angle)

    @property
    def angular_velocity(self) -> Any:
        """Angular velocity, rad/s, world axes; in planar space a scalar."""
        if self.space.dimension == 2 and self.space.turns:
            return PlaneScalar(self, "angular_velocity", 0, f"{self.name}.angular_velocity", "rad/s")
        return super().angular_velocity

    @property
    def angular_acceleration(self) -> Any:
        """Angular acceleration, rad/s^2, world axes; in planar space a scalar."""
        if self.space.dimension == 2 and self.space.turns:
            return PlaneScalar(self, "angular_acceleration", 0, f"{self.name}.angular_acceleration", "rad/s^2")
        return super().angular_acceleration

    def expand(self, symbol: StateSymbol) -> sympy.Expr:
        """Return a derived symbol of this body (`PlaneScalar`) as an expression in coordinates."""
        plain = Frame(self.space, self.q, self.v, self._a)
        return getattr(plain, symbol.quantity)[0]

    @property
    def mass(self) -> sympy.Expr:
        """Mass, kg: a number or an expression in random variables."""
        return as_symbolic(self.terms.mass)

    @property
    def com(self) -> Sequence[Any]:
        """Centre of mass, body frame, m."""
        com: Sequence[Any] = self.terms.com
        return com

    @property
    def inertia(self) -> Any:
        """Inertia about the centre of mass, body axes, kg m^2: a number (plane) or ``(Ixx, ..., Iyz)`` (space)."""
        entries = tuple(as_symbolic(x) for x in self.terms.inertia or ())
        if not entries:
            raise AttributeError(f"body {self.name!r} has no .inertia: it is a point mass; use .mass.")
        return entries[0] if len(entries) == 1 else entries

    def __repr__(self) -> str:
        return f"<body {self.name!r}>"


class BodyTerms(Component):
    """Component that yields the inertia, the weight and the unit-norm condition of a body."""

    bodies = ("body",)
    offered = True
    mass = Parameter("kg", "mass")
    com = Parameter("m", "centre of mass, body frame", kind="point")
    gravity = Parameter("m/s^2", "acceleration of free fall", kind="vector")
    inertia = Parameter("kg m^2", "inertia about the centre of mass, body axes", kind="numbers")

    def terms(self, p: Local) -> list[Term]:
        """Return the terms of the kinetic energy (with ``d/dt(A c)``), the weight and the unit-norm condition."""
        v, w = p.body.point_velocity(p.com), p.body.body_angular_velocity
        energy = p.mass * v.dot(v) / 2
        terms: list[Term] = []
        if p.space.turns:
            tensor = sympy.Matrix(p.inertia)
            if p.space.dimension == 3:
                xx, yy, zz, xy, xz, yz = p.inertia
                tensor = sympy.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            energy += (w.T * tensor * w)[0] / 2
            e = p.body.quaternion
            terms.append(Constraint(sum(x * x for x in e) - 1, "unit quaternion"))
        return [
            Kinetic(energy),
            Potential(-p.mass * sympy.Matrix(p.gravity).dot(p.body.point(p.com))),
            *terms,
        ]
