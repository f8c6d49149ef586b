"""Knots of tables over time, as preferred ends of steps of high order.

The third derivative of a spline jumps at the knots.  Methods of variable order adapt to these jumps. The error estimate
of an explicit method of high order does not detect them, because they are between its stages. With a force through 300
samples, for example, the error is 1e-6 at a tolerance of 1e-9.  Steps of such methods therefore end at the knots
with relevant jumps. Realisations with shared steps may have too many different knots in total. In this case the steps
over knots are so short that the jumps are negligible.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import sympy

from uqmbd.dynamics.equations import TIME, Instance, ParameterMap
from uqmbd.mechanism import Spline, SplineTable
from uqmbd.typing import Array

__all__ = ["KnotInterval", "TimedTable", "TimedTables", "timed_tables"]


COUNTS = 100.0
"""Least relevant deviation from a cubic on an interval, relative to the tolerance and the size of the table."""


class KnotInterval(NamedTuple):
    """Time interval with relevant knots of a table."""

    stops: Array  # (S,): times at which steps end, s
    longest: float  # longest step between the first and the last stop, s


@dataclass(frozen=True)
class TimedTable:
    """Table with the argument ``slope t + offset`` in a realisation."""

    table: SplineTable
    slope: float
    offset: float

    def knots(self, begin: float, end: float, rtol: float) -> Array:
        """Return the times of relevant knots between two times, s."""
        return self.deviating(begin, end, COUNTS * rtol)[0]

    def deviating(self, begin: float, end: float, least: float = 0.0) -> tuple[Array, Array]:
        """Return knots (K,) between two times in s with deviations from a cubic above a limit; deviations (K,)."""
        table = self.table
        some = table.deviations > least
        found, deviations = table.knots[some], table.deviations[some]
        if not np.isfinite([self.slope, self.offset]).all() or self.slope == 0:
            return np.zeros(0), np.zeros(0)
        if table.ends == "periodic" and len(found):
            period = table.knots[-1] - table.knots[0]
            reach = np.sort(np.array([begin, end]) * self.slope + self.offset)
            first, last = np.floor((reach - table.knots[0]) / period)
            turns = np.arange(first, last + 1)
            found = (found + period * turns[:, None]).ravel()
            deviations = np.tile(deviations, len(turns))
        times: Array = (found - self.offset) / self.slope
        inside = (times > begin) & (times < end)
        return times[inside], deviations[inside]

    def step(self, rtol: float) -> float:
        """Return the step length in s for which the jump at every knot is negligible.

        Let h be the length of a step over a knot, and d the length of the intervals next to the knot. The error of the
        step is (h/d)^4 times the deviation of a step of length d.
        """
        with np.errstate(divide="ignore"):
            share = np.minimum(1.0, (COUNTS * rtol / self.table.deviations) ** 0.25)
        widths = np.diff(self.table.knots)
        nearest = np.minimum(np.append(widths, widths[-1]), np.insert(widths, 0, widths[0]))
        return float((share * nearest)[share < 1].min(initial=np.inf) / abs(self.slope))


@dataclass(frozen=True)
class TimedTables:
    """Tables over time of a model."""

    tables: tuple[SplineTable, ...]  # one for each argument that is linear in time
    lines: ParameterMap  # from inputs to slope and offset of each argument, one after the other

    def __len__(self) -> int:
        """Return the number of tables."""
        return len(self.tables)

    def knot_intervals(self, values: Array, begin: float, end: float, rtol: float) -> Iterator[KnotInterval]:
        """Yield intervals with relevant knots, for inputs (K, input) of realisations with shared steps."""
        lines = self.lines(values).reshape(len(values), len(self.tables), 2)
        for k, table in enumerate(self.tables):
            own = [TimedTable(table, *map(float, line)) for line in np.unique(lines[:, k], axis=0)]
            stops = np.unique(np.concatenate([np.zeros(0), *(x.knots(begin, end, rtol) for x in own)]))
            if not len(stops):
                continue
            step = min(x.step(rtol) for x in own if x.slope)
            few = len(own) == 1 or len(stops) <= (stops[-1] - stops[0]) / step
            yield KnotInterval(stops, np.inf) if few else KnotInterval(stops[[0, -1]], step)

    def deviating(self, begin: float, end: float) -> tuple[Array, Array]:
        """Return ordered knots (K,) between two times in s, and their deviations (K,); arguments are not random."""
        lines = self.lines.constants.reshape(-1, 2)
        found = [
            TimedTable(table, *map(float, line)).deviating(begin, end)
            for table, line in zip(self.tables, lines, strict=True)
        ]
        times, deviations = (np.concatenate(x) for x in zip(*found, strict=True))
        order = np.argsort(times, kind="stable")
        return times[order], deviations[order]


def timed_tables(instances: list[Instance], inputs: Sequence[sympy.Symbol]) -> TimedTables | None:
    """Return the tables in the equations of motion with arguments linear in time; None if there are none."""
    found: dict[tuple[SplineTable, sympy.Expr, sympy.Expr], None] = {}
    for instance in instances:
        values = {sympy.Symbol(f"_p{k}", real=True): p for k, p in enumerate(instance.parameters)}
        splines = {x for e in instance.type.expressions for x in e.atoms(Spline)}
        for x in sorted(splines, key=sympy.default_sort_key):
            argument = instance.type.whole(x.argument).xreplace(values)
            slope, offset = argument.diff(TIME), argument.subs(TIME, 0)
            if slope != 0 and slope.free_symbols | offset.free_symbols <= set(inputs):
                found[x.table, slope, offset] = None
    if not found:
        return None
    lines = [e for _, slope, offset in found for e in (slope, offset)]
    return TimedTables(tuple(table for table, _, _ in found), ParameterMap.of(lines, inputs))
