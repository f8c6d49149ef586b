"""Components of the mechanisms with known solutions."""

from __future__ import annotations

from collections.abc import Iterator

import sympy

from uqmbd.mechanism import Component, Constraint, Event, Impact, Local, Parameter, Potential, VirtualWork

__all__ = ["Floor", "Pin", "Push", "Rod", "Spring", "Strip"]


class Spring(Component):
    """A spring of zero free length between the ground and a body."""

    stiffness = Parameter("N/m", "spring rate")

    def terms(self, p: Local) -> Iterator[Potential]:
        """Yield the energy of the spring."""
        d = p.body_j.position - p.body_i.position
        yield Potential(p.stiffness * d.dot(d) / 2)


class Pin(Component):
    """A point of a body that stays at the origin of another body."""

    point = Parameter("m", "pinned point, frame of body j", kind="point")

    def terms(self, p: Local) -> Iterator[Constraint]:
        """Yield the constraint of the point."""
        yield Constraint(p.body_j.point(p.point) - p.body_i.position, "pin")


class Rod(Component):
    """A massless rod from a point of the ground to a body."""

    post = Parameter("m", "end, frame of body i", kind="point")
    length = Parameter("m", "length")

    def terms(self, p: Local) -> Iterator[Constraint]:
        """Yield the constraint of the length."""
        d = p.body_j.position - p.body_i.point(p.post)
        yield Constraint(d.dot(d) - p.length**2, "length")


class Push(Component):
    """A force on a body along the first axis, which may depend on time."""

    bodies = ("body",)
    force = Parameter("N", "force")

    def terms(self, p: Local) -> Iterator[VirtualWork]:
        """Yield the force."""
        yield VirtualWork(p.force, p.body.velocity[0])


class Strip(Component):
    """A narrow strip across the path of a body, in which a force does work."""

    bodies = ("body",)
    place = Parameter("m", "middle")
    width = Parameter("m", "standard deviation of a Gaussian profile")
    work = Parameter("J", "work")

    def terms(self, p: Local) -> Iterator[VirtualWork]:
        """Yield the force."""
        x = (p.body.position[0] - p.place) / p.width
        force = p.work / (p.width * sympy.sqrt(2 * sympy.pi)) * sympy.exp(-(x**2) / 2)
        yield VirtualWork(force, p.body.velocity[0])


class Floor(Component):
    """A floor on which a body bounces, and a height with a marker for the falling body."""

    bodies = ("body",)
    restitution = Parameter("1", "coefficient of restitution")
    mark = Parameter("m", "height")

    def terms(self, p: Local) -> Iterator[Event]:
        """Yield the impact and the marker."""
        height = p.body.position[1]
        yield Event(height, Impact(p.rate_of(height), p.restitution))
        yield Event(height - p.mark, label="passing")
