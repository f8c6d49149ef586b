"""Outputs: named scalars that a study records."""

from __future__ import annotations

import math
from dataclasses import dataclass

import sympy

from uqmbd.names import SeriesPlace

__all__ = ["TURNS", "Output"]

TURNS = {"rad": 2 * math.pi, "deg": 360.0}
"""Length of a turn in the allowed units of an angle."""


@dataclass(frozen=True)
class Output:
    """A named scalar that a study records at every time.

    Attributes
    ----------
    name, units : str
    expression : expression
    turn : float
        Length of one turn in the units of an angle; 0 for other outputs.
    over : str
        Name of a second output, over which reports also draw this output. Empty: reports draw it over time only.
    place : SeriesPlace or None
        Place in a series of scalar outputs, such as spectral densities over the frequency.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> stone = mechanism.body("stone", mass=1)
    >>> mechanism.output("height", stone.position[0], units="m")
    >>> [(output.name, output.units) for output in mechanism.outputs.values()]
    [('height', 'm')]
    """

    name: str
    expression: sympy.Expr
    units: str
    turn: float = 0.0
    over: str = ""
    place: SeriesPlace | None = None
