"""The error of the time integration, measured: a few realisations are integrated again at a tighter tolerance.

Which ones does not depend on who computes: they lie evenly among the first successful ones that a method has computed.
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

GOLDEN = 0.6180339887498949

LONG_NAME = "error of the time integration"


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


def with_integration_error(node: xr.DataTree, problem: Problem) -> xr.DataTree:
    """Add ``statistics/integration_error`` (output, time), in the units of the outputs, to the node of a method.

    It is the largest absolute difference over the realisations that were integrated again; NaN where it is unknown,
    with the attribute ``reason``.
    """
    if "statistics" not in node.children or (problem.timeless and not problem.model.scalars.needs_motion):
        return node
    statistics = node.children["statistics"].to_dataset(inherit=False)
    shape = problem.labels.shape
    mean = statistics.get("mean")
    if "integration_error" in statistics or not shape[0] or _still(problem):
        return node
    if mean is None or mean.dims != ("output", "time") or mean.shape != shape:
        return node
    error, attrs = _measured(problem, str(node.attrs.get("integrated_by", "")))
    error = np.where(np.isfinite(mean.values), error, np.nan)
    attrs = {"long_name": LONG_NAME, **attrs}
    node.children["statistics"].dataset = statistics.assign(integration_error=(mean.dims, error, attrs))
    return node


def _still(problem: Problem) -> bool:
    """Tell whether nothing is integrated."""
    return len(problem.times if problem.over is None else problem.over) < 2


def _measured(problem: Problem, by: str) -> tuple[Array, dict[str, str | int | float]]:
    """Return the error (output, time), and how it was found."""
    unknown = np.full(problem.labels.shape, np.nan)
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
    error = deviation(first[good], again.response[good], problem.labels.turns).max(axis=0)
    comment = f"largest over {len(good)} realisations that were integrated again, with rtol {rtol:g}"
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
    own.realise(np.array(seen.values) if seen.values else _points(problem))
    return np.array(own.runner.observed.values), np.array(own.runner.observed.responses)


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
