"""Adaptive order: refinement by increasing orders until mean and standard deviation converge."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

import uqmbd
from uqmbd_collocation.fitting import Fit, QuadratureProjection, Regression
from uqmbd_collocation.plans import TooManyNodes
from uqmbd_collocation.refinement.steps import Limits, Refinement, RefinementStep, missed_share, scale_of, warn_unmet
from uqmbd_collocation.runs import CollocationRuns
from uqmbd_collocation.sparse_grids import SparseProjection
from uqmbd_collocation.user_expansion import UserProjection

__all__ = ["HIGHEST", "raise_order"]


HIGHEST = 32
"""Order at which a refinement stops, because no convergence is expected beyond it."""


def raise_order(
    runs: CollocationRuns,
    points: uqmbd.extend.VerificationPoints,
    plan: Callable[[int], QuadratureProjection | SparseProjection | Regression | UserProjection],
    first: int,
    limits: Limits,
    label: str,
) -> Refinement:
    """Raise the order from `first` until mean and standard deviation change by less than the tolerance.

    `plan`: function that returns nodes and fit for an order. The order also rises while the error at the verification
    points exceeds the tolerance. If `limits` contains an error, only the error at the verification points ends the
    refinement. Raise StudyError if the first order is impossible.
    """
    steps: list[RefinementStep] = []
    fit: Fit | None = None
    terms = 0
    for order in range(first, max(first, HIGHEST) + 1):
        try:
            planned = plan(order)
            if len(planned.multi_index) == terms:
                continue  # with weights, some orders have no new terms
            terms = len(planned.multi_index)
            planned.check(runs.space)
            wanted = np.concatenate([planned.nodes, points.germs])
            more = len(runs.missing(wanted)) + limits.reserved
            if len(runs) + more > limits.most:
                raise TooManyNodes(f"it needs {more} more realisations, but max_realisations is {limits.most}")
            runs.at(wanted)
            following = planned.fit(runs)
        except (uqmbd.StudyError, uqmbd.IntegrationError) as error:
            if fit is None:
                raise
            reason, more = f"order {order} is not possible: {error}", isinstance(error, TooManyNodes)
            warn_unmet(label, limits, steps, reason, "realisations" if more else "neither")
            return Refinement(fit, tuple(steps))
        changes = _changes(runs, fit, following)
        fit = following
        missed = missed_share(runs, fit.coefficients, fit.multi_index, points)
        steps.append(RefinementStep(len(runs), len(fit.multi_index), *changes, missed))
        steps[-1].log(label, limits)
        complete = terms == _most_terms(runs.space)
        if steps[-1].met(limits, settled=complete or steps[-1].change < limits.tolerance):
            return Refinement(fit, tuple(steps), met=not fit.failed)
        if fit.failed:
            warn_unmet(
                label, limits, steps, "the refinement of the order stopped because realisations failed", "neither"
            )
            return Refinement(fit, tuple(steps))
        if complete:
            warn_unmet(label, limits, steps, f"the basis contains all {terms} possible terms already", "neither")
            return Refinement(fit, tuple(steps))
    if fit is None:
        raise uqmbd.StudyError(f"{label}: the refinement tried no order.")
    warn_unmet(label, limits, steps, f"order {max(first, HIGHEST)} is the highest order of the refinement", "samples")
    return Refinement(fit, tuple(steps))


def _most_terms(space: uqmbd.extend.GermSpace) -> int | None:
    """Return the number of terms of the highest possible order; None if a germ is continuous, so that none exists."""
    values = [germ.values for germ in space.germs if germ.values is not None]
    return math.prod(values) if len(values) == space.dimension else None


def _changes(runs: CollocationRuns, before: Fit | None, now: Fit) -> tuple[float, float]:
    """Return the largest changes of mean and standard deviation, divided by the scale of each output."""
    if before is None:
        return np.inf, np.inf
    variance = [np.sum(f.coefficients[1:] ** 2, axis=0) for f in (before, now)]
    scale = scale_of(runs, now.coefficients[0], variance[1])[:, None]
    mean = np.abs(now.coefficients[0] - before.coefficients[0]) / scale
    std = np.abs(np.sqrt(variance[1]) - np.sqrt(variance[0])) / scale
    return float(mean.max()), float(std.max())
