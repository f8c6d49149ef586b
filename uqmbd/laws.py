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

import functools
from typing import Any

import sympy

from uqmbd.arguments import typechecked
from uqmbd.mechanism import law_at, law_values
from uqmbd.plugins import contact_law

__all__ = [
    "depth",
    "depth_rate",
    "distance",
    "law_at",
    "law_values",
    "length",
    "rate",
    "registered_contact_law",
    "speed",
]

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


@typechecked
def registered_contact_law(name: str) -> Any:  # noqa: ANN401 - a law of the package that has the contacts
    """Return the law of contact that a plugin registers by a name, by the hook ``uqmbd_contact_laws``.

    Parameters
    ----------
    name : str
        Such as ``"hertz"``.

    Returns
    -------
    object
        What the method ``law()`` of the registered class returns: the same object each time.

    Raises
    ------
    uqmbd.StudyError
        If no plugin registers it: the message lists those that are installed.

    Examples
    --------
    >>> from uqmbd.laws import depth, registered_contact_law
    >>> depth in registered_contact_law("hertz").normal.free_symbols
    True
    """
    return _made_law(contact_law(name))


@functools.cache
def _made_law(kind: Any) -> Any:
    """Return the law of a registered class, made once."""
    return kind().law()
