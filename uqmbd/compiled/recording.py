"""Record the steps of an explicit integration in the driver, and evaluate expressions along steps.

The driver divides and evaluates steps. NumPy takes fifteen times as long, mostly to copy states and to sort parts after
each round.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from uqmbd.compiled import driver as c
from uqmbd.compiled.driver import address, aligned, load_driver
from uqmbd.compiled.programs import Program
from uqmbd.compiled.writer import LANES
from uqmbd.typing import Array, Index, Mask

__all__ = [
    "FINE",
    "PLACES",
    "SERIES",
    "StepHistory",
    "FittedPolynomials",
    "Need",
    "PartTable",
    "RecordedSteps",
    "StepRecorder",
]


PLACES = 0.5 - 0.5 * np.cos(np.pi * np.arange(8) / 7)
"""Relative times in a step of recorded states; their number determines the interpolant, which has degree 7."""

FINE = np.linspace(-1, 1, 33)
"""Positions from -1 to 1 at which polynomials are evaluated to find their largest and smallest values."""

ROOM = 1 << 23
"""Maximum number of values of recorded states in the buffer."""

LEAST = 64
"""Maximum number of steps in the buffer per realisation, and minimum in total; unused parts take no memory."""


_VANDER = np.polynomial.chebyshev.chebvander
_PADDED = np.append(FINE, np.ones(-len(FINE) % LANES))
_WEIGHTS = np.where(np.arange(8) % 2, -1.0, 1.0) * np.where(np.arange(8) % 7, 1.0, 0.5)
SERIES = np.ascontiguousarray(np.linalg.inv(_VANDER(2 * PLACES - 1, 7)).T)
_FINE = np.ascontiguousarray(_VANDER(_PADDED, 7).T)
_MEAN = np.linalg.solve(_VANDER(2 * PLACES - 1, 7).T, [1 / (1 - k * k) if k % 2 == 0 else 0.0 for k in range(8)])
"""Weights of Clenshaw and Curtis. `_WEIGHTS` are the barycentric weights of the places. `SERIES` maps values at the
places to Chebyshev coefficients, and `_FINE` maps these to values at `FINE`."""


class RecordedSteps(NamedTuple):
    """Recorded steps of realisations, in chronological order; later steps replace earlier steps."""

    owner: Index  # (P,): index of the realisation of each step
    ends: Array  # (P, 2): begin and end, s
    kept: Mask  # (P,): whether contacts last
    states: Array  # (P, 8, width): interpolated at `PLACES` from begin to end, on the constraints

    def placed(self, numbers: Index) -> RecordedSteps:
        """Return the steps with new indices of realisations; steps with negative indices are omitted."""
        owner = numbers[self.owner]
        some = owner >= 0
        if some.all():
            return self._replace(owner=owner)
        return RecordedSteps(owner[some], self.ends[some], self.kept[some], self.states[some])

    @classmethod
    def joined(cls, paths: Iterable[RecordedSteps | None]) -> RecordedSteps | None:
        """Join several records; return None without records."""
        found = [path for path in paths if path is not None]
        found = [path for path in found if len(path.owner)] or found[:1]
        if len(found) == 1:
            return found[0]
        return cls(*(np.concatenate(parts) for parts in zip(*found, strict=True))) if found else None


class StepRecorder:
    """Buffer for the steps of `count` realisations with states of length `width`; stores none unless `recording`."""

    def __init__(self, count: int, width: int, *, recording: bool) -> None:
        self.room = max(min(ROOM // (len(PLACES) * max(1, width)), LEAST * count), LEAST) if recording else 0
        self.width, self.owner, self.taken = width, np.arange(count), list[RecordedSteps]()
        self._restart()

    def _restart(self) -> None:
        self.path = np.empty((self.room, len(PLACES), self.width))
        self.path_ends, self.path_kept = np.empty((self.room, 2)), np.zeros(self.room, dtype=np.int8)
        self.path_owner, self.recorded = np.zeros(self.room, dtype=np.int64), np.zeros(1, dtype=np.int64)
        self.begin, self.since, self.latest = 0, 0, -1

    def of(self, member: int) -> StepRecorder:
        """Return the recorder of one realisation for a separate integration state; it shares the earlier records."""
        other = copy(self)
        other.owner, other.room = self.owner[member : member + 1].copy(), min(self.room, LEAST)
        other._restart()
        return other

    def take(self) -> None:
        """Collect the recorded steps, and empty the buffer."""
        end = int(self.recorded[0])
        if end == self.begin:
            return
        if self.latest == len(self.taken) - 1 >= 0:  # no other steps were taken since then
            self.taken.pop()
        else:
            self.since = self.begin
        some = slice(self.since, end)
        self.begin, self.latest = end, len(self.taken)
        owner, kept = self.owner[self.path_owner[some]], self.path_kept[some] != 0
        self.taken.append(RecordedSteps(owner, self.path_ends[some], kept, self.path[some]))
        if end + LANES > self.room:
            self._restart()

    def passed(self, member: int, ends: Array, states: Array) -> None:
        """Record a step that was integrated elsewhere: states (1, 8, width) at `PLACES`, ends (1, 2)."""
        if self.room:
            self.taken.append(RecordedSteps(self.owner[member : member + 1], ends, np.zeros(1, dtype=bool), states))

    @property
    def found(self) -> RecordedSteps | None:
        """Return all recorded steps; None without steps."""
        if not self.room:
            return None
        none = np.zeros((0, len(PLACES), self.width))
        first = RecordedSteps(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros(0, dtype=bool), none)
        return RecordedSteps.joined([first, *self.taken])


@dataclass(frozen=True)
class StepHistory:
    """Steps of realisations, in ascending order of realisation and time."""

    owner: Index  # (P,): realisation of each step; ascending
    row: Index  # (P,): row of the states of each step
    begin: Array  # (P,): start of validity, s
    end: Array  # (P,): end of validity, s
    last: Array  # (P,): end of the polynomial, s; not before `end`
    kept: Mask  # (P,): whether contacts last; interpolated states would violate them
    states: Array  # (row, 8, width): states at the nodes of the polynomial

    @cached_property
    def structure(self) -> c.MotionStruct:
        """Return the C structure for the driver."""
        integers = [np.ascontiguousarray(x, dtype=np.int64) for x in (self.owner, self.row)]
        times = [np.ascontiguousarray(x, dtype=float) for x in (self.begin, self.end, self.last)]
        rest = [self.kept.astype(np.int8), np.ascontiguousarray(self.states, dtype=float), PLACES, _WEIGHTS]
        kept = integers + times + rest
        found = c.MotionStruct(self.states.shape[2], *map(address, kept))
        found.held = kept
        return found

    def states_of(self, steps: Index, low: Array, high: Array) -> tuple[Array, Array]:
        """Return states (E, 8, width) and times (E, 8) in s, at places of parts of steps (E,) from `low` to `high`."""
        states, times = np.empty((len(steps), *self.states.shape[1:])), np.empty((len(steps), len(PLACES)))
        given = [np.ascontiguousarray(x) for x in (steps, low, high)]
        load_driver().part_states(ctypes.addressof(self.structure), len(steps), *map(address, (*given, states, times)))
        return states, times

    def observed(self, outputs: Program, block: Array, values: Array, steps: Index, low: Array, high: Array) -> Array:
        """Evaluate expressions at the places of parts of steps (E,), shape (E, result, 8).

        `outputs` is a program of a state, the time, zero, parameters and inputs. `block` (K, parameter) and `values`
        (K, input) are the parameters and inputs of the realisations.
        """
        found = np.empty((len(steps), len(outputs.results), len(PLACES)))
        arrays = [np.ascontiguousarray(x, dtype=float) for x in (block, values, low, high)]
        steps, part, work = np.ascontiguousarray(steps), outputs.part.structure, aligned(outputs.rows)
        sizes = arrays[0].shape[1], arrays[1].shape[1], found.shape[1]
        given = c.RangeStruct(*sizes, part, *map(address, (outputs.results, *arrays[:2])))
        places = (ctypes.addressof(x) for x in (self.structure, given))
        load_driver().observe_parts(*places, len(steps), *map(address, (steps, *arrays[2:], found, work)))
        return found


class Need(NamedTuple):
    """Quantity that the polynomials of an expression must resolve."""

    # 0: largest value, 1: smallest value, 2: running minimum, 3: integral, 4: time of a zero
    kind: int
    slack: float  # allowed difference between a value and an extreme, in tolerances of the polynomials
    column: int  # index of the expression


class PartTable:
    """Parts of steps, and polynomials fitted to the values of `outputs` expressions; parts are bisected as required.

    The allowed error of a polynomial is `share` times the largest value. One table serves realisations consecutively,
    because its memory is expensive to allocate.
    """

    step: Index  # (E,): step of each part
    depth: Index
    next: Index
    whole: Index
    beside: Index
    low: Array  # (E,): begin within the polynomial of the step
    high: Array  # (E,): end within the polynomial of the step
    begin: Array  # (E,): begin, s
    end: Array  # (E,): end, s
    values: Array  # (E, O, 8): values at the nodes
    coefficients: Array  # (E, O, 8): coefficients of Chebyshev series
    error: Array  # (E, O): estimated error of the polynomial; zero if bisection does not reduce it
    most: Array  # (E, O): upper bound of the polynomial
    least: Array  # (E, O): lower bound of the polynomial
    highest: Array  # (E, O): largest value; NaN if a value is not finite
    lowest: Array  # (E, O): smallest value; NaN if a value is not finite
    mean: Array  # (E, O): mean of the polynomial

    def __init__(self, outputs: int, needs: Sequence[Need], share: float) -> None:
        kinds, columns = (np.array([need[k] for need in needs], dtype=np.int64) for k in (0, 2))
        self.needs = kinds, columns, np.array([need.slack for need in needs], dtype=float)
        self.outputs, self.share, self.room = outputs, share, 0
        self.known = np.zeros(len(needs))

    def begin_with(self, course: StepHistory, step: Index, low: Array, high: Array) -> None:
        """Start with parts of steps (E,), in order."""
        self.course, self.count, self.seen = course, len(step), 0
        self._reserve(0)
        some, owner = slice(self.count), course.owner[step]
        self.step[some], self.low[some], self.high[some] = step, low, high
        self.depth[some], self.beside[some] = 0, 0
        self.next[some] = np.where(owner != np.append(owner[1:], -1), -1, np.arange(1, self.count + 1))
        self.first = np.flatnonzero(np.diff(owner, prepend=-1))
        # allowed (R, O): absolute tolerances of the realisations
        self.open, self.allowed = np.ones_like(self.first), np.zeros((len(self.first), self.outputs))

    def _reserve(self, used: int) -> None:
        """Reserve memory for a threefold division of all parts."""
        if self.room >= 4 * self.count:
            return
        self.room = 8 * self.count
        shapes: dict[str, tuple[Any, ...]] = dict.fromkeys(("step", "depth", "next", "whole", "beside"), (np.int64,))
        shapes |= dict.fromkeys(("low", "high", "begin", "end"), (float,))
        shapes |= dict.fromkeys(("values", "coefficients"), (float, self.outputs, len(PLACES)))
        shapes |= dict.fromkeys(("error", "most", "least", "highest", "lowest", "mean"), (float, self.outputs))
        for name, (kind, *shape) in shapes.items():
            array = np.empty((self.room, *shape), dtype=kind)
            if used:
                array[:used] = getattr(self, name)[:used]
            setattr(self, name, array)

    @property
    def new(self) -> tuple[Index, Array, Array]:
        """Return the parts without values: step, low and high."""
        some = slice(self.seen, self.count)
        return self.step[some], self.low[some], self.high[some]

    def refine(self, values: Array) -> bool:
        """Set the values (E, output, 8) of new parts; return whether there are more new parts."""
        self.values[self.seen : self.count] = values
        self._reserve(self.count)
        structure, begun, self.seen = self._structure(), self.seen, self.count
        self.count = load_driver().refine_parts(ctypes.addressof(structure), begun, self.count)
        return self.count > self.seen

    def _structure(self) -> c.PartsStruct:
        kept = *self.needs, SERIES, _FINE, _MEAN
        found = c.PartsStruct(
            ctypes.addressof(self.course.structure),
            *(len(self.first), self.outputs, len(self.needs[0])),
            *map(address, kept),
            self.share,
            *(address(getattr(self, name)) for name in c.PARTS),
        )
        found.held = kept
        return found

    @property
    def order(self) -> Index:
        """Return the indices of the valid parts, in order."""
        found, structure = np.empty(self.count, dtype=np.int64), self._structure()
        return found[: load_driver().list_parts(ctypes.addressof(structure), address(found))]


@dataclass(frozen=True)
class FittedPolynomials:
    """Polynomials of one expression on parts of steps."""

    column: int  # index of the expression
    order: Index  # (E,): indices of the parts
    begin: Array  # (P,): begin, s
    end: Array  # (P,): end, s
    values: Array  # (P, O, 8): values of all expressions at the nodes
    coefficients: Array  # (P, O, 8): coefficients of the Chebyshev series

    @cached_property
    def structure(self) -> c.FittedStruct:
        """Return the C structure for the driver."""
        arrays = self.values, self.coefficients, self.begin, self.end, _FINE, PLACES
        kept = [np.ascontiguousarray(x, dtype=float) for x in arrays]
        found = c.FittedStruct(self.values.shape[1], self.column, *map(address, kept))
        found.held = kept
        return found

    def peaks(self, sign: float, which: Index) -> tuple[Array, Array]:
        """Return positions, from -1 to 1, and values of the maxima of `sign` times parts (N,): (N,) each.

        For a constant, the position is the first place. Results are NaN if a value is not finite.
        """
        place, value = np.empty((2, len(which)))
        which = self.order[which]
        load_driver().part_peaks(
            ctypes.addressof(self.structure), sign, len(which), *map(address, (which, place, value))
        )
        return place, value

    def cumulative_minimum(self, first: Index, times: Array) -> Array:
        """Return running minima (R, T) at ascending times (T,) in s, of realisations with given first parts.

        The value at the last time is the minimum over all parts.
        """
        ends, times = np.append(first, len(self.order)).astype(np.int64), np.ascontiguousarray(times, dtype=float)
        found = np.empty((len(first), len(times)))
        place = ctypes.addressof(self.structure)
        load_driver().least_so_far(
            place, len(first), *map(address, (ends, self.order)), len(times), address(times), address(found)
        )
        return found
