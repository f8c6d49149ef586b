"""Measure the error of the time integration by a second integration of some realisations at a tighter tolerance.

The sample is one in twenty successful realisations of a method, evenly spread, and at least three. With stored samples
of few inputs, a quarter of these realisations are the most sensitive samples. Near a separatrix, sensitive samples have
most of the error. The choice does not depend on the workers. A method that solves for all realisations together
computes no separate realisations. For such a method, the points are the medians of the inputs and two further points of
their distribution.

The second integration uses the built-in integrator ``auto`` at one hundredth of the tolerance. The comparison is
therefore also an independent check of IDA and of integrators of plugins. Stiff realisations of ``radau`` are repeated
by ``radau``: at a small tolerance ``auto`` is explicit, and its error of accelerations is determined by the limit of
stability, not by the tolerance. If all steps end at samples of a controller or at other given times, both integrations
may take equal steps. All differences are then rounding, and do not measure the error. In this case, a few of the
realisations are integrated a third time at the tightest tolerance.
"""

from __future__ import annotations

import warnings
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.dynamics import built_in_names
from uqmbd.errors import RedundantConstraintWarning
from uqmbd.isolation import reason_of
from uqmbd.progress import Silent
from uqmbd.propagation.execution import AGAIN, Realisations, integrated_by
from uqmbd.propagation.problem import Problem
from uqmbd.results.schema import united
from uqmbd.status import Status
from uqmbd.typing import Array, Index

__all__ = ["LEAST", "LONG_NAME", "deviation", "equal_but_for_rounding", "tighter", "with_integration_error"]


FACTOR = 0.01
"""Ratio of the tolerance of the second integration to the tolerance of the first one."""

IMPLICIT = "radau"
"""Integrator of stiff realisations, which also repeats them."""

LEAST = 1e-13
"""Tightest useful tolerance in double precision."""

ROUNDING = 1e-12
"""Largest difference of two integrations, relative to the largest value, that may be rounding."""

LEVEL, TAIL = 0.99, 0.025
"""Level of the stated quantile of errors, and tail probability on each side of the interval of their mean square."""

OFTEN = 0.9
"""Level of the quantile, over time, that is a lower limit on the relative variances of mean squares."""

SENSITIVE, LEAST_SENSITIVE = 4, 8
"""Number of repeated samples for each most sensitive one, and number of repeated samples from which these are used."""

MOST_SAMPLES, MOST_INPUTS, MOST_TIMES = 2_000, 6, 64
"""Largest numbers of samples and inputs for estimated sensitivities, and number of times in the estimate."""

GOLDEN = 0.6180339887498949

TOGETHER = 8
"""Number of realisations in one repeated integration: one batch of a kernel, because other computations wait for it."""

LONG_NAME = "error of the time integration"

LONG_NAMES = {
    "integration_error_rms": f"{LONG_NAME}, root mean square over realisations",
    "integration_error_factor": "factor by which the root mean square of the integration error may be wrong",
    "integration_error": LONG_NAME,
}
"""Names of the variables in the order of `stated_errors`, with their long names."""


def tighter(rtol: float) -> float | None:
    """Return the tolerance of the second integration; None if it cannot be tighter by a factor of ten.

    >>> tighter(1e-6), tighter(1e-13)
    (1e-08, None)
    """
    found = max(FACTOR * rtol, LEAST)
    return found if found <= 0.1 * rtol * (1 + 1e-9) else None


def deviation(first: Array, second: Array, turns: Array) -> Array:
    """Return the absolute difference of responses (..., output, time); angles differ modulo whole turns.

    `turns` (output,) is the length of a turn in the units of each output, 0 for outputs other than angles.

    >>> deviation(np.array([[1.0]]), np.array([[361.5]]), np.array([360.0])).tolist()
    [[0.5]]
    """
    with np.errstate(invalid="ignore"):
        difference = first - second  # the difference of infinite values is not a number
    turn = np.where(turns > 0, turns, 1.0)[:, None]
    return np.abs(difference - np.where(turns[:, None] > 0, turn * np.round(difference / turn), 0.0))


def equal_but_for_rounding(differences: Array, values: Array) -> bool:
    """Return whether all differences of two integrations may be rounding; `values` are outputs of one of them.

    >>> equal_but_for_rounding(np.array([0.0, 1e-15]), np.array([2.0, 1.0]))
    True
    """
    return bool((differences <= ROUNDING * np.abs(values).max(initial=0.0)).all())


def stated_errors(wrong: Array, population: float, sensitive: int = 0) -> tuple[Array, Array, Array]:
    """Return root mean square, its factor of uncertainty and a limit of errors (K, output, time) at each time.

    The root mean square of a `population` of realisations differs from the returned one by at most this factor, with
    95 % confidence. Mean squares are approximated as multiples of chi-square (Box).
    The factor is 1 if the errors belong to the complete population. The limit is an upper limit of the 99 % quantile
    of the errors, and at least the largest of them. Few realisations do not determine quantiles at single times. Ratios
    of errors to their root mean square are therefore pooled over time.

    The first `sensitive` errors belong to chosen realisations, which represent themselves. The others represent the
    rest of the population.

    >>> found = stated_errors(np.array([[[0.0, 3.0]], [[0.0, 4.0]], [[0.0, 5.0]]]), np.inf)
    >>> [one.round(2).tolist() for one in found]
    [[[0.0, 4.08]], [[1.0, 3.73]], [[0.0, 18.57]]]
    >>> stated_errors(np.array([[[2.0]]]), 1)
    (array([[2.]]), array([[1.]]), array([[2.]]))
    >>> stated_errors(np.array([[[10.0]], [[1.0]], [[1.0]]]), 4, sensitive=1)[0].round(2).tolist()
    [[5.07]]
    """
    from scipy.special import chdtri

    rest = len(wrong) - sensitive
    share = 1.0 - sensitive / population
    weights = np.repeat([1.0 / population, share / rest], [sensitive, rest])
    others = wrong[sensitive:] ** 2
    of_others = others.mean(axis=0)
    mean = share * of_others + (wrong[:sensitive] ** 2).sum(axis=0) / population
    rms, some = np.sqrt(mean), mean > 0
    ratios = wrong / np.where(some, rms, 1.0)
    spread = ((others - of_others) ** 2).sum(axis=0) / max(1, rest - 1) / rest
    relative = np.divide(share**2 * spread, mean**2, out=np.zeros(mean.shape), where=some)
    least = 2 / rest * np.divide(share * of_others, mean, out=np.ones(mean.shape), where=some) ** 2
    largest = np.zeros((len(mean), 1))
    for output, known in enumerate(some):
        if known.any():
            # few realisations underestimate the spread of long tails, mostly at times with too small a mean square
            relative[output] = np.maximum(relative[output], np.quantile(relative[output, known], OFTEN))
            largest[output] = _quantile(ratios[:, output, known], weights, sensitive)
    freedom = np.clip(2 / np.maximum(np.maximum(relative, least), 1e-9), 1.0, None)
    left = max(0.0, 1.0 - rest / (population - sensitive))
    factor = np.sqrt(freedom / chdtri(freedom, 1.0 - TAIL)) ** np.sqrt(left)
    factor = np.where(some, factor, 1.0)
    return rms, factor, np.maximum(rms * largest * factor, wrong.max(axis=0))


def _quantile(ratios: Array, weights: Array, sensitive: int) -> float:
    """Return the stated quantile of ratios (K, T) of realisations with weights (K,)."""
    if not sensitive:
        return float(np.quantile(ratios, LEVEL))
    weighted = np.repeat(weights, ratios.shape[1])
    return float(np.quantile(ratios.ravel(), LEVEL, weights=weighted, method="inverted_cdf"))


def with_integration_error(node: xr.DataTree, problem: Problem) -> xr.DataTree:
    """Add ``integration_error`` (output, time), in the units of the outputs, to the statistics of a method.

    The value is an upper limit: at most 1 % of realisations have a larger error. ``integration_error_rms`` is the root
    mean square over the realisations. ``integration_error_factor`` is the uncertainty factor of this root mean square
    (95 %). Unknown values are NaN, with the attribute ``reason``.
    """
    if "statistics" not in node.children or (problem.timeless and not problem.model.scalars.needs_motion):
        return node
    statistics = node.children["statistics"].to_dataset(inherit=False)
    shape = problem.labels.shape
    mean = statistics.get("mean")
    static = len(problem.whole_times) < 2
    if "integration_error" in statistics or not shape[0] or static:
        return node
    if mean is None or mean.dims != ("output", "time") or mean.shape != shape:
        return node
    samples = node.children["samples"].to_dataset(inherit=False) if "samples" in node.children else None
    found, attrs = _measured(problem, str(node.attrs.get("integrated_by", "")), samples)
    stated = {
        name: (mean.dims, np.where(np.isfinite(mean.values), error, np.nan), {"long_name": about, **attrs})
        for (name, about), error in zip(LONG_NAMES.items(), found, strict=True)
    }
    node.children["statistics"].dataset = united(statistics.assign(stated), copy=False)
    return node


def _measured(
    problem: Problem, by: str, samples: xr.Dataset | None
) -> tuple[tuple[Array, Array, Array], dict[str, str | int | float]]:
    """Return the three `stated_errors` (output, time), and attributes that describe the procedure."""
    unknown = (np.full(problem.labels.shape, np.nan),) * 3
    rtol = tighter(problem.rtol)
    if rtol is None:
        return unknown, {"reason": f"rtol is {problem.rtol:g}; a smaller tolerance would not reduce the error"}
    with warnings.catch_warnings():
        # the run has already reported these warnings
        warnings.simplefilter("ignore", RedundantConstraintWarning)
        try:
            values, first = _integrated_once(problem, by)
            values, first, sensitive = _with_sensitive(values, first, samples, problem.runner.observed.counted)
            if not len(values):
                return unknown, {"reason": "all realisations failed, so none can be integrated again"}
            # few realisations do not justify the start of workers
            workers = problem.runner.executor if len(values) > AGAIN else None
            again, good, wrong = _repeated(problem, values, first, workers, rtol)
            if rtol > LEAST and len(good) and equal_but_for_rounding(wrong, first[good]):
                few = slice(sensitive, sensitive + TOGETHER)
                rtol, values, first, sensitive = LEAST, values[few], first[few], 0
                again, good, wrong = _repeated(problem, values, first, workers, rtol)
        except Exception as raised:  # noqa: BLE001 - a failed measurement must not discard the results
            return unknown, {"reason": f"integrating again with rtol {rtol:g} failed: {reason_of(raised)}"}
    if not len(good):
        why = again.most_frequent_reason()
        return unknown, {
            "reason": f"the repeated integrations of all {len(values)} realisations with rtol {rtol:g} failed: {why}"
        }
    population = problem.runner.observed.counted or np.inf
    sensitive = int(np.count_nonzero(good < sensitive))
    error = stated_errors(wrong, population, sensitive)
    comment = (
        f"upper limit of the error of {100 * LEVEL:g} % of realisations, from {len(good)} repeated integrations with "
        f"rtol {rtol:g}"
    )
    failed = len(values) - len(good)
    more = f"; {failed} repeated integrations failed: {again.most_frequent_reason()}" if failed else ""
    return error, {"comment": comment + more, "realisations": len(good), "rtol": rtol}


def _repeated(
    problem: Problem, values: Array, first: Array, workers: Executor | None, rtol: float
) -> tuple[Realisations, Index, Array]:
    """Integrate realisations at inputs (K, input) again; return them, indices of the successful ones, and deviations.

    `first` (K, output, time): responses at the tolerance of the study.
    """
    what = "again" if rtol > LEAST else "again at the tightest tolerance"
    known = integrated_by(problem.runner.observed.counters, problem.integrator).get("integrated_by", "").split(", ")
    integrator = IMPLICIT if known[0] == IMPLICIT else "auto"
    again = _silent(problem, what, workers, rtol=rtol, integrator=integrator).realise(values)
    good = np.flatnonzero(again.status == Status.OK)
    return again, good, deviation(first[good], again.response[good], problem.labels.turns)


def _integrated_once(problem: Problem, by: str) -> tuple[Array, Array]:
    """Return inputs (K, input) and responses (K, output, time) at the tolerance of the study.

    A method that solves for all realisations together may have used another integrator (`by`) than for its separate
    realisations. In this case `by` integrates the realisations.
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


def _with_sensitive(
    values: Array, responses: Array, samples: xr.Dataset | None, counted: int
) -> tuple[Array, Array, int]:
    """Replace some of the realisations (K, ...) by the most sensitive samples, which come first, and count these.

    The sensitivity of a sample is the difference of its response from the response of a neighbour, divided by their
    distance. A high sensitivity amplifies small local errors. Samples have no sensitivities if they are not the whole
    population, or too many.
    """
    from scipy.spatial import cKDTree

    unchanged = values, responses, 0
    if samples is None or len(values) < LEAST_SENSITIVE or samples["response"].shape[1:] != responses.shape[1:]:
        return unchanged
    good = samples["status"].values == Status.OK
    inputs = samples["inputs"].values[good]
    if len(inputs) != counted or counted > MOST_SAMPLES or not 0 < inputs.shape[1] <= MOST_INPUTS:
        return unchanged
    every = max(1, -(-responses.shape[2] // MOST_TIMES))
    known = samples["response"].values[good]
    some, spread = known[:, :, ::every], known.std(axis=0).max(axis=-1)[:, None]
    std = inputs.std(axis=0)
    scaled = inputs / np.where(std > 0, std, 1.0)
    distance, near = cKDTree(scaled).query(scaled, k=3)
    slopes = np.zeros(len(inputs))
    for apart, other in zip(distance.T[1:], near.T[1:], strict=True):
        step = np.sqrt((((some - some[other]) / np.where(spread > 0, spread, 1.0)) ** 2).mean(axis=2)).max(axis=1)
        slopes = np.maximum(slopes, np.divide(step, apart, out=np.zeros_like(step), where=apart > 0))
    chosen = np.argsort(-slopes, kind="stable")[: len(values) // SENSITIVE]
    others = np.flatnonzero(~(values[:, None] == inputs[chosen]).all(axis=2).any(axis=1))
    kept = others[np.linspace(0, len(others) - 1, len(values) - len(chosen)).round().astype(int)]
    return (
        np.concatenate([inputs[chosen], values[kept]]),
        np.concatenate([known[chosen], responses[kept]]),
        len(chosen),
    )


def _points(problem: Problem) -> Array:
    """Return the medians of the inputs and further points of their distribution, shape (AGAIN, input)."""
    count = len(problem.inputs)
    if not count:
        return np.zeros((1, 0))
    steps = np.arange(AGAIN)[:, None] * (GOLDEN ** np.arange(1, count + 1))
    return problem.inputs.from_uniform((0.5 + steps) % 1.0)


def _silent(problem: Problem, what: str, workers: Executor | None = None, **changes: Any) -> Problem:
    """Return a copy of a problem with the given workers, a separate store of chunks, and no progress reports."""
    part = problem.part(f"{problem.label}: {what}")
    known = problem.runner.again.setdefault(what, {})
    silent = part.using(executor=workers, progress=Silent(), known=known, ledger=None, chunk=TOGETHER)
    # the errors of margins are not measured
    return replace(silent, model=replace(problem.model, margins=None), **changes)
