"""User-defined laws: expressions in symbols of a component, for components of any package.

A component declares the symbols, and a parameter of the kind ``option`` for the law. In `uqmbd.Component.prepare`,
`law_values` checks the law and returns its other quantities, such as random variables and the time. These quantities
become numbers of each realisation. In `uqmbd.Component.terms`, `law_at` inserts values for the symbols. A law may be a
table: `uqmbd.spline` called with a symbol. The laws of uqmbd use the symbols of this module; custom components may use
these or other symbols.

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
"""Penetration depth of two bodies, m."""

depth_rate = sympy.Symbol("depth_rate", real=True)
"""Rate of the depth, m/s."""

speed = sympy.Symbol("speed", real=True)
"""Sliding speed, m/s."""


@typechecked
def registered_contact_law(name: str) -> Any:  # noqa: ANN401 - a law of the package that has the contacts
    """Return the contact law that a plugin registers with a name, by the hook ``uqmbd_contact_laws``.

    Parameters
    ----------
    name : str
        Name of the contact law, such as ``"hertz"``.

    Returns
    -------
    object
        Return value of the method ``law()`` of the registered class. Each call returns the same object.

    Raises
    ------
    uqmbd.StudyError
        If no plugin registers this name. The message lists the installed contact laws.

    Examples
    --------
    >>> from uqmbd.laws import depth, registered_contact_law
    >>> depth in registered_contact_law("hertz").normal.free_symbols
    True
    """
    return _made_law(contact_law(name))


@functools.cache
def _made_law(kind: Any) -> Any:
    """Return the law of a registered class, created at the first call."""
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
    """Return a function of time that uses a randomly selected measured record in each realisation.

    Parameters
    ----------
    which : RandomVariable
        Index of the record, a whole number from 0 to K - 1. ``chaospy.DiscreteUniform(0, K - 1)`` selects all records
        with equal probability.
    times : sequence of T numbers
        Increasing times of the values, s.
    records : sequence of K sequences of T numbers
        Measured values of each record, in the units of the record.
    ends, beyond : str, optional
        Options as for `uqmbd.spline`.

    Returns
    -------
    expression
        Cubic spline through the record, as an expression in `uqmbd.t` and `which`. The result may be a force, a
        prescribed motion or any other number of a component. If `which` is not the index of a record, the expression is
        the last record. The mean of `which`, for example, is in general not an index.

    Raises
    ------
    uqmbd.StudyError
        If the values of `which` are not the whole numbers from 0 to K - 1, or for the same reasons as `uqmbd.spline`.

    Notes
    -----
    An output is not a smooth function of the index of a record. Use a sampling method, such as Monte Carlo.

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
        raise StudyError("random_record: records is empty; expected at least one record.")
    if not getattr(law, "interpret_as_integer", False):
        raise StudyError(
            f"random_record: which is {which.name!r}, whose values are not whole numbers; expected the number of a "
            f"record, such as chaospy.DiscreteUniform(0, {count - 1})."
        )
    first, last = math.ceil(float(law.lower[0])), math.floor(float(law.upper[0]))
    if (first, last) != (0, count - 1):
        raise StudyError(
            f"random_record: which is {which.name!r}, whose values are from {first} to {last}; expected whole numbers "
            f"from 0 to {count - 1}, the numbers of the {count} records."
        )
    tables = [spline(times, record, ends=ends, beyond=beyond) for record in records]
    cases = [(table, sympy.Eq(which, k)) for k, table in enumerate(tables[:-1])]
    return sympy.Piecewise(*cases, (tables[-1], True))
