"""Multi-element collocation: a separate chaos from separate realisations in each box of the germ space."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import PiecewiseChaos, PolynomialChaos, Status
from uqmbd_collocation.fitting import Fit
from uqmbd_collocation.plans import STREAM, Plans
from uqmbd_collocation.record import nodes_of
from uqmbd_collocation.runs import CollocationRuns, announced_once

__all__ = ["collocate_elements"]


@dataclass(frozen=True)
class _BoxResult:
    """Results of the fit and the verification in a box."""

    probability: float
    runs: CollocationRuns
    fit: Fit
    verification: uqmbd.extend.Verification
    warned: tuple[str, ...]


@dataclass
class _ElementSplitting:
    """All computed elements in order of computation, including replaced ones."""

    plans: Plans
    problem: uqmbd.extend.Problem
    done: list[_BoxResult] = field(default_factory=list)
    counters: Counter[str] = field(default_factory=Counter)

    @property
    def spent(self) -> int:
        """Number of realisations so far."""
        return sum(len(one.runs) for one in self.done)

    def affordable(self) -> int:
        """Return the number of elements that may still be split."""
        costs = max(len(one.runs) for one in self.done)
        return (self.plans.max_realisations - self.spent) // (2 * costs)

    def compute(self, boxes: Sequence[uqmbd.extend.GermBox]) -> list[PolynomialChaos]:
        """Compute the realisations of all boxes together, and return a fit for each box."""
        planned = []
        for box in boxes:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                planned.append(self.plans.plan(box.local, self.plans.order))
                planned[-1].check(box.local)
        points = uqmbd.extend.VerificationPoints.of_elements(
            boxes, len(self.done), self.plans.verify, self.plans.seed, STREAM
        )
        wanted = [np.concatenate([p.nodes, v.germs]) for p, v in zip(planned, points, strict=True)]
        found = self.problem.realise(boxes[0].space.to_inputs(np.concatenate(wanted)))
        self.counters.update(found.counters)
        start, chaoses = 0, []
        for box, plan, where, germs in zip(boxes, planned, points, wanted, strict=True):
            runs = CollocationRuns.filled(self.problem, box.local, germs, found[start : start + len(germs)])
            start += len(germs)
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                fit = plan.fit(runs)
            verification = runs.verification(where)
            warned = tuple(str(w.message) for w in caught)
            self.done.append(_BoxResult(box.probability, runs, fit, verification, warned))
            chaoses.append(verification.chaos(fit.coefficients, fit.multi_index, self.problem.labels))
        return chaoses

    def verified(self, chaos: PiecewiseChaos, kept: Sequence[int]) -> list[PolynomialChaos]:
        """Verify the elements with indices `kept` at additional points in regions of large errors."""
        points = self.plans.further(chaos, self.spent) if self.plans.verify else []
        if not any(map(len, points)):
            return list(chaos.elements)
        wanted = [self.done[k].runs.space.to_inputs(own.germs) for k, own in zip(kept, points, strict=True)]
        found = self.problem.realise(np.concatenate(wanted))
        self.counters.update(found.counters)
        start, elements = 0, []
        for k, own, element in zip(kept, points, chaos.elements, strict=True):
            one, more = self.done[k], found[start : start + len(own)]
            start += len(own)
            if len(own):
                both = one.runs.joined(own.germs, more)
                known = one.verification.joined(uqmbd.extend.Verification.of(element.space, own, more))
                self.done[k] = replace(one, runs=both, verification=known)
                element = known.chaos(one.fit.coefficients, one.fit.multi_index, self.problem.labels)
            elements.append(element)
        return elements


def collocate_elements(
    propagator: uqmbd.extend.Propagator,
    problem: uqmbd.extend.Problem,
    space: uqmbd.extend.GermSpace,
    plans: Plans,
    limits: uqmbd.extend.ElementLimits,
) -> xr.DataTree:
    """Split the germ space where the error requires it, and return the node with statistics.

    Raise StudyError if an option does not suit the inputs, and IntegrationError if an element has too few successful
    realisations.
    """
    begin = problem.clock()
    planned = plans.plan(space, plans.order)
    planned.check(space)
    most = limits.computed * len(planned.nodes) + limits.verified(plans.verify, space)
    most += uqmbd.extend.VerificationPoints.further(most) if plans.verify else 0
    work = _ElementSplitting(plans, announced_once(problem, min(most, plans.max_realisations)))
    with problem.timed("fitting"):
        refined = uqmbd.extend.refine_elements(
            space,
            work.compute,
            limits,
            label=problem.label,
            rtol=problem.rtol,
            affordable=work.affordable,
            further=work.verified,
        )
    chaos = refined.chaos
    problem.progress.finish(problem.label)
    kept = [work.done[k] for k in refined.kept]
    for text in dict.fromkeys(text for one in kept for text in one.warned):
        warnings.warn(text, stacklevel=3)
    if failed := sum(one.verification.failures for one in kept):
        requested, empty = sum(one.verification.asked for one in kept), sum(not len(one.verification) for one in kept)
        all_of = f", and in {empty} of {len(kept)} elements all of them failed" if empty else ""
        warnings.warn(
            f"{problem.label}: {failed} of {requested} verification realisations failed{all_of}; the stated error is "
            "based on the successful ones.",
            stacklevel=3,
        )
    return problem.node(
        propagator,
        chaos.statistics(),
        realisations=work.spent,
        wall_time=problem.clock() - begin,
        counters=dict(work.counters),
        children={
            "chaos": chaos.to_dataset(),
            "nodes": _nodes(work, refined.kept),
            "elements": refined.steps,
        },
        attrs={
            "failures": sum(int((one.runs.status != Status.OK).sum()) for one in work.done),
            "failed_share": _failed_share(kept),
            "fit": f"{len(kept)} elements, each by {work.done[0].fit.how}",
            "terms": len(chaos.multi_index),
            "highest_degree": int(chaos.multi_index.max()),
            "nodes": sum(len(np.unique(one.fit.where)) + one.fit.failed for one in kept),
            "verification": sum(len(one.verification) for one in kept),
            "elements": len(kept),
            "elements_computed": refined.computed,
            "threshold_met": str(refined.met),
        },
    )


def _failed_share(elements: Sequence[_BoxResult]) -> float:
    """Return the share of failed realisations, weighted by the probabilities of their elements."""
    verified = [one.verification for one in elements]
    failures = sum(int((one.runs.status != Status.OK).sum()) for one in elements)
    others = sum(len(one.runs) for one in elements) - sum(one.asked for one in verified)
    failed = max(failures - sum(one.failures for one in verified), 0)
    return uqmbd.extend.Verification.failed_share(
        verified, [one.probability for one in elements], max(others, 0), failed
    )


def _nodes(work: _ElementSplitting, kept: tuple[int, ...]) -> xr.Dataset:
    """Return the dataset `nodes`: inputs, element (-1: a replaced element) and purpose of each realisation."""
    place = {number: k for k, number in enumerate(kept)}
    purposes = []
    for one in work.done:
        own = np.full(len(one.runs), "verification", dtype="<U12")
        own[one.fit.where] = "fit"
        purposes.append(own)
    elements = [np.full(len(one.runs), place.get(k, -1), dtype=np.int64) for k, one in enumerate(work.done)]
    joined = [one.runs for one in work.done]
    inputs, germs = np.concatenate([r.values for r in joined]), np.concatenate([r.germs for r in joined])
    status = np.concatenate([r.status for r in joined])
    messages = [m for r in joined for m in r.messages]
    found = nodes_of(
        work.problem.labels, joined[0].space.names, inputs, germs, status, messages, np.concatenate(purposes)
    )
    comment = {"comment": "-1: the node belongs to an element that was split further"}
    return found.assign(element=("node", np.concatenate(elements), comment))
