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
import math
from collections.abc import Sequence
from typing import Any, Literal

import sympy

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism import law_at, law_values, spline
from uqmbd.plugins import contact_law
from uqmbd.randomness import RandomVariable

__all__ = [
    "depth",
    "depth_rate",
    "distance",
    "law_at",
    "law_values",
    "length",
    "random_record",
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


@typechecked
def random_record(
    which: RandomVariable,
    times: Sequence[Any],
    records: Sequence[Sequence[Any]],
    *,
    ends: Literal["not-a-knot", "natural", "flat"] | None = None,
    beyond: Literal["constant", "linear"] | None = None,
) -> sympy.Expr:
    """Return a function of time that is another measured record in each realisation.

    Parameters
    ----------
    which : RandomVariable
        Number of the record: whole numbers from 0 to K - 1. ``chaospy.DiscreteUniform(0, K - 1)`` chooses all alike.
    times : sequence of T numbers
        Times of the values, increasing, s.
    records : sequence of K sequences of T numbers
        Measured values in their own units, record by record.
    ends, beyond : str, optional
        As for `uqmbd.spline`.

    Returns
    -------
    expression
        In `uqmbd.t` and `which`: the cubic spline through the record. It may be a force, a prescribed motion or any
        other number of a component. At means, which no realisation has, it is the last record.

    Raises
    ------
    uqmbd.StudyError
        If `which` is no whole number, or its values are not those from 0 to K - 1; as for `uqmbd.spline`.

    Notes
    -----
    An output is no smooth function of the number of a record. Use a method that samples, such as Monte Carlo.

    Examples
    --------
    >>> import chaospy
    >>> import uqmbd
    >>> from uqmbd.laws import random_record
    >>> which = uqmbd.RandomVariable("record", chaospy.DiscreteUniform(0, 1), units="1")
    >>> force = random_record(which, [0, 1, 2, 3], [[0, 2, 2, 0], [0, -1, 0, 1]])
    >>> [round(float(force.subs({which: k, uqmbd.t: 1})), 6) for k in (0, 1)]
    [2.0, -1.0]
    """
    count, law = len(records), which.distribution
    if not count:
        raise StudyError("random_record: records is empty; expected one record at least.")
    if not getattr(law, "interpret_as_integer", False):
        raise StudyError(
            f"random_record: which is {which.name!r}, whose values are not whole numbers; expected the number of a "
            f"record, such as chaospy.DiscreteUniform(0, {count - 1})."
        )
    first, last = math.ceil(float(law.lower[0])), math.floor(float(law.upper[0]))
    if (first, last) != (0, count - 1):
        raise StudyError(
            f"random_record: which is {which.name!r}, whose values are from {first} to {last}; expected those from "
            f"0 to {count - 1}, the numbers of the {count} records."
        )
    tables = [spline(times, record, ends=ends, beyond=beyond) for record in records]
    cases = [(table, sympy.Eq(which, k)) for k, table in enumerate(tables[:-1])]
    return sympy.Piecewise(*cases, (tables[-1], True))
