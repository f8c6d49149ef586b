"""Plain collocation: expansion of outputs at equal times on the whole germ space."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np

import uqmbd
from uqmbd.results import PolynomialChaos, Status
from uqmbd_collocation.computing import computed
from uqmbd_collocation.expanded import Expanded
from uqmbd_collocation.gaps import with_gaps
from uqmbd_collocation.plans import Plans
from uqmbd_collocation.record import nodes_dataset, warn_of_failures
from uqmbd_collocation.refinement import Limits, history
from uqmbd_collocation.runs import CollocationRuns, RealisationSource

__all__ = ["expand", "warn_of_discontinuities"]


def expand(
    source: RealisationSource,
    space: uqmbd.extend.GermSpace,
    plans: Plans,
    limits: Limits,
    given: uqmbd.extend.Verification | None = None,
    quiet: bool = False,
) -> tuple[Expanded, float]:
    """Compute realisations, fit and verify a chaos; return the surrogate, and the time of the realisations, s.

    `given`: available verification realisations; `quiet`: suppress the warning of outputs that look discontinuous.
    Raise IntegrationError if too few realisations succeed.
    """
    label, runs, extremes = source.label, CollocationRuns(source, space), plans.extremes if given is None else 0
    points = plans.verification_points(space, extremes)
    if given is not None:
        points = given.points
        count = len(points)
        known = uqmbd.extend.Realisations(
            space.to_inputs(points.germs), given.response, np.zeros(count, dtype=np.int64), ("",) * count, {}, 0.0
        )
        runs = CollocationRuns.filled(source, space, points.germs, known)
    fit, refinement = computed(runs, plans, points, replace(limits, reserved=extremes))
    verification = runs.verification(points)
    chaos = verification.chaos(fit.coefficients, fit.multi_index, source.labels)
    if extremes:
        error = chaos.verification_error().reshape(runs.response.shape[1:]) if len(verification) else None
        points = plans.with_extremes(points, runs, error)
        verification = runs.verification(points)
        chaos = verification.chaos(fit.coefficients, fit.multi_index, source.labels)
        if len(verification) and len(further := with_gaps(points, chaos, runs, plans)) > len(points):
            points, verification = further, runs.verification(further)
            chaos = verification.chaos(fit.coefficients, fit.multi_index, source.labels)
    warn_of_failures(verification, label)
    if not quiet:
        warn_of_discontinuities(chaos, plans, label)
    failures, others = int((runs.status != Status.OK).sum()), max(len(runs) - verification.asked, 0)
    failed = max(failures - verification.failures, 0)
    attrs = {
        "failures": failures,
        "failed_share": verification.failed_share([verification], [1.0], others, failed),
        "fit": fit.how,
        "terms": len(fit.multi_index),
        "highest_degree": int(fit.multi_index.max()),
        "nodes": len(np.unique(fit.where)) + fit.failed,
        "verification": len(verification),
    }
    # add available nodes first, because their progress has already been reported
    nodes, before = nodes_dataset(runs, runs.at(points.germs), fit), 0 if given is None else len(points)
    found = Expanded(
        chaos,
        len(runs) - before,
        runs.counters,
        nodes.isel(node=slice(before, None)),
        attrs if refinement is None else {**attrs, "tolerance_met": str(refinement.met)},
        {} if refinement is None else {"refinement": history(refinement.steps)},
        fit.leave_one_out,
    )
    return found, runs.wall_time


def warn_of_discontinuities(chaos: PolynomialChaos, plans: Plans, label: str) -> None:
    """Warn of outputs that look discontinuous in the inputs."""
    # a refinement has separate warnings, and a fit to too few samples looks like a discontinuity
    plain = plans.adaptive == "no" and bool(plans.grid)
    suspicions = [one.words() for one in chaos.discontinuities() if plain and one and one.clear]
    if suspicions:
        warnings.warn(f"{label}: {'; '.join(suspicions)}.", stacklevel=3)
