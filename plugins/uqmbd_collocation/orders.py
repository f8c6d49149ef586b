"""Adaptive order: increasing orders, until mean and standard deviation converge."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

import uqmbd
from uqmbd_collocation.fitting import Fit, QuadratureProjection, Regression
from uqmbd_collocation.refinement import Limits, Refinement, RefinementStep, missed_share, scale_of, warn_unmet
from uqmbd_collocation.runs import CollocationRuns
from uqmbd_collocation.sparse_grids import SparseProjection
from uqmbd_collocation.user_expansion import UserProjection

__all__ = ["HIGHEST", "raise_order"]


HIGHEST = 32
"""Order at which a refinement ends: no convergence is expected beyond."""


def raise_order(
    runs: CollocationRuns,
    points: uqmbd.extend.VerificationPoints,
    plan: Callable[[int], QuadratureProjection | SparseProjection | Regression | UserProjection],
    first: int,
    limits: Limits,
    label: str,
) -> Refinement:
    """Raise the order from `first` until mean and standard deviation change by less than the tolerance.

    `plan` gives nodes and fit of an order. The tolerance is not met while the error at the verification points exceeds
    it. Raise StudyError if the first order is impossible.
    """
    steps: list[RefinementStep] = []
    fit: Fit | None = None
    terms = 0
    for order in range(first, max(first, HIGHEST) + 1):
        try:
            planned = plan(order)
            if len(planned.multi_index) == terms:
                continue  # weights leave some orders without terms of their own
            terms = len(planned.multi_index)
            planned.check(runs.space)
            wanted = np.concatenate([planned.nodes, points.germs])
            more = len(runs.missing(wanted))
            if len(runs) + more > limits.most:
                raise uqmbd.StudyError(f"it needs {more} more realisations, and max_realisations is {limits.most}")
            runs.at(wanted)
            following = planned.fit(runs)
        except (uqmbd.StudyError, uqmbd.IntegrationError) as error:
            if fit is None:
                raise
            warn_unmet(label, limits, steps, f"order {order} cannot be done: {error}")
            return Refinement(fit, tuple(steps))
        changes = _changes(runs, fit, following)
        fit = following
        missed = missed_share(runs, fit.coefficients, fit.multi_index, points)
        steps.append(RefinementStep(len(runs), len(fit.multi_index), *changes, missed))
        steps[-1].log(label, limits)
        complete = terms == _most_terms(runs.space)
        if missed < limits.tolerance and (complete or steps[-1].change < limits.tolerance):
            return Refinement(fit, tuple(steps), met=not fit.failed)
        if fit.failed:
            warn_unmet(label, limits, steps, "the order is not raised further, because realisations failed")
            return Refinement(fit, tuple(steps))
        if complete:
            warn_unmet(label, limits, steps, f"there are no further terms than these {terms}")
            return Refinement(fit, tuple(steps))
    if fit is None:
        raise uqmbd.StudyError(f"{label}: no order was tried.")
    warn_unmet(label, limits, steps, f"order {max(first, HIGHEST)} is the highest that is tried")
    return Refinement(fit, tuple(steps))


def _most_terms(space: uqmbd.extend.GermSpace) -> int | None:
    """Return the number of terms of the highest order if all germs take few values; None: there is no highest."""
    values = [germ.values for germ in space.germs if germ.values is not None]
    return math.prod(values) if len(values) == space.dimension else None


def _changes(runs: CollocationRuns, before: Fit | None, now: Fit) -> tuple[float, float]:
    """Largest change of mean and standard deviation, over the scale of each output."""
    if before is None:
        return np.inf, np.inf
    variance = [np.sum(f.coefficients[1:] ** 2, axis=0) for f in (before, now)]
    scale = scale_of(runs, now.coefficients[0], variance[1])[:, None]
    mean = np.abs(now.coefficients[0] - before.coefficients[0]) / scale
    std = np.abs(np.sqrt(variance[1]) - np.sqrt(variance[0])) / scale
    return float(mean.max()), float(std.max())
