"""Forces and torques that are given."""

from __future__ import annotations

from collections.abc import Iterator

import uqmbd

__all__ = ["PointForce", "Torque"]


class PointForce(uqmbd.Component):
    """A force on a point of a body, in world axes.

    It may depend on `uqmbd.t`, random variables, and quantities of bodies such as ``body.velocity[0]``.

    Examples
    --------
    >>> PointForce.signature()
    '(name, body, point, force)'
    """

    bodies = ("body",)
    point = uqmbd.Parameter("m", "where it acts, body frame", kind="point")
    force = uqmbd.Parameter("N", "the force, world axes", kind="vector")

    def terms(self, p: uqmbd.Local) -> Iterator[uqmbd.VirtualWork]:
        """Yield its virtual work."""
        yield uqmbd.VirtualWork(p.force, p.body.point_velocity(p.point))


class Torque(uqmbd.Component):
    """A torque on a body, in world or body axes; in the plane one number.

    Examples
    --------
    >>> Torque.signature()
    "(name, body, torque, frame='world')"
    """

    bodies = ("body",)
    spaces = (uqmbd.Spatial, uqmbd.Planar)
    torque = uqmbd.Parameter("N m", "the torque", kind="moment")
    frame = uqmbd.Parameter("", "axes it is given in", kind="option", default="world", choices=("world", "body"))

    def terms(self, p: uqmbd.Local) -> Iterator[uqmbd.VirtualWork]:
        """Yield its virtual work."""
        w = p.body.angular_velocity if p.frame == "world" else p.body.body_angular_velocity
        yield uqmbd.VirtualWork(p.torque, w)
