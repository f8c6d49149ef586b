"""Two points that attract each other."""

from __future__ import annotations

from collections.abc import Iterator

import sympy

import uqmbd
from uqmbd.typing import Quantity, Vector

__all__ = ["Magnet"]


class Magnet(uqmbd.TypedComponent):
    """Two points attract each other with a force that falls with the square of their distance.

    The potential is ``-strength / distance``; the equations of motion are derived from it.
    """

    drawn_by = ()
    body_i: uqmbd.NamedFrame
    body_j: uqmbd.NamedFrame
    point_i: uqmbd.Parameter[Vector] = uqmbd.Parameter("m", "pole, frame of body i", kind="point")
    point_j: uqmbd.Parameter[Vector] = uqmbd.Parameter("m", "pole, frame of body j", kind="point")
    strength: uqmbd.Parameter[Quantity] = uqmbd.Parameter("N m^2", "force times the square of the distance")

    def terms(self, p: uqmbd.Local) -> Iterator[uqmbd.Potential]:
        """Yield the energy."""
        offset = p.body_j.point(p.point_j) - p.body_i.point(p.point_i)
        yield uqmbd.Potential(-p.strength / sympy.sqrt(offset.dot(offset)))
