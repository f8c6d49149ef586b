"""Summaries of motions: extremes, integrals, last values and first times, separately for each realisation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from uqmbd.compiled import FINE, Need
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import OutputMap
from uqmbd.dynamics.integration import Trajectories
from uqmbd.dynamics.observation import observe_along
from uqmbd.dynamics.summaries.domain import Domain, domain_map, not_finite_since, outside_since, unresolved
from uqmbd.dynamics.summaries.extremes import SAME, find_extremes
from uqmbd.dynamics.summaries.motion import motion_of
from uqmbd.dynamics.summaries.polynomials import MotionPolynomials
from uqmbd.dynamics.summaries.resolved import SHARE, StepParts, part_table, resolve_outputs, values_at
from uqmbd.errors import StudyError
from uqmbd.mechanism import CustomSummary, DeclaredSummary, Output, Summary
from uqmbd.status import Status
from uqmbd.typing import Array, Index

__all__ = ["MissingReason", "SummaryMap", "running_minimum", "summarised", "summary_map"]

NODES = 16
"""Number of nodes of Gauss' rule on each part, for functions of plugins and studies."""

BISECTIONS = 60
"""Number of bisections that locate the time at which a value is reached, up to rounding errors."""


def integrals(parts: StepParts, column: int) -> tuple[Array, Array]:
    """Integrate an output over each motion by Clenshaw-Curtis quadrature; also return the durations, (R,) each."""
    length = parts.end - parts.begin
    return np.add.reduceat(parts.of("mean", column) * length, parts.first), np.add.reduceat(length, parts.first)


def custom_values(parts: StepParts, column: int, declared: DeclaredSummary, numbers: tuple[float, ...]) -> Array:
    """Apply a declared function to values of an output, and to weights of nodes, s, at the Gauss nodes of all parts.

    The results have the shape (R,). They are NaN where the output is not finite.
    """
    places, rule = np.polynomial.legendre.leggauss(NODES)
    series = parts.of("coefficients", column).T
    values = np.asarray(np.polynomial.chebyshev.chebval(places, series), dtype=float)  # (E, NODES)
    weights = np.asarray(0.5 * (parts.end - parts.begin)[:, None] * rule, dtype=float)
    found = np.full(len(parts.first), np.nan)
    for k, (first, last) in enumerate(zip(parts.first, np.append(parts.first[1:], len(values)), strict=True)):
        if np.isfinite(values[first:last]).all():
            found[k] = _number(declared, (values[first:last].ravel(), weights[first:last].ravel()), numbers)
    return found


def polynomial_values(parts: StepParts, seen: SummaryMap) -> dict[int, tuple[Array, list[str]]]:
    """Apply declared functions of polynomials; return values (R,) and reasons of missing values, by summary.

    The functions of one realisation are called in turn, so that they can share intermediate results.
    """
    wanted = [k for k, x in enumerate(seen.functions) if x is not None and x[0].polynomials]
    found = {k: (np.full(len(parts.first), np.nan), [""] * len(parts.first)) for k in wanted}
    lasts = np.append(parts.first[1:], len(parts.order))
    for row, (first, last) in enumerate(zip(parts.first.tolist(), lasts.tolist(), strict=True)):
        known: dict[tuple[int, ...], MotionPolynomials] = {}
        for k in wanted:
            columns = (seen.columns[k], *seen.further[k])
            if columns not in known:
                part = np.arange(first, last)
                moving = parts.end[part] > parts.begin[part]
                part = part[moving] if moving.any() else part
                series = np.stack([parts.of("coefficients", column, part) for column in columns])
                known[columns] = MotionPolynomials(parts.begin[part], parts.end[part], series)
            declared, numbers = seen.functions[k] or (None, ())
            if declared is not None and np.isfinite(known[columns].coefficients).all():
                value = _number(declared, (known[columns],), numbers)
                found[k][0][row] = np.nan if isinstance(value, str) else value
                found[k][1][row] = value if isinstance(value, str) else ""
    return found


def _number(declared: DeclaredSummary, given: tuple[Any, ...], numbers: tuple[float, ...]) -> float | str:
    """Return the number of one realisation, or the reason why it has none.

    Raise StudyError if the function raises, or returns no real number.
    """
    where = f"the summary {declared.__module__}.{declared.__qualname__}"
    try:
        value = declared.function(*given, *declared.data, *numbers)
        if declared.polynomials and isinstance(value, str) and value:
            return value
        found = np.asarray(value)
    except StudyError:
        raise
    except Exception as error:
        raise StudyError(f"{where} raised {type(error).__name__}: {error}") from error
    if found.size != 1 or found.dtype.kind not in "fiu":
        raise StudyError(f"{where} returned {found.dtype} of the shape {found.shape}; expected one real number.")
    return float(found.reshape(()))


def first_times(parts: StepParts, column: int) -> Array:
    """Return the first time in s at which an output is zero or above in each realisation, shape (R,).

    NaN: the output never reaches zero.  Infinite: the time is unknown, because the output is not finite at some time
    before it reaches zero.
    """
    times = _first_times(parts, column)
    undefined = np.isnan(parts.of("highest", column))
    if not undefined.any():
        return times
    since = np.minimum.reduceat(np.where(undefined, parts.begin, np.inf), parts.first)
    return np.where((since < np.inf) & ~(times <= since), np.inf, times)


def _first_times(parts: StepParts, column: int) -> Array:
    which = np.flatnonzero(parts.of("most", column) >= 0)
    place, value = parts.fitted(column).peaks(1.0, which)
    above = value >= 0
    which, place = which[above], place[above]
    rows, earliest = np.unique(parts.number[which], return_index=True)
    chosen, place = which[earliest], place[earliest]
    found = np.full(len(parts.first), np.nan)
    if not len(chosen):
        return found
    series, values = (parts.of(name, column, chosen) for name in ("coefficients", "values"))
    fine = np.stack([values_at(series, np.full(len(chosen), x)) for x in FINE.tolist()], axis=1)
    fine[:, [0, -1]] = values[:, [0, -1]]
    fine = np.where(FINE >= place[:, None], 0.0, fine)  # zero is reached from this place on
    top = (fine >= 0).argmax(axis=1)
    high, low = np.minimum(FINE[top], place), FINE[np.maximum(top - 1, 0)]
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        over = values_at(series, middle) >= 0
        high, low = np.where(over, middle, high), np.where(over, low, middle)
    at_once = values[:, 0] >= 0
    found[rows] = np.where(at_once, parts.begin[chosen], parts.time(chosen, high))
    return found


AT_ONCE = 128
"""Number of realisations with motions in memory at once."""


@dataclass(frozen=True)
class SummaryMap:
    """Compiled expressions to summarise over a motion."""

    names: tuple[str, ...]  # in the user's spelling
    kinds: tuple[str, ...]  # kind of each summary (`Summary.kind`)
    columns: tuple[int, ...]  # output of each summary in `along`, or in `ending` for last values
    along: OutputMap
    ending: OutputMap
    # for each summary: function of a plugin or study, and its numbers; None for other summaries
    functions: tuple[tuple[DeclaredSummary, tuple[float, ...]] | None, ...]
    further: tuple[tuple[int, ...], ...]  # outputs of further expressions of each summary in `along`
    domain: Domain  # conditions for finite real values of the expressions

    @property
    def needs_dense_output(self) -> bool:
        """Whether the motion between the output times is needed."""
        return bool(self.along.names)

    @cached_property
    def needs(self) -> list[Need]:
        """Quantities to resolve."""
        every = zip(self.kinds, self.columns, strict=True)
        found = [Need(*_NEEDS[kind], column) for kind, column in every if kind in _NEEDS]
        found += [Need(INTEGRAL, 0.0, column) for columns in self.further for column in columns]
        return list(dict.fromkeys(found))

    @property
    def followed(self) -> list[tuple[int, int]]:
        """Summaries along the motion and the outputs that they need, in the order of the expressions of `domain`."""
        along = [k for k, kind in enumerate(self.kinds) if kind != "final"]
        return [(k, column) for k in along for column in (self.columns[k], *self.further[k])]


_EXTREMES = {"maximum": (1.0, 0), "minimum": (-1.0, 0), "time_of_maximum": (1.0, 1), "time_of_minimum": (-1.0, 1)}
"""Sign of an extreme, and index of the result: 0 for the value, 1 for the time."""

LARGEST, SMALLEST, SO_FAR, INTEGRAL, REACHED = range(5)
"""Purposes for which an expression is resolved (`Need.kind`)."""

_NEEDS = {
    "maximum": (LARGEST, 0.0),
    "time_of_maximum": (LARGEST, SAME / SHARE),
    "minimum": (SMALLEST, 0.0),
    "time_of_minimum": (SMALLEST, SAME / SHARE),
    "integral": (INTEGRAL, 0.0),
    "root_mean_square": (INTEGRAL, 0.0),
    "custom": (INTEGRAL, 0.0),
    "first_time": (REACHED, 0.0),
}


def summary_map(found: Sequence[Summary], compiled: Callable[[list[Output]], OutputMap]) -> SummaryMap:
    """Compile the summarised expressions; `compiled` returns a map of outputs."""
    ending = [s for s in found if s.kind == "final"]
    along = [s for s in found if s.kind != "final"]
    expressions = list(dict.fromkeys(e for s in along for e in (s.summed, *s.further)))
    last = list(dict.fromkeys(s.summed for s in ending))
    summed, ends = (compiled([Output(str(e), e, "") for e in part]) for part in (expressions, last))
    return SummaryMap(
        tuple(str(s) for s in found),
        tuple(s.kind for s in found),
        tuple(last.index(s.summed) if s.kind == "final" else expressions.index(s.summed) for s in found),
        summed,
        ends,
        tuple((s.declared, s.numbers) if isinstance(s, CustomSummary) else None for s in found),
        tuple(tuple(expressions.index(e) for e in s.further) for s in found),
        domain_map(
            [e for s in along for e in (s.args[0], *s.further)],
            [e for s in along for e in (s.summed, *s.further)],
            compiled,
        ),
    )


class MissingReason(NamedTuple):
    """Reason why a realisation has no value."""

    status: Status
    number: int  # index among the required values
    fault: str  # error of the value, as the end of a sentence without a full stop
    text: str  # error of its expression, in the same form


def summarised(
    batch: Batch, seen: SummaryMap, trajectories: Trajectories, members: Index
) -> tuple[Array, list[MissingReason | None]]:
    """Summarise the motions of the realisations `members` (M,), which were integrated to the last time.

    Return values (M, summary), NaN if a value is not reached or undefined. Also return, for each member, the reason for
    an undefined value, or None. The trajectories contain the motion between output times if a summary needs it.
    """
    found, reasons = np.full((len(members), len(seen.names)), np.nan), list[MissingReason | None]([None] * len(members))
    if seen.ending.names and len(members):
        states, last = trajectories.states[members][:, -1:], float(trajectories.times[-1])
        values = observe_along(batch.select(members), seen.ending, trajectories.times[-1:], states)[:, :, 0]
        for k, (kind, column) in enumerate(zip(seen.kinds, seen.columns, strict=True)):
            if kind == "final":
                found[:, k] = values[:, column]
                lost = np.where(np.isfinite(found[:, k]), np.inf, last)
                _note(reasons, np.arange(len(members)), k, lost)
    if not seen.needs_dense_output:
        return found, reasons
    followed = seen.followed

    def collect(rows: Index, parts: StepParts, allowed: Array, since: Array) -> None:
        computed = polynomial_values(parts, seen)
        for k in dict.fromkeys(number for number, _ in followed):
            kind, column = seen.kinds[k], seen.columns[k]
            own = [place for place, (number, _) in enumerate(followed) if number == k]
            lost = since[:, own].min(axis=1)
            if kind in _EXTREMES:
                sign, which = _EXTREMES[kind]
                values = find_extremes(parts, allowed, column, sign)[which]
            elif kind == "first_time":
                values = first_times(parts, column)
                lost = np.where(values < lost, np.inf, lost)  # the expression may be undefined after the first time
            elif k in computed:
                values = computed[k][0]
            elif (custom := seen.functions[k]) is not None:
                values = custom_values(parts, column, *custom)
            else:
                total, length = integrals(parts, column)
                values = np.sqrt(np.maximum(total / length, 0.0)) if kind == "root_mean_square" else total
            found[rows, k] = values
            rough = _rough_since(parts, column, allowed, _NEEDS[kind][0], values)
            for other in seen.further[k]:
                rough = np.minimum(rough, _rough_since(parts, other, allowed, INTEGRAL, values))
            _note(reasons, rows, k, lost, rough)
            if seen.functions[k] is not None:
                _note_functions(reasons, rows, k, seen.names[k], values, computed[k][1] if k in computed else [])

    columns = [column for _, column in followed]
    _resolve(batch, seen.along, columns, seen.domain, trajectories, members, seen.needs, collect)
    return found, reasons


def _note(
    reasons: list[MissingReason | None], rows: Index, number: int, lost: Array, rough: Array | None = None
) -> None:
    """Record why realisations `rows` (R,) have no value `number`, unless a reason is already known.

    `lost` (R,): time from which the expression is not a finite real number, s. `rough` (R,): time in s from which it is
    not resolved. Infinity means never.
    """
    for since, status, fault, text in (
        (
            lost,
            Status.NOT_FINITE,
            "is not finite",
            "is not a finite real number at t = {:.6g} s; check the expression for divisions by zero, for "
            "roots and logarithms outside their domain, and for forces of redundant contacts, which are not unique",
        ),
        (
            rough,
            Status.OTHER,
            "is not resolved",
            "changes too fast to be resolved at t = {:.6g} s; check the expression for oscillations and poles, "
            "or give a smaller max_step",
        ),
    ):
        times = np.full(len(rows), np.inf) if since is None else since
        for k in np.flatnonzero(times < np.inf).tolist():
            reasons[rows[k]] = reasons[rows[k]] or MissingReason(status, number, fault, text.format(times[k]))


def _note_functions(
    reasons: list[MissingReason | None], rows: Index, number: int, name: str, values: Array, stated: Sequence[str]
) -> None:
    """Record why a declared function has no values (R,) in realisations `rows`, with the reasons that it stated."""
    for row, why in zip(rows.tolist(), stated or [""] * len(rows), strict=True):
        if why:
            found = MissingReason(Status.OTHER, number, "has no value", f"is unsuitable: {why}")
            reasons[row] = reasons[row] or found
    for row in rows[~np.isfinite(values)].tolist():
        text = f"is not finite: {name} returned no finite number"
        reasons[row] = reasons[row] or MissingReason(Status.NOT_FINITE, number, "is not finite", text)


def _rough_since(parts: StepParts, column: int, allowed: Array, kind: int, values: Array) -> Array:
    """Return the time from which an unresolved output affects the required result, s, (R,).

    `allowed` (R, O): tolerances of the polynomials. `kind`: see `Need.kind`. `values` (R,): results, which are times
    for the kind `REACHED`.
    """
    rough = unresolved(parts, column, allowed[:, column])
    if not len(rough.which):
        return np.full(len(parts.first), np.inf)
    number = parts.number[rough.which]
    if kind == INTEGRAL:
        lengths = parts.end - parts.begin
        wrong = np.bincount(number, rough.error * lengths[rough.which], len(parts.first))
        much = SAME / SHARE * allowed[:, column] * np.add.reduceat(lengths, parts.first)
        return rough.since(parts, (wrong > much)[number])
    high = parts.of("most", column, rough.which) + rough.error
    low = parts.of("least", column, rough.which) - rough.error
    if kind == REACHED:
        return rough.since(parts, (high >= 0) & ~(parts.begin[rough.which] > values[number]))
    if kind == LARGEST:
        return rough.since(parts, high >= np.maximum.reduceat(parts.of("highest", column), parts.first)[number])
    return rough.since(parts, low <= np.minimum.reduceat(parts.of("lowest", column), parts.first)[number])


def running_minimum(
    batch: Batch, outputs: OutputMap, trajectories: Trajectories, domain: Domain
) -> tuple[Array, list[MissingReason | None]]:
    """Find the running minima of outputs (K, output, T), at the output times and between them, on both sides of jumps.

    Values are NaN where a realisation failed, and where the output is not a finite real number.  Also return, for each
    realisation, the reason for an undefined output, or None.  The trajectories contain the motion between output times
    (``integrate(..., between=True)``).
    """
    times = np.asarray(trajectories.times, dtype=float)
    found = np.full((len(batch), len(outputs.names), len(times)), np.nan)
    reasons = list[MissingReason | None]([None] * len(batch))
    members = np.flatnonzero([not message for message in trajectories.messages])

    def collect(rows: Index, parts: StepParts, allowed: Array, since: Array) -> None:
        for column, lost in enumerate(since.T):
            smallest = parts.fitted(column).cumulative_minimum(parts.first, times)
            found[members[rows], column] = np.where(lost[:, None] < np.inf, np.nan, smallest)
            rough = _rough_since(parts, column, allowed, SO_FAR, smallest[:, -1])
            _note(reasons, members[rows], column, lost, rough)

    if outputs.names:
        columns = list(range(len(outputs.names)))
        needs = [Need(SO_FAR, 0.0, column) for column in columns]
        _resolve(batch, outputs, columns, domain, trajectories, members, needs, collect)
    return found, reasons


def _resolve(
    batch: Batch,
    outputs: OutputMap,
    columns: Sequence[int],
    domain: Domain,
    trajectories: Trajectories,
    members: Index,
    needs: Sequence[Need],
    collect: Callable[[Index, StepParts, Array, Array], None],
) -> None:
    """Resolve outputs along the motions of members in groups, and pass the groups to `collect`.

    `collect` also receives their rows among the members and the tolerances of the polynomials. The last argument of
    `collect` is the time from which each column is not finite and real, s, for each realisation (R, column).
    """
    if not members.size:  # all realisations have failed without a motion
        return
    if trajectories.path is None:
        raise ValueError(
            "the trajectories contain no motion between output times; expected those of integrate(..., between=True)"
        )
    table = part_table(outputs, trajectories.rtol, needs)
    around = None if domain.parts is None else part_table(domain.parts, trajectories.rtol, domain.needs)
    for k in range(0, len(members), AT_ONCE):
        rows = np.arange(k, min(k + AT_ONCE, len(members)))
        motion = motion_of(batch, trajectories.path, members[rows], trajectories.times[0], trajectories.states[:, 0])
        outside = None
        if domain.parts is not None and around is not None:
            limits = resolve_outputs(motion, domain.parts, around)
            outside = outside_since(motion, outputs, columns, domain, limits, around.allowed)
        since = None if outside is None else outside.min(axis=1)
        parts = resolve_outputs(motion, outputs, table, domain.timed, since)
        there = np.searchsorted(members[rows], parts.owner[parts.first])
        since = np.stack([not_finite_since(parts, column) for column in columns], axis=1)
        since = since if outside is None else np.minimum(since, outside)
        with np.errstate(over="ignore", invalid="ignore"):  # infinite and NaN values count as missing
            collect(rows[there], parts, table.allowed, since)
