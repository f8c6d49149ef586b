"""Angle between two bodies that rotate about a common axis, with any number of turns."""

from __future__ import annotations

import sympy

import uqmbd

__all__ = ["rotation_rate"]


def rotation_rate(p: uqmbd.extend.Local) -> tuple[sympy.Expr, sympy.Expr]:
    """Return the rate and the initial value of the angle of body j relative to body i about a common axis.

    In planar space, the given angle ``p.drawn`` selects the turn of the initial angle. In three dimensions, the initial
    angle between ``p.frame_i`` and ``p.frame_j`` is within half a turn of zero, on the side of the angle ``p.near``.
    """
    i, j = p.body_i, p.body_j
    speed = j.angular_velocity - i.angular_velocity
    if p.space.dimension == 3:
        r = uqmbd.extend.relative_quaternion(i.attitude(p.frame_i), j.attitude(p.frame_j))
        start = 2 * sympy.Piecewise((sympy.atan2(r[3], r[0]), r[0] >= 0), (sympy.atan2(-r[3], -r[0]), True))
        # half a turn forwards and half a turn backwards are the same pose, so the given angle selects the direction
        turns = sympy.floor((p.near - start) / (2 * sympy.pi) + sympy.Rational(1, 2))
        return speed.dot(i.direction(p.axis_i)), start + 2 * sympy.pi * turns
    r = uqmbd.extend.relative_quaternion(i.quaternion, j.quaternion)
    start = 2 * sympy.atan2(r[1], r[0])
    # the half-angle pair repeats after two turns, so the given angle selects the number of double turns
    return speed[0], start + 4 * sympy.pi * sympy.floor((p.drawn - start) / (4 * sympy.pi) + sympy.Rational(1, 2))
