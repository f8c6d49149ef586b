"""The error of the time integration, measured: some realisations are integrated again at a tighter tolerance.

One of twenty is, at least three. Which ones does not depend on who computes: they are evenly spread over the successful
realisations of a method.
Where a method has computed none (it solves for all together), they are the medians of the inputs and two further points
of their distribution.  The second integration is that of the built-in integrator ``auto``, at a hundredth of the
tolerance: of realisations that IDA, or the integrator of a plugin, has integrated it is thereby a second route.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.dynamics import built_in_names
from uqmbd.errors import RedundantConstraintWarning
from uqmbd.isolation import reason_of
from uqmbd.progress import Silent
from uqmbd.propagation.execution import AGAIN, integrated_by
from uqmbd.propagation.problem import Problem
from uqmbd.status import Status
from uqmbd.typing import Array

__all__ = ["LONG_NAME", "deviation", "tighter", "with_integration_error"]


FACTOR = 0.01
"""Tolerance of the second integration, over that of the first."""

LEAST = 1e-13
"""Tightest tolerance that is of use in double precision."""

LEVEL, TAIL = 0.99, 0.025
"""Quantile of the errors that is stated, and probability on each side of the interval of their mean square."""

OFTEN = 0.9
"""Quantile over time of the relative variances of mean squares, of which none counts as smaller."""

GOLDEN = 0.6180339887498949

LONG_NAME = "error of the time integration"

LONG_NAMES = {
    "integration_error_rms": f"{LONG_NAME}, root mean square over realisations",
    "integration_error_factor": "factor by which the root mean square of the integration error may be off",
    "integration_error": LONG_NAME,
}
"""Names of the variables in the order of `stated_errors`, with their long names."""


def tighter(rtol: float) -> float | None:
    """Return the tolerance of the second integration; None where none is tighter by some digits.

    >>> tighter(1e-6), tighter(1e-13)
    (1e-08, None)
    """
    found = max(FACTOR * rtol, LEAST)
    return found if found <= 0.1 * rtol * (1 + 1e-9) else None


def deviation(first: Array, second: Array, turns: Array) -> Array:
    """Return the absolute difference of responses (..., output, time), for angles up to whole turns.

    `turns` (output,) is the length of a turn of each output, 0 for outputs that are no angles.

    >>> deviation(np.array([[1.0]]), np.array([[361.5]]), np.array([360.0])).tolist()
    [[0.5]]
    """
    with np.errstate(invalid="ignore"):
        difference = first - second  # of what is infinite, not a number
    turn = np.where(turns > 0, turns, 1.0)[:, None]
    return np.abs(difference - np.where(turns[:, None] > 0, turn * np.round(difference / turn), 0.0))


def stated_errors(wrong: Array, population: float) -> tuple[Array, Array, Array]:
    """Return root mean square, its factor of uncertainty and 99 % quantile of errors (K, output, time) at each time.

    The mean square of a population is between those of its 95 % interval, which the factor describes: mean squares are
    multiples of chi-square (Box), and those of all of a `population` are certain. Quantiles at single times are not
    known from few realisations: those of errors over their root mean square are pooled over time.

    >>> found = stated_errors(np.array([[[0.0, 3.0]], [[0.0, 4.0]], [[0.0, 5.0]]]), np.inf)
    >>> [one.round(2).tolist() for one in found]
    [[[0.0, 4.08]], [[1.0, 3.73]], [[0.0, 18.57]]]
    >>> stated_errors(np.array([[[2.0]]]), 1)
    (array([[2.]]), array([[1.]]), array([[2.]]))
    """
    from scipy.special import chdtri

    count, squares = len(wrong), wrong**2
    mean = squares.mean(axis=0)
    rms, some = np.sqrt(mean), mean > 0
    ratios = wrong / np.where(some, rms, 1.0)
    spread = ((squares - mean) ** 2).sum(axis=0) / max(1, count - 1) / count
    relative = np.divide(spread, mean**2, out=np.zeros(mean.shape), where=some)
    largest = np.zeros((len(mean), 1))
    for output, known in enumerate(some):
        if known.any():
            # few realisations underestimate the spread of long tails, mostly where the mean square is too small, too
            relative[output] = np.maximum(relative[output], np.quantile(relative[output, known], OFTEN))
            largest[output] = np.quantile(ratios[:, output, known], LEVEL)
    freedom = np.clip(2 / np.maximum(relative, 2 / count), 1.0, None)
    factor = np.sqrt(freedom / chdtri(freedom, 1.0 - TAIL)) ** np.sqrt(max(0.0, 1.0 - count / population))
    factor = np.where(some, factor, 1.0)
    return rms, factor, np.maximum(rms * largest * factor, wrong.max(axis=0))


def with_integration_error(node: xr.DataTree, problem: Problem) -> xr.DataTree:
    """Add ``integration_error`` (output, time), in the units of the outputs, to the statistics of a method.

    At most 1 % of realisations have a larger error, by an upper limit. ``integration_error_rms`` is the root mean
    square over the realisations, and ``integration_error_factor`` the factor by which that may be off (95 %). NaN where
    they are unknown, with the attribute ``reason``.
    """
    if "statistics" not in node.children or (problem.timeless and not problem.model.scalars.needs_motion):
        return node
    statistics = node.children["statistics"].to_dataset(inherit=False)
    shape = problem.labels.shape
    mean = statistics.get("mean")
    if "integration_error" in statistics or not shape[0] or _is_static(problem):
        return node
    if mean is None or mean.dims != ("output", "time") or mean.shape != shape:
        return node
    found, attrs = _measured(problem, str(node.attrs.get("integrated_by", "")))
    stated = {
        name: (mean.dims, np.where(np.isfinite(mean.values), error, np.nan), {"long_name": about, **attrs})
        for (name, about), error in zip(LONG_NAMES.items(), found, strict=True)
    }
    node.children["statistics"].dataset = statistics.assign(stated)
    return node


def _is_static(problem: Problem) -> bool:
    """Return whether nothing is integrated."""
    return len(problem.times if problem.over is None else problem.over) < 2


def _measured(problem: Problem, by: str) -> tuple[tuple[Array, Array, Array], dict[str, str | int | float]]:
    """Return the three `stated_errors` (output, time), and how they were found."""
    unknown = (np.full(problem.labels.shape, np.nan),) * 3
    rtol = tighter(problem.rtol)
    if rtol is None:
        return unknown, {"reason": f"rtol is {problem.rtol:g}, and none that is much tighter is of use"}
    with warnings.catch_warnings():
        # the run itself has told
        warnings.simplefilter("ignore", RedundantConstraintWarning)
        try:
            values, first = _integrated_once(problem, by)
            if not len(values):
                return unknown, {"reason": "no realisation succeeded that could be integrated again"}
            again = _silent(problem, "again", rtol=rtol, integrator="auto").realise(values)
        except Exception as raised:  # noqa: BLE001 - what is measured must not cost what is known
            return unknown, {"reason": f"integrating again with rtol {rtol:g} failed: {reason_of(raised)}"}
    good = np.flatnonzero(again.status == Status.OK)
    if not len(good):
        why = again.most_frequent_reason()
        return unknown, {"reason": f"all {len(values)} realisations fail that are integrated with rtol {rtol:g}: {why}"}
    population = problem.runner.observed.counted or np.inf
    error = stated_errors(deviation(first[good], again.response[good], problem.labels.turns), population)
    comment = f"of {100 * LEVEL:g} % of realisations, from {len(good)} that were integrated again, with rtol {rtol:g}"
    failed = len(values) - len(good)
    more = f"; {failed} more failed there: {again.most_frequent_reason()}" if failed else ""
    return error, {"comment": comment + more, "realisations": len(good), "rtol": rtol}


def _integrated_once(problem: Problem, by: str) -> tuple[Array, Array]:
    """Return inputs (K, input) and responses (K, output, time) of realisations at the tolerance of the study.

    Where a method that solves for all together has done so by another integrator (`by`) than its realisations, these
    are integrated by that one.
    """
    seen = problem.runner.observed
    known = integrated_by(seen.counters, problem.integrator).get("integrated_by", "").split(", ")
    others = [name for name in by.split(", ") if name in built_in_names() and name not in known]
    if seen.values and not others:
        return np.array(seen.values), np.array(seen.responses)
    own = _silent(problem, "once", integrator=others[0] if others else problem.integrator)
    found = own.realise(np.array(seen.values) if seen.values else _points(problem))
    good = found.status == Status.OK
    return found.values[good], found.response[good]


def _points(problem: Problem) -> Array:
    """Return the medians of the inputs and further points of their distribution, shape (AGAIN, input)."""
    count = len(problem.inputs)
    if not count:
        return np.zeros((1, 0))
    steps = np.arange(AGAIN)[:, None] * (GOLDEN ** np.arange(1, count + 1))
    return problem.inputs.from_uniform((0.5 + steps) % 1.0)


def _silent(problem: Problem, what: str, **changes: Any) -> Problem:
    """Return a copy of a problem without progress reports and with a separate store of chunks."""
    part = problem.part(f"{problem.label}: {what}")
    known = problem.runner.again.setdefault(what, {})
    silent = part.using(executor=None, progress=Silent(), known=known, ledger=None)
    # errors of margins are not measured
    return replace(silent, model=replace(problem.model, margins=None), **changes)
