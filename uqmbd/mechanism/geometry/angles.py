"""Angles of which a pair of cosine and sine is known, in the turn that is meant."""

from __future__ import annotations

from typing import Any

import sympy

__all__ = ["angle_at_start", "continued"]


def continued(counted: Any, cosine: Any, sine: Any, *, half: bool) -> sympy.Expr:
    """Return the angle of a pair of cosine and sine, in the turn of a counted angle.

    Exact and smooth, whatever the turn; where the pair is that of half the angle, its sign does not matter.
    """
    if half:
        c, s = sympy.cos(counted / 2), sympy.sin(counted / 2)
        # the tangent does not know the sign of a quaternion, nor does the angle
        return counted + 2 * sympy.atan((sine * c - cosine * s) / (cosine * c + sine * s))
    c, s = sympy.cos(counted), sympy.sin(counted)
    return counted + sympy.atan2(sine * c - cosine * s, cosine * c + sine * s)


def angle_at_start(cosine: Any, sine: Any, near: Any, *, half: bool, signed: bool) -> sympy.Expr:
    """Return the angle of a pair of cosine and sine that is nearest to another angle; smooth in its neighbourhood."""
    if half and not signed:
        return continued(near, cosine, sine, half=True)
    parts = 2 if half else 1
    c, s = sympy.cos(near / parts), sympy.sin(near / parts)
    return near + parts * sympy.atan2(sine * c - cosine * s, cosine * c + sine * s)
