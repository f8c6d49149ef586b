"""Computation of a fit from realisations, at a fixed order or with refinement."""

from __future__ import annotations

import numpy as np

import uqmbd
from uqmbd_collocation.fitting import Fit
from uqmbd_collocation.plans import DEFAULT_ORDER, Plans
from uqmbd_collocation.refinement import Limits, Refinement, raise_order, refine_dimensions
from uqmbd_collocation.runs import CollocationRuns

__all__ = ["computed"]


def computed(
    runs: CollocationRuns, plans: Plans, points: uqmbd.extend.VerificationPoints, limits: Limits
) -> tuple[Fit, Refinement | None]:
    """Compute the planned realisations and the verification points, and add them to `runs`.

    Return the fit, and the refinement, or None at a fixed order.
    """
    label, space = runs.problem.label, runs.space
    if plans.adaptive == "no":
        planned = plans.plan(space, plans.order)
        planned.check(space)
        # compute nodes and verification points in the same stacks
        runs.at(np.concatenate([planned.nodes, points.germs]))
        return planned.fit(runs), None
    if plans.adaptive == "dimension":
        found = refine_dimensions(runs, points, limits, label)
    else:
        first = DEFAULT_ORDER if plans.order is None else plans.order
        found = raise_order(runs, points, lambda order: plans.plan(space, order), first, limits, label)
    return found.fit, found
