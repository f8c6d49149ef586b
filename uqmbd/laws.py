"""Laws in a user's symbol: expressions of the user that a component takes, for components of anybody.

A component declares a parameter of the kind ``option`` for the law, and says in which symbols it is written.
`law_values` checks it, and makes numbers of each realisation of whatever else it contains, for
`uqmbd.Component.prepare`; `law_at` inserts, for `uqmbd.Component.terms`.  A law may be a table: `uqmbd.spline` called
with a symbol.  The symbols here are those of the laws that uqmbd has; a component of one's own may use them or others.

Examples
--------
>>> import uqmbd
>>> from uqmbd.laws import length
>>> progressive = uqmbd.spline([0.2, 0.25, 0.3, 0.35], [-900, -400, 0, 300])(length)
>>> law_values(progressive, length)
{}
"""

from __future__ import annotations

import sympy

from uqmbd.mechanism import law_at, law_values

__all__ = ["depth", "depth_rate", "distance", "law_at", "law_values", "length", "rate", "speed"]

length = sympy.Symbol("length", real=True)
"""Length of a spring (m), or its angle (rad)."""

rate = sympy.Symbol("rate", real=True)
"""Rate of the length (m/s), or of the angle (rad/s)."""

distance = sympy.Symbol("distance", real=True)
"""Distance along a road, m."""

depth = sympy.Symbol("depth", real=True)
"""How deep two bodies overlap, m."""

depth_rate = sympy.Symbol("depth_rate", real=True)
"""Rate of the depth, m/s."""

speed = sympy.Symbol("speed", real=True)
"""Of sliding, m/s."""
