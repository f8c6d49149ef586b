"""Knots of tables over time: where a step of high order had best end.

A spline is smooth but for its third derivative, which jumps at the knots.  Methods of variable order follow that; the
error estimate of an explicit method of high order does not see it, as it does not lie at its stages: without further
ado a force through 300 samples is integrated to 1e-6 at a tolerance of 1e-9.  So such steps end at the knots at which
the jump counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import sympy

from uqmbd.dynamics.equations import TIME, Instance
from uqmbd.mechanism import Spline, SplineTable
from uqmbd.typing import Array

__all__ = ["TimedTable", "timed_tables"]


COUNTS = 100.0
"""Deviation from a cubic on an interval, over the tolerance and the size of the table, that counts."""


@dataclass(frozen=True)
class TimedTable:
    """A table whose argument is ``slope t + offset``, the same in all realisations."""

    table: SplineTable
    slope: float
    offset: float

    def knots(self, begin: float, end: float, rtol: float) -> Array:
        """Return the times between two others of knots that count, s."""
        table = self.table
        found = table.knots[table.deviations > COUNTS * rtol]
        if table.ends == "periodic" and len(found):
            period = table.knots[-1] - table.knots[0]
            reach = np.sort(np.array([begin, end]) * self.slope + self.offset)
            first, last = np.floor((reach - table.knots[0]) / period)
            found = (found + period * np.arange(first, last + 1)[:, None]).ravel()
        times: Array = (found - self.offset) / self.slope
        return times[(times > begin) & (times < end)]


def timed_tables(instances: list[Instance]) -> tuple[TimedTable, ...]:
    """Find the tables over time in the equations of motion."""
    found: dict[tuple[SplineTable, float, float], TimedTable] = {}
    for instance in instances:
        values = {sympy.Symbol(f"_p{k}", real=True): p for k, p in enumerate(instance.parameters)}
        splines = {x for e in instance.type.expressions for x in e.atoms(Spline)}
        for x in sorted(splines, key=sympy.default_sort_key):
            argument = instance.type.whole(x.argument).xreplace(values)
            slope, offset = argument.diff(TIME), argument.subs(TIME, 0)
            if slope.is_number and offset.is_number and slope != 0:
                key = (x.table, float(slope), float(offset))
                found[key] = TimedTable(*key)
    return tuple(found.values())
