"""Angles from cosine and sine, with a given number of turns."""

from __future__ import annotations

from typing import Any

import sympy

__all__ = ["angle_at_start", "continued"]


def continued(counted: Any, cosine: Any, sine: Any, *, half: bool) -> sympy.Expr:
    """Return the angle of a cosine-sine pair, in the same turn as a counted angle.

    The angle is exact and smooth for any number of turns.  The common sign of a half-angle pair is irrelevant.
    """
    if half:
        c, s = sympy.cos(counted / 2), sympy.sin(counted / 2)
        # the tangent and the angle are independent of the sign of a quaternion
        return counted + 2 * sympy.atan((sine * c - cosine * s) / (cosine * c + sine * s))
    c, s = sympy.cos(counted), sympy.sin(counted)
    return counted + sympy.atan2(sine * c - cosine * s, cosine * c + sine * s)


def angle_at_start(cosine: Any, sine: Any, near: Any, *, half: bool, signed: bool) -> sympy.Expr:
    """Return the angle of a cosine-sine pair that is nearest to `near`; the result is smooth close to `near`."""
    if half and not signed:
        return continued(near, cosine, sine, half=True)
    parts = 2 if half else 1
    c, s = sympy.cos(near / parts), sympy.sin(near / parts)
    return near + parts * sympy.atan2(sine * c - cosine * s, cosine * c + sine * s)
