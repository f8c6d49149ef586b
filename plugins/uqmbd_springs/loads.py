"""Prescribed forces and torques."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

import sympy

import uqmbd
from uqmbd.typing import Vector

__all__ = ["FollowerForce", "Gravity", "PointForce", "Torque"]


class PointForce(uqmbd.extend.TypedComponent):
    """A force on a point of a body, in world axes.

    The force may depend on `uqmbd.t`, random variables, and quantities of bodies such as ``body.velocity[0]``.

    Examples
    --------
    >>> PointForce.signature()
    '(name, body, point, force)'
    """

    symbol = "force"
    spaces = (*uqmbd.Component.spaces, uqmbd.Line)
    bodies = ("body",)
    body: uqmbd.extend.NamedFrame
    point: uqmbd.Parameter[Vector] = uqmbd.Parameter("m", "where it acts, body frame", kind="point")
    force: uqmbd.Parameter[Vector] = uqmbd.Parameter("N", "the force, world axes", kind="vector")

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.VirtualWork]:
        """Yield the virtual work of the force."""
        yield uqmbd.VirtualWork(p.force, p.body.point_velocity(p.point))


class FollowerForce(uqmbd.extend.TypedComponent):
    """A force on a point of a body, in the rotating axes of the body, such as a thrust.

    Examples
    --------
    >>> FollowerForce.signature()
    '(name, body, point, force)'
    """

    symbol = "force"
    bodies = ("body",)
    body: uqmbd.extend.NamedFrame
    point: uqmbd.Parameter[Vector] = uqmbd.Parameter("m", "where it acts, body frame", kind="point")
    force: uqmbd.Parameter[Vector] = uqmbd.Parameter("N", "the force, body axes", kind="vector", axes="body")

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.VirtualWork]:
        """Yield the virtual work of the force."""
        yield uqmbd.VirtualWork(p.body.direction(p.force), p.body.point_velocity(p.point))


class Gravity(uqmbd.extend.TypedComponent):
    """Additional gravity of one body: the sum of the gravity of the space and `acceleration` acts on the body.

    The negative gravity of the space makes the body weightless. Other values can tilt the gravity of the body.

    Examples
    --------
    >>> Gravity.signature()
    '(name, body, acceleration)'
    """

    symbol = "force"
    spaces = (*uqmbd.Component.spaces, uqmbd.Line)
    bodies = ("body",)
    body: uqmbd.extend.NamedFrame
    acceleration: uqmbd.Parameter[Vector] = uqmbd.Parameter(
        "m/s^2", "acceleration of free fall to be added, world axes", kind="vector"
    )

    def prepare(self) -> dict[str, Any]:
        """Return mass and centre of mass of the body."""
        body: Any = self.attached["body"]
        return {"mass": body.mass, "com": tuple(body.com)}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Potential]:
        """Yield the potential energy."""
        yield uqmbd.Potential(-p.mass * sympy.Matrix(p.acceleration).dot(p.body.point(p.com)))


class Torque(uqmbd.extend.TypedComponent):
    """A torque on a body, in world or body axes; in planar space, the torque is a single number.

    Examples
    --------
    >>> Torque.signature()
    "(name, body, torque, frame='world')"
    """

    symbol = "torque"
    bodies = ("body",)
    spaces = (uqmbd.Spatial, uqmbd.Planar)
    body: uqmbd.extend.NamedFrame
    torque: uqmbd.Parameter[Vector] = uqmbd.Parameter("N m", "the torque", kind="moment")
    frame: uqmbd.Parameter[Literal["world", "body"]] = uqmbd.Parameter(
        "", "axes of the components of the torque", kind="option", default="world", choices=("world", "body")
    )

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.VirtualWork]:
        """Yield the virtual work of the torque."""
        w = p.body.angular_velocity if p.frame == "world" else p.body.body_angular_velocity
        yield uqmbd.VirtualWork(p.torque, w)
