"""Sample functions of time in the equations of motion on a fine grid before the integration.

A short pulse in a long quiet interval may be between the stages of a step. The integration then misses the pulse,
because the step errors do not contain it. Every function of time is therefore sampled before the integration. A cell of
the grid is smooth if a polynomial through every other point predicts the points between. Smooth cells are merged in
pairs while the merged cell is smooth. Other cells are divided into 16, at most 12 times. The sizes of the smooth cells
show how fast the function changes, and limit the steps (`uqmbd.dynamics.integration.intervals`). Steps cannot miss
functions with uniform behaviour (polynomials, sines of phases up to degree 2, and pieces of them); these functions are
not sampled.
The sampling takes up to 8,193 values of each function and realisation, so that it costs more than most integrations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import numpy as np
import sympy
from numpy.typing import NDArray

from uqmbd.dynamics.equations import TIME, Instance, ParameterMap
from uqmbd.mechanism import Spline, t
from uqmbd.randomness import RandomVariable
from uqmbd.typing import Array, Index

__all__ = ["TimeCells", "TimedFunctions", "sample_functions", "timed"]


CELL = 16
"""Number of intervals in a cell."""
LEAVES, MOST_LEAVES = 512, 4096
"""Smallest and largest number of cells of the grid."""
PARTS = 16
"""Number of cells into which a cell without a polynomial is divided."""
PER_OUTPUT = 4
"""Number of grid points between two output times."""
HUGE = 1e150
"""Smallest value that counts as infinite."""
MOST_WINDOWS = 4096
"""Largest number of cells that are divided at once."""
DEPTH = 12
"""Largest number of divisions of a cell."""
SHORTEST = 5e-13
"""Length of a cell, relative to the larger of 1 s and the time, at which a remaining change counts as a jump."""
EVERYWHERE = 0.25
"""Largest share of cells without a polynomial; above it, the function counts as fast everywhere and is not refined."""
FEW = 2
FADES = 0.5
"""A cell has a corner, not a jump, if at most `FEW` parts deviate, and each spans at most this share of its values."""
LEAST = 1e-9
"""Deviation, relative to the largest value, that counts as rounding for every tolerance."""
POWER = 4
"""Largest power of a sine without pulses much shorter than its period."""
CHIRP = 2
"""Largest degree of a phase: the frequency of a sine then grows or falls steadily, without pulses."""
ROWS = 1 << 17
"""Number of values that are computed at once."""


class TimeCells(NamedTuple):
    """Smooth cells and jumps of functions of time between two times."""

    cells: Array  # (C, 2): begin and end, s, of cells on which a function is a polynomial within the tolerance
    jumps: Array  # (J,): times at which a function jumps, s


@dataclass(frozen=True)
class TimedFunctions:
    """Functions of time with short changes that a long step may miss."""

    functions: ParameterMap  # values of the functions, from inputs and time
    uses: tuple[Index, ...]  # inputs of each function
    known: dict[tuple[object, ...], TimeCells] = field(default_factory=dict, repr=False, compare=False)

    def value(self, which: int, values: Array, times: Array) -> Array:
        """Return values of a function for inputs (W, input) at times (W, T), shape (W, T); not finite if undefined."""
        found = np.empty(times.shape)
        per = max(1, ROWS // times.shape[1])
        for first in range(0, len(times), per):
            part = slice(first, first + per)
            rows = np.repeat(values[part], times.shape[1], axis=0)
            found[part] = self.functions(np.column_stack([rows, times[part].ravel()]))[:, which].reshape(
                -1, len(times.T)
            )
        return found


def timed(instances: list[Instance], inputs: tuple[RandomVariable, ...]) -> TimedFunctions | None:
    """Find the functions of time in the equations of motion whose short changes an integration step may miss."""
    found: dict[sympy.Expr, None] = {}
    for instance in instances:
        values = {sympy.Symbol(f"_p{k}", real=True): p for k, p in enumerate(instance.parameters)}
        guards = [event.guard for event in instance.type.events]
        whole = [e for x in (*instance.type.expressions, *guards) for e in _of_time(x)]
        # a corner of a prescribed position is a jump of its speed
        positions = [x for x, h in zip(instance.type.constraints, instance.type.holonomic, strict=True) if h]
        rates = [e.diff(TIME) for x in positions for e in _of_time(x) if e.has(sympy.Piecewise, Spline)]
        for e in (*whole, *rates):
            if not _even(e):
                found[e.xreplace({**values, TIME: t})] = None
    if not found:
        return None
    uses = tuple(np.array([k for k, x in enumerate(inputs) if x in e.free_symbols], dtype=np.int64) for e in found)
    return TimedFunctions(ParameterMap.of(list(found), [*inputs, t]), uses)


def _of_time(e: sympy.Expr) -> Iterator[sympy.Expr]:
    """Yield the largest parts of an expression that vary only with time."""

    def alone(part: sympy.Basic) -> bool:
        return all(s == TIME or s.name.startswith("_p") for s in part.free_symbols)

    if TIME not in e.free_symbols:
        return
    if alone(e):
        if isinstance(e, sympy.Expr):
            yield e
        else:
            for part in e.args:
                yield from _of_time(part)
        return
    mixed = list(e.args)
    if isinstance(e, (sympy.Add, sympy.Mul)):
        mine = [x for x in e.args if alone(x)]
        if mine:
            yield from _of_time(e.func(*mine))
            mixed = [x for x in e.args if x not in mine]
    for part in mixed:
        yield from _of_time(part)


def _even(e: sympy.Basic) -> bool:
    """Return whether a function of time has uniform behaviour, or pieces with known ends."""
    if TIME not in e.free_symbols or e == TIME:
        return True
    if isinstance(e, (sympy.Add, sympy.Mul)):
        return all(_even(x) for x in e.args)
    if isinstance(e, sympy.Pow):
        base, power = e.args
        if not (power.is_Integer and power > 0):
            return False
        return bool(_linear(base) or (power <= POWER and _even(base)))
    if isinstance(e, (sympy.sin, sympy.cos)):
        return _linear(e.args[0], CHIRP)
    if isinstance(e, sympy.Piecewise):
        conditions = [x for _, c in e.args for x in c.atoms(sympy.core.relational.Relational)]
        return all(_linear(c.lhs - c.rhs) for c in conditions) and all(_even(x) for x, _ in e.args)
    return False


def _linear(e: sympy.Expr, degree: int = 1) -> bool:
    """Return whether a function of time is linear (a polynomial of this degree), or so in pieces with known ends."""
    pieces = e.atoms(sympy.Piecewise)
    outer = [x for x in pieces if not any(x != y and y.has(x) for y in pieces)]
    for x in outer:
        conditions = [y for _, c in x.args for y in c.atoms(sympy.core.relational.Relational)]
        if not (
            all(_linear(c.lhs - c.rhs) for c in conditions) and all(_linear(branch, degree) for branch, _ in x.args)
        ):
            return False
    whole = e.xreplace({x: sympy.Dummy(real=True) for x in outer})
    moving = {TIME, *(whole.free_symbols - e.free_symbols)}
    return all(not whole.diff(x, degree if x == TIME else 1).free_symbols & moving for x in moving)


# -- looking ----------------------------------------------------------------------------------------------------------
def sample_functions(seen: TimedFunctions, values: Array, breaks: Array, times: Array, rtol: float) -> TimeCells:
    """Sample all functions for realisations with inputs (K, input), between the output times (T,), s.

    The functions may jump or have corners at `breaks` (K, break), s.  Deviations up to `rtol` times the largest value
    of a function count as zero.
    """
    leaves = LEAVES
    while leaves < min(MOST_LEAVES, PER_OUTPUT * len(times) / CELL):
        leaves *= 2
    begin, end = float(times[0]), float(times[-1])
    found: list[TimeCells] = []
    for which, uses in enumerate(seen.uses):
        # realisations with equal inputs of this function are sampled only once
        about = np.concatenate([values[:, uses], breaks], axis=1)
        _, first = np.unique(np.nan_to_num(about, nan=np.inf), axis=0, return_index=True)
        for k in first.tolist():
            key = (which, begin, end, leaves, rtol, about[k].tobytes())
            known = seen.known.get(key)
            if known is None:
                if len(seen.known) >= MOST_LEAVES:
                    seen.known.clear()

                def value(at: Array, which: int = which, row: Array = values[k]) -> Array:
                    return seen.value(which, np.repeat(row[None], len(at), axis=0), at)

                known = seen.known[key] = _sample_function(value, breaks[k], begin, end, leaves, max(rtol, LEAST))
            found.append(known)
    cells = np.concatenate([s.cells for s in found]) if found else np.zeros((0, 2))
    jumps = np.concatenate([s.jumps for s in found]) if found else np.zeros(0)
    return TimeCells(cells, np.unique(jumps))


@dataclass
class _Window:
    """Time interval that is sampled separately.

    An interval next to a known break does not count as a cell if one polynomial fits all of it.
    """

    begin: float
    end: float
    within: _Window | None = None
    span: float = np.inf
    beside: bool = False
    cells: list[tuple[float, float]] = field(default_factory=list)
    few: bool = False


def _sample_function(
    value: Callable[[Array], Array], breaks: Array, begin: float, end: float, leaves: int, rtol: float
) -> TimeCells:
    """Sample one function of one realisation."""
    breaks = np.sort(breaks[np.isfinite(breaks) & (breaks > begin) & (breaks < end)])
    windows = [_Window(begin, end)]
    every, jumps, scale, parts = list(windows), list[float](), 0.0, leaves
    for depth in range(DEPTH + 1):
        ends = np.array([(w.begin, w.end) for w in windows])
        at = ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * np.linspace(0, 1, parts * CELL + 1)
        at[:, -1] = ends[:, 1]
        sampled = value(at)
        points = (np.arange(parts) * CELL)[:, None] + np.arange(CELL + 1)
        # values that are not finite are interpolated, and cells without finite values are skipped;
        # the integration reports the error
        with np.errstate(invalid="ignore"):
            number = np.abs(sampled) < HUGE
        blind = ~number[:, points].any(axis=2)
        sampled = _interpolated(at, sampled, number)
        scale = max(scale, float(np.abs(sampled).max()))
        edges = at[:, ::CELL]
        broken = ((breaks > edges[:, :-1, None]) & (breaks < edges[:, 1:, None])).any(axis=2)
        good, off = _polynomials(sampled, rtol * scale, broken | blind)
        for row, first, count in good:
            if not (windows[row].beside and count == parts):
                windows[row].cells.append((edges[row, first], edges[row, first + count]))
        inner: list[_Window] = []
        spans = np.ptp(sampled[:, points], axis=2)
        for row, window in enumerate(windows):
            bad = np.flatnonzero(off[row] > rtol * scale)
            pieces = [(edges[row, k], edges[row, k + 1]) for k in bad]
            window.few = depth > 0 and len(bad) <= FEW
            if depth == 0 and len(bad) > EVERYWHERE * parts:
                window.cells += pieces
            elif window.few and len(bad) and spans[row, bad].max() <= FADES * window.span:
                window.cells = [(window.begin, window.end)]  # a corner, perhaps of a pulse as short as this window
            elif depth == DEPTH or window.end - window.begin <= PARTS * SHORTEST * max(1.0, abs(window.end)):
                jumps += [low for low, _ in pieces]  # time right before the jump
                over: _Window | None = window
                while len(bad) and over is not None and over.few:
                    over.cells, over = [], over.within
            else:
                inner += [_Window(*piece, window, spans[row, k]) for piece, k in zip(pieces, bad, strict=True)]
                inner += [
                    _Window(*side, window, beside=True)
                    for k in np.flatnonzero(broken[row])
                    for side in _sides(edges[row, k], edges[row, k + 1], breaks)
                ]
        if not inner:
            break
        if len(inner) > MOST_WINDOWS:  # no step can miss kinks that occur everywhere
            for window in inner:
                window.cells.append((window.begin, window.end))
            every += inner
            break
        every += inner
        windows, parts = inner, PARTS
    cells = [cell for window in every for cell in window.cells]
    return TimeCells(np.array(cells).reshape(-1, 2), np.array(jumps))


def _interpolated(at: Array, values: Array, number: NDArray[np.bool_]) -> Array:
    """Return values (W, T) at times, with linear interpolation over missing values; 0 in rows without values."""
    if number.all():
        return values
    found = np.where(number, values, 0.0)
    for row in np.flatnonzero(number.any(axis=1) & ~number.all(axis=1)):
        holes = ~number[row]
        found[row, holes] = np.interp(at[row, holes], at[row, ~holes], values[row, ~holes])
    return found


def _sides(begin: float, end: float, breaks: Array) -> list[tuple[float, float]]:
    """Divide a cell at the breaks inside it."""
    inside = breaks[(breaks > begin) & (breaks < end)]
    tiny = 1e-12 * np.maximum(1.0, np.abs(inside))
    pairs = zip([begin, *(inside + tiny)], [*(inside - tiny), end], strict=True)
    return [(float(low), float(high)) for low, high in pairs if high > low]


def _polynomials(values: Array, allowed: float, broken: NDArray[np.bool_]) -> tuple[list[tuple[int, int, int]], Array]:
    """Find the largest cells with a polynomial for a function, from `values` (W, points).

    Return (window, first smallest cell, number of smallest cells) for each cell, and the deviation on each smallest
    cell (W, cell).
    """
    found: list[tuple[int, int, int]] = []
    count = broken.shape[1]
    smallest = np.zeros(0)
    stride, below = 1, None
    while count:
        points = (np.arange(count) * CELL)[:, None] + np.arange(CELL + 1)
        here = values[:, ::stride][:, points]
        deviation = np.abs(here[..., 1::2] - here[..., ::2] @ _between().T).max(axis=2)
        deviation[broken] = 0.0
        good = np.less_equal(deviation, allowed)
        if below is None:
            smallest = deviation
        else:
            good &= below[:, ::2] & below[:, 1::2]
            alone = below & ~np.repeat(good, 2, axis=1)
            found += [(row, k * stride // 2, stride // 2) for row, k in np.argwhere(alone).tolist()]
        if count == 1:
            found += [(int(row), 0, stride) for row in np.flatnonzero(good[:, 0])]
            break
        below, broken = good, broken[:, ::2] | broken[:, 1::2]
        count, stride = count // 2, 2 * stride
    return found, smallest


@cache
def _between() -> Array:
    """Return the weights of the polynomial through the even points of a cell, evaluated at its odd points."""
    from scipy.interpolate import BarycentricInterpolator

    even = np.arange(0, CELL + 1, 2)
    found: Array = BarycentricInterpolator(even, np.eye(len(even)))(np.arange(1, CELL, 2))
    return found
