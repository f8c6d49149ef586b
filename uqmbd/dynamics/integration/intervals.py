"""Integration intervals for all integrators: times of restarts, and longest steps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.integration.functions_of_time import sample_functions
from uqmbd.dynamics.integration.trajectories import stops
from uqmbd.typing import Array, Index

__all__ = ["Interval", "intervals_of", "intervals_of_members", "longest_step", "pace", "times_between"]


BAND = 16.0
"""Largest ratio of cell sizes in one interval."""
SHARE = 2.0
"""Longest step, relative to the smallest cell of an interval."""
NEAR = 8.0
"""Gap between fast parts, relative to their cell size, below which the gap is joined with them."""


class Interval(NamedTuple):
    """Part of an integration, which begins at the end of the previous interval.

    Attributes
    ----------
    end : float
        Time at which the integration restarts or ends, s.
    longest : float
        Longest step, s.
    jumps : bool
        Whether a quantity may jump at the end.

    Examples
    --------
    A wheel has no discontinuities in time, so one interval reaches the last time:

    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(6, 7), units="rad/s")
    >>> mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    >>> wheel = mechanism.body("wheel", mass=1, inertia=1, angular_velocity=speed)
    >>> mechanism.output("angle", wheel.angle, units="rad")
    >>> study = uqmbd.Study("turning", mechanism, np.linspace(0, 2, 5), [Collocation(order=1)])
    >>> problem = study.problem(study.propagators[0])
    >>> ensemble = problem.ensemble(np.array([[6.0], [7.0]]))
    >>> (interval,) = ensemble.pace(np.array([0.0, 2.0]))
    >>> interval.end, interval.longest
    (2.0, inf)
    """

    end: float
    longest: float
    jumps: bool = True


def pace(ensemble: Batch, times: Array, rtol: float, *, knots: bool = False) -> tuple[Interval, ...]:
    """Return the integration intervals of a batch with shared steps, for output times (T,), s.

    With `knots`, intervals also end at knots of tables over time. Only a third derivative jumps there, so that a method
    of variable order need not restart.
    """
    found = _intervals_with_knots(ensemble.model, ensemble.values, ensemble.breaks, times, rtol, knots=knots)
    if ensemble.paths is None:
        return found
    longest = float(ensemble.paths.longest_steps(rtol).min(initial=np.inf))
    return tuple(interval._replace(longest=min(interval.longest, longest)) for interval in found)


def _intervals_with_knots(
    model: Model, values: Array, breaks: Array, times: Array, rtol: float, *, knots: bool, sampled: bool = False
) -> tuple[Interval, ...]:
    """Return the intervals for realisations with given inputs (K, input) and breaks (K, break)."""
    intervals = _pace(model, values, breaks, times, rtol, sampled=sampled)
    if not knots or not model.tables:
        return intervals
    begin, end = float(times[0]), float(times[-1])
    found = list(model.tables.knot_intervals(values, begin, end, rtol))
    if not found:
        return intervals
    ends = np.array([interval.end for interval in intervals])
    cuts = stops(np.concatenate([x.stops for x in found]), np.array([begin, *ends]))
    more = [
        Interval(cut, intervals[int(np.searchsorted(ends, cut))].longest, jumps=False)
        for cut in cuts
        if cut not in ends
    ]
    intervals = tuple(sorted((*intervals, *more)))
    middle = 0.5 * (
        np.array([begin, *(interval.end for interval in intervals[:-1])])
        + np.array([interval.end for interval in intervals])
    )
    longest = np.array([interval.longest for interval in intervals])
    for x in found:
        inside = (middle > x.stops[0]) & (middle < x.stops[-1])
        longest[inside] = np.minimum(longest[inside], x.longest)
    return tuple(
        Interval(interval.end, float(h), interval.jumps) for interval, h in zip(intervals, longest, strict=True)
    )


def _pace(
    model: Model, values: Array, breaks: Array, times: Array, rtol: float, *, sampled: bool
) -> tuple[Interval, ...]:
    if model.timed is None:
        return intervals_of(breaks, times, model.max_step)
    seen = sample_functions(model.timed, values, breaks, times, rtol)
    edges, sizes = _sizes(seen.cells, float(times[0]), float(times[-1]))
    ends, longest = _bands(edges, sizes, sampled=sampled)
    intervals = intervals_of(np.concatenate([breaks.ravel(), seen.jumps, ends[:-1]]), times, model.max_step)
    # the middle of an interval is in one band, except if rounding moved its end
    begins = np.array([float(times[0]), *(interval.end for interval in intervals[:-1])])
    middle = 0.5 * (begins + np.array([interval.end for interval in intervals]))
    which = np.minimum(np.searchsorted(ends, middle), len(ends) - 1)
    known = set(stops(np.concatenate([breaks.ravel(), seen.jumps]), times).tolist())
    return tuple(
        Interval(interval.end, min(interval.longest, float(longest[k])), interval.end in known)
        for interval, k in zip(intervals, which, strict=True)
    )


def intervals_of(breaks: Array, times: Array, longest: float = np.inf) -> tuple[Interval, ...]:
    """Return intervals with breaks at given times in s, and with steps up to the length `longest` in s."""
    return tuple(Interval(end, longest) for end in [*stops(np.asarray(breaks), times).tolist(), float(times[-1])])


def intervals_of_members(
    batch: Batch, times: Array, rtol: float, *, samples: Array, longest: float = np.inf, jumping: bool = True
) -> list[tuple[Interval, ...]]:
    """Return the integration intervals of each realisation, or one sequence for all realisations.

    Equal sequences share an object.  Output times are (T,), s.  Intervals end at the `samples` (N,) of controllers in
    s, and, if `jumping`, at possible jumps; at these times the driver returns for a decision.  Steps are at most
    `longest`, s.
    """
    model = batch.model
    longest = min(longest, longest_step(model.rough, times))
    inner = samples[(samples > times[0]) & (samples < times[-1])]

    longest_steps = np.full(len(batch), longest)
    if batch.paths is not None:
        longest_steps = np.minimum(longest, batch.paths.longest_steps(rtol))

    def laid(intervals: tuple[Interval, ...], longest: float) -> tuple[Interval, ...]:
        intervals = tuple(Interval(end, min(own, longest), jumps and jumping) for end, own, jumps in intervals)
        return _cut(intervals, inner) if len(inner) else intervals

    # realisations with the same breaks, functions of time and tables over time have the same intervals
    about = [batch.breaks, longest_steps[:, None]]
    if model.timed is not None:
        about += [batch.values[:, uses] for uses in model.timed.uses]
    if model.tables:
        about.append(model.tables.lines(batch.values))
    alike = np.concatenate(about, axis=1)
    _, first, which = np.unique(np.nan_to_num(alike, nan=np.inf), axis=0, return_index=True, return_inverse=True)
    own = [
        laid(
            _intervals_with_knots(
                model,
                batch.values[k : k + 1],
                batch.breaks[k : k + 1],
                times,
                rtol,
                knots=True,
                sampled=bool(len(inner)),
            ),
            float(longest_steps[k]),
        )
        for k in first.tolist()
    ]
    return own if len(own) == 1 else [own[k] for k in which.ravel().tolist()]


def _cut(intervals: tuple[Interval, ...], samples: Array) -> tuple[Interval, ...]:
    """Divide intervals at samples; replace ends that differ from a sample by rounding."""
    ends = np.array([interval.end for interval in intervals])
    right = np.clip(np.searchsorted(samples, ends), 1, max(1, len(samples) - 1))
    pair = samples[np.stack([right - 1, np.minimum(right, len(samples) - 1)])]
    nearest = np.where(np.abs(pair[0] - ends) < np.abs(pair[1] - ends), *pair)
    ends = np.where(np.abs(nearest - ends) <= 1e-12 * np.maximum(1.0, np.abs(ends)), nearest, ends)
    known = set(samples.tolist())
    found = [
        Interval(end, interval.longest, interval.jumps or end in known)
        for end, interval in zip(ends.tolist(), intervals, strict=True)
    ]
    more = np.setdiff1d(samples, ends)
    within = np.searchsorted(ends, more)
    found += [Interval(t, intervals[k].longest) for t, k in zip(more.tolist(), within.tolist(), strict=True)]
    return tuple(sorted(found))


def times_between(times: Array, now: float, stop: float) -> tuple[Index, Array]:
    """Return the indices of output times after `now` up to `stop` in s, and these times with both ends."""
    inside = np.flatnonzero((times > now) & (times <= stop))
    grid = np.unique(np.concatenate([[now], times[inside], [stop]]))
    if len(grid) == 2:  # with only two times, the integrator would return all its steps
        grid = np.array([now, 0.5 * (now + stop), stop])
    return inside, grid


def longest_step(rough: bool, times: Array) -> float:
    """Return the longest step for forces with corners, s: the largest distance of output times."""
    return float(np.diff(times).max()) if rough else np.inf


def _sizes(cells: Array, begin: float, end: float) -> tuple[Array, Array]:
    """Return the size of the smallest cell on each piece of time: edges (P + 1,) and sizes (P,), s."""
    edges = np.unique(np.concatenate([[begin, end], cells.ravel()]))
    sizes = np.full(len(edges) - 1, end - begin)
    lengths = cells[:, 1] - cells[:, 0]
    first, last = np.searchsorted(edges, cells[:, 0]), np.searchsorted(edges, cells[:, 1])
    for k in np.argsort(-lengths, kind="stable"):  # the smallest cells come last
        sizes[first[k] : last[k]] = lengths[k]
    return edges, sizes


def _bands(edges: Array, sizes: Array, *, sampled: bool) -> tuple[Array, Array]:
    """Join pieces with similar sizes of cells; return ends (B,) and longest steps (B,), s.

    Steps of the slowest band are not limited, because they adapt to functions that are equally fast everywhere. If
    controllers are `sampled`, each step over an interval has the same phase, and may miss a pulse in each interval.
    """
    whole = edges[-1] - edges[0]
    band = np.floor(np.log(whole / sizes) / np.log(BAND) + 1e-9).astype(int)
    for level in range(int(band.max(initial=0)), 0, -1):
        fast = np.flatnonzero(band >= level)
        gaps = edges[fast[1:]] - edges[fast[:-1] + 1]
        for k in np.flatnonzero((gaps > 0) & (gaps < NEAR * whole / BAND**level)):
            band[fast[k] + 1 : fast[k + 1]] = level
    changes = np.flatnonzero(np.diff(band)) + 1
    starts = np.concatenate([[0], changes])
    smallest = np.minimum.reduceat(sizes, starts)
    longest = np.where((band[starts] > band.min()) | sampled, SHARE * smallest, np.inf)
    return edges[[*changes, -1]], longest
