"""Plain collocation: outputs at equal times, expanded on the whole germ space."""

from __future__ import annotations

import warnings

import numpy as np

import uqmbd
from uqmbd.results import PolynomialChaos, Status
from uqmbd_collocation.computing import computed
from uqmbd_collocation.expanded import Expanded
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
    """Compute realisations, fit and verify; return the surrogate, and the computing time of the realisations, s.

    `given` are verification realisations that are known; `quiet` suppresses the warning of outputs that look
    discontinuous. Raise IntegrationError if failures leave too few realisations.
    """
    label, runs, points = source.label, CollocationRuns(source, space), plans.verification_points(space)
    if given is not None:
        points = given.points
        count = len(points)
        known = uqmbd.extend.Realisations(
            space.to_inputs(points.germs), given.response, np.zeros(count, dtype=np.int64), ("",) * count, {}, 0.0
        )
        runs = CollocationRuns.filled(source, space, points.germs, known)
    fit, refinement = computed(runs, plans, points, limits)
    verification = runs.verification(points)
    warn_of_failures(verification, label)
    chaos = verification.chaos(fit.coefficients, fit.multi_index, source.labels)
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
    # known nodes come first; their progress has been reported already
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
    # a refinement has words of its own, and samples that are too few look the same
    plain = plans.adaptive == "no" and bool(plans.grid)
    suspicions = [one.words() for one in chaos.discontinuities() if plain and one and one.clear]
    if suspicions:
        warnings.warn(f"{label}: {'; '.join(suspicions)}.", stacklevel=3)
