"""Find places along a motion at which an expression is not finite and real, or cannot be resolved.

Values at the places of parts show most such places, but not all.  The square of a root is real even where the root is
not. A pole may be between two places, and a gap may be narrower than the distance between two places.  Parts of an
expression that must be positive or nonzero are therefore also resolved.  At a zero of such a part, the limit of the
expression is examined: a ratio of two numbers that vanish together remains finite.

The symbols of an expression of time also bound its rate of change.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import sympy
from sympy import Expr

from uqmbd.compiled import FINE, PLACES, SERIES, Need
from uqmbd.dynamics.equations import OutputMap
from uqmbd.dynamics.summaries.extremes import SAME
from uqmbd.dynamics.summaries.motion import SteppedMotion
from uqmbd.dynamics.summaries.resolved import SHARE, StepParts, TimedOutputs, values_at
from uqmbd.mechanism import Output, domain_of, random_variables, t
from uqmbd.typing import Array, Index, Mask

__all__ = ["Domain", "Unresolved", "domain_map", "exponential_types", "not_finite_since", "outside_since", "unresolved"]

DEGREE = 16
"""Largest degree of polynomials in time; a high degree has narrow peaks, such as ``(t * (1 - t))**10000``."""

MANY = 64
"""Largest number of terms."""


def exponential_types(expression: sympy.Expr) -> tuple[sympy.Expr, ...] | None:
    """Return numbers whose maximum is the exponential type of an expression of time, rad/s; None: unknown."""
    found = _growth(expression)
    return None if found is None or found[1] > DEGREE else tuple(found[0])


def _growth(e: sympy.Expr) -> tuple[list[sympy.Expr], sympy.Expr] | None:
    """Return exponential types of the terms of an expression, and its degree as a polynomial in time."""
    if not e.has(t):
        return [sympy.S.Zero], sympy.S.Zero
    if e == t:
        return [sympy.S.Zero], sympy.S.One
    if isinstance(e, sympy.sin | sympy.cos | sympy.sinh | sympy.cosh | sympy.exp):
        rate = sympy.diff(e.args[0], t)
        return None if rate.has(t) else ([sympy.Abs(rate)], sympy.S.Zero)
    if isinstance(e, sympy.Pow):
        base, exponent = _growth(e.args[0]), e.args[1]
        if base is None or not (exponent.is_Integer and exponent.is_positive):
            return None
        return [exponent * one for one in base[0]], exponent * base[1]
    if not isinstance(e, sympy.Add | sympy.Mul):
        return None
    types, degree = [sympy.S.Zero], sympy.S.Zero
    for part in e.args:
        found = _growth(part)
        if found is None:
            return None
        if isinstance(e, sympy.Add):
            types, degree = [*types, *found[0]], max(degree, found[1])
        else:
            types, degree = [a + b for a in types for b in found[0]], degree + found[1]
        types = list(dict.fromkeys(types))
        if len(types) > MANY:
            return None
    return types, degree


INTEGRAL = 3
"""Kind (`Need.kind`) of expressions that are resolved equally well at all times."""

ROUNDS = 20
"""Largest number of rounds to locate a zero to rounding."""

OCTAVES = 36
"""Number of halvings of the distance to the zero of a part, at which an expression is evaluated."""

GROWING = 10
"""Number of consecutive halvings without decreasing changes from which on a limit counts as missing."""

STEADY = 0.99
"""Least ratio of the changes in consecutive halvings without a limit: 1 for a logarithm, larger for a pole.

The ratio of a finite limit is smaller: ``2**-p`` for a power with the exponent p.  Exponents below 0.015 count as
infinite.
"""

CHANGE = 1e-12
"""Change, relative to the values, that counts as rounding."""

DEEPEST = 40
"""Number of divisions after which a part is accepted, as in ``parts.c``."""


@dataclass(frozen=True)
class Domain:
    """Conditions under which expressions are finite real numbers."""

    parts: OutputMap | None  # parts of the expressions; None: the expressions are finite and real everywhere
    # for each expression: index of a part, and whether it must be nonzero; else it must not be negative
    conditions: tuple[tuple[tuple[int, bool], ...], ...]
    timed: TimedOutputs | None = None  # expressions of time and inputs alone
    exact: tuple[bool, ...] = ()  # whether a part is an expression of time and inputs alone, without integration error

    @property
    def needs(self) -> list[Need]:
        """Quantities to resolve."""
        return [] if self.parts is None else [Need(INTEGRAL, 0.0, k) for k in range(len(self.parts.names))]


def domain_map(
    written: Sequence[Expr], followed: Sequence[Expr], compiled: Callable[[list[Output]], OutputMap]
) -> Domain:
    """Compile the conditions under which expressions are finite real numbers.

    The expressions `written` by the user are evaluated in the form `followed`; `compiled` returns a map of outputs.
    """
    found = []
    for expression, shown in zip(written, followed, strict=True):
        # a constant condition is violated by all values or by none
        shown_by = domain_of(shown)
        found.append([one for one in domain_of(expression) if one.moves or one not in shown_by])
    parts = list(dict.fromkeys(one.part for some in found for one in some))
    timed = [e for e in dict.fromkeys(followed) if e.free_symbols - random_variables(e) == {t}]
    rates = [exponential_types(e) for e in timed]
    bounds = None if None in rates else list(dict.fromkeys(one for some in rates for one in some or ()))
    limits, alone, fastest = (
        compiled([Output(str(e), e, "") for e in some]) if some else None for some in (parts, timed, bounds)
    )
    conditions = tuple(tuple((parts.index(one.part), one.nonzero) for one in some) for some in found)
    exact = tuple(part.free_symbols - random_variables(part) <= {t} for part in parts)
    return Domain(limits, conditions, None if alone is None else TimedOutputs(alone, fastest), exact)


def not_finite_since(parts: StepParts, column: int) -> Array:
    """Find the first time in s at which an output is not finite in each realisation, shape (R,); infinite: never."""
    since = np.full(len(parts.first), np.inf)
    which = parts.unknown
    if len(which):
        which = which[np.isnan(parts.of("highest", column, which))]
    if len(which):
        place = PLACES[(~np.isfinite(parts.of("values", column, which))).argmax(axis=1)]
        np.minimum.at(since, parts.number[which], parts.time(which, 2 * place - 1))
    return since


def outside_since(
    motion: SteppedMotion, outputs: OutputMap, columns: Sequence[int], domain: Domain, parts: StepParts, allowed: Array
) -> Array:
    """Return the times (R, expression) in s at which expressions first leave their domain; infinite: never.

    The expressions of the domain are the `columns` of the outputs; the polynomials of their resolved `parts` have the
    tolerances `allowed` (R, part).
    """
    since = np.full((len(parts.first), len(columns)), np.inf)
    slack = np.where(domain.exact, 1.0, SAME / SHARE) * allowed
    below, zeros = dict[int, Array](), dict[int, _Zeros]()
    for k, (column, conditions) in enumerate(zip(columns, domain.conditions, strict=True)):
        for part, nonzero in conditions:
            if nonzero:
                if part not in zeros:
                    zeros[part] = _zeros(motion, domain, part, parts, slack[:, part])
                found = _unbounded_since(motion, outputs, column, zeros[part], len(since))
            else:
                if part not in below:
                    below[part] = _negative_since(motion, domain, part, parts, slack[:, part])
                found = below[part]
            since[:, k] = np.minimum(since[:, k], found)
    return since


def _negative_since(motion: SteppedMotion, domain: Domain, column: int, parts: StepParts, slack: Array) -> Array:
    """Find the first time (R,) in s at which a part is negative by more than its error."""
    assert domain.parts is not None
    since = np.full(len(parts.first), np.inf)
    which = np.flatnonzero(parts.of("least", column) < -slack[parts.number])
    if not len(which):
        return since
    place, _ = parts.fitted(column).peaks(-1.0, which)
    table, order = parts.table, parts.order[which]
    at = table.low[order] + 0.5 * (1 + place) * (table.high[order] - table.low[order])
    # next to a jump, a polynomial overshoots
    value = motion.observed(domain.parts, table.step[order], at, at)[:, column, 0]
    which = which[value < -slack[parts.number[which]]]
    rows, earliest = np.unique(parts.number[which], return_index=True)
    which = which[earliest]
    series, fine = parts.of("coefficients", column, which), _fine(parts, column, which)
    first = (fine < 0).argmax(axis=1)
    low, high = FINE[np.maximum(first - 1, 0)], FINE[first]
    for _ in range(ROUNDS):
        middle = 0.5 * (low + high)
        over = values_at(series, middle) >= 0
        low, high = np.where(over, middle, low), np.where(over, high, middle)
    since[rows] = parts.time(which, high)
    return since


def _fine(parts: StepParts, column: int, which: Index) -> Array:
    """Return values of the selected parts at the fine places, (N, fine), with known values at the ends."""
    series, values = (parts.of(name, column, which) for name in ("coefficients", "values"))
    fine = np.polynomial.chebyshev.chebvander(FINE, series.shape[1] - 1) @ series.T
    fine[[0, -1]] = values[:, [0, -1]].T
    return np.ascontiguousarray(fine.T)


@dataclass(frozen=True)
class _Zeros:
    """Zeros of a part, (Z,) each: realisation, step, place in the step, time in s, length of its part of the step."""

    number: Index
    step: Index
    place: Array
    time: Array
    span: Array

    def some(self, which: Index) -> _Zeros:
        return _Zeros(*(x[which] for x in vars(self).values()))


def _zeros(motion: SteppedMotion, domain: Domain, column: int, parts: StepParts, slack: Array) -> _Zeros:
    """Return the zeros of a part, within its error, in order of time of each realisation."""
    assert domain.parts is not None
    near = slack[parts.number]
    which = np.flatnonzero((parts.of("least", column) <= near) & (parts.of("most", column) >= -near))
    fine = _fine(parts, column, which)
    size, jump = np.abs(fine), np.abs(np.diff(fine, axis=1))
    lower = np.pad(size, ((0, 0), (1, 1)), constant_values=np.inf)
    around = np.maximum(np.pad(jump, ((0, 0), (1, 0))), np.pad(jump, ((0, 0), (0, 1))))
    least = (size <= lower[:, :-2]) & (size <= lower[:, 2:]) & (size - around <= near[which, None])
    rows, at = np.nonzero(least)
    chosen, last = which[rows], len(FINE) - 1
    table, order = parts.table, parts.order[which[rows]]
    step, begin, span = table.step[order], table.low[order], table.high[order] - table.low[order]
    ends = FINE[np.maximum(at - 1, 0)], FINE[np.minimum(at + 1, last)]
    low, high = (begin + 0.5 * (1 + end) * span for end in ends)
    for _ in range(ROUNDS if len(chosen) else 0):
        values = motion.observed(domain.parts, step, low, high)[:, column]
        places = low[:, None] + (high - low)[:, None] * PLACES
        each, node = np.arange(len(values)), np.nan_to_num(np.abs(values), nan=np.inf).argmin(axis=1)
        crossed = values[:, :-1] * values[:, 1:] <= 0
        first, any_ = crossed.argmax(axis=1), crossed.any(axis=1)
        left = np.where(any_, first, np.maximum(node - 1, 0))
        right = np.where(any_, first + 1, np.minimum(node + 1, len(PLACES) - 1))
        place, distance = places[each, node], np.abs(values)[each, node]
        low, high = places[each, left], places[each, right]
    if not len(chosen):
        return _Zeros(np.zeros(0, dtype=np.int64), step, begin, begin, span)
    real = distance <= near[chosen]
    course = motion.course
    time = course.begin[step] + place * (course.last[step] - course.begin[step])
    return _Zeros(parts.number[chosen], step, place, time, span).some(np.flatnonzero(real))


def _unbounded_since(motion: SteppedMotion, outputs: OutputMap, column: int, zeros: _Zeros, count: int) -> Array:
    """Find the first time (R,) in s at which a part is zero and an expression has no finite limit."""
    since = np.full(count, np.inf)
    _, earliest = np.unique(zeros.number, return_index=True)
    # the first zeros are mostly sufficient
    for some in (zeros.some(earliest), zeros.some(np.setdiff1d(np.arange(len(zeros.number)), earliest))):
        left = some.some(np.flatnonzero(some.time < since[some.number]))
        for side in (-1.0, 1.0):
            found = _unbounded(motion, outputs, column, left, side)
            np.minimum.at(since, left.number[found], left.time[found])
    return since


def _unbounded(motion: SteppedMotion, outputs: OutputMap, column: int, zeros: _Zeros, side: float) -> Array:
    """Return a mask of the zeros of a part without a finite one-sided limit of the expression, shape (Z,)."""
    course, count = motion.course, len(zeros.step)
    extent = course.last[zeros.step] - course.begin[zeros.step]
    end = np.where(extent > 0, (course.end - course.begin)[zeros.step] / np.where(extent > 0, extent, 1.0), 1.0)
    reach = np.minimum(zeros.span, zeros.place if side < 0 else end - zeros.place)
    found = np.zeros(count, dtype=bool)
    which = np.flatnonzero(reach > zeros.span / 2**GROWING)
    if not len(which):
        return found
    far = reach[which, None] * 0.5 ** np.arange(OCTAVES)
    place = zeros.place[which, None]
    low, high = (place - far, place - far / 2) if side < 0 else (place + far / 2, place + far)
    steps = np.repeat(zeros.step[which], OCTAVES)
    values = motion.observed(outputs, steps, low.ravel(), high.ravel())[:, column]
    values = values.reshape(len(which), OCTAVES, len(PLACES))[..., :: int(-side)]  # in the order towards the zero
    with np.errstate(invalid="ignore", over="ignore"):
        rises = np.diff(values, axis=2)
        way = np.where((rises > 0).all(axis=2), 1, np.where((rises < 0).all(axis=2), -1, 0))
        change = np.abs(values[..., -1] - values[..., 0])
        way = np.where(change > CHANGE * np.abs(values).max(axis=2), way, 0)
        grows = (way[:, 1:] != 0) & (way[:, 1:] == way[:, :-1]) & (change[:, 1:] >= STEADY * change[:, :-1])
    run, longest = np.zeros(len(which), dtype=np.int64), np.zeros(len(which), dtype=np.int64)
    for k in range(OCTAVES - 1):
        run = np.where(grows[:, k], run + 1, 0)
        longest = np.maximum(longest, run)
    found[which] = (longest >= GROWING) | ~np.isfinite(values).all(axis=(1, 2))
    return found


@dataclass(frozen=True)
class Unresolved:
    """Parts on which the polynomials of an output exceed its tolerance, and bisection does not reduce their error."""

    which: Index  # (U,): indices of the parts
    error: Array  # (U,): error of each part; infinite where the values grow as far as the part can be divided

    def since(self, parts: StepParts, some: Mask) -> Array:
        """Find the first time in s among the selected parts in each realisation, shape (R,); infinite: none."""
        since, which = np.full(len(parts.first), np.inf), self.which[some]
        np.minimum.at(since, parts.number[which], parts.begin[which])
        return since


def unresolved(parts: StepParts, column: int, allowed: Array) -> Unresolved:
    """Find the parts on which an output is not resolved; tolerances of its polynomials are (R,).

    A jump counts as resolved: bisection does not change the values on its two sides.
    """
    which, table = parts.deep, parts.table
    if len(which):
        which = which[(parts.of("error", column, which) == 0) & ~np.isnan(parts.of("highest", column, which))]
    if not len(which):
        return Unresolved(which, np.zeros(0))
    depth, near = table.depth[parts.order[which]], (SAME / SHARE * allowed)[parts.number[which]]
    sizes = np.abs(parts.of("values", column, which) @ SERIES)
    last, before = sizes[:, 7] + sizes[:, 6], sizes[:, 5] + sizes[:, 4]
    error = 2.0 * last * (1.0 + (10.0 * np.minimum(last / np.maximum(before, 1e-300), 1.0)) ** 2)
    whole = table.whole[parts.order[which]]
    grown = parts.of("highest", column, which) - table.highest[whole, column]
    grown = np.maximum(grown, table.lowest[whole, column] - parts.of("lowest", column, which))
    error = np.where(depth >= DEEPEST, np.where(grown > near, np.inf, 0.0), error)
    some = error > near
    return Unresolved(which[some], error[some])
