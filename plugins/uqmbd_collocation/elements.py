"""Multi-element collocation: a chaos of its own, from realisations of its own, in each box of the germ space."""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import PolynomialChaos, Status
from uqmbd_collocation.fitting import Fit
from uqmbd_collocation.plans import plan, verification_points
from uqmbd_collocation.record import warn_of_idle_inputs
from uqmbd_collocation.runs import Runs, announced_once

if TYPE_CHECKING:
    from uqmbd_collocation.propagator import Collocation

__all__ = ["collocate_elements"]


FEWEST = 3
"""Verification realisations that every element gets, however improbable."""


@dataclass(frozen=True)
class _Element:
    """What was computed in a box."""

    runs: Runs
    fit: Fit
    verification: int
    warned: tuple[str, ...]


@dataclass
class _Elements:
    """All elements that were computed, replaced ones too, in that order."""

    options: Collocation
    problem: uqmbd.Problem
    done: list[_Element] = field(default_factory=list)
    counters: Counter[str] = field(default_factory=Counter)

    @property
    def spent(self) -> int:
        """Realisations so far."""
        return sum(len(one.runs) for one in self.done)

    def affordable(self) -> int:
        """Return how many elements may still be split."""
        costs = max(len(one.runs) for one in self.done)
        return (self.options.max_realisations - self.spent) // (2 * costs)

    def compute(self, boxes: Sequence[uqmbd.GermBox]) -> list[PolynomialChaos]:
        """Compute the realisations of all boxes together, and fit each."""
        options, label = self.options, self.problem.label
        plans, points = [], []
        for number, box in enumerate(boxes, start=len(self.done)):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                plans.append(plan(options, box.local, options.order, label))
                plans[-1].check(box.local)
            count = max(FEWEST, math.ceil(options.verify * box.probability)) if options.verify else 0
            seed = int(np.random.SeedSequence([options.seed, number]).generate_state(1)[0])
            points.append(verification_points(box.local, count, seed))
        wanted = [np.concatenate([p.nodes, v]) for p, v in zip(plans, points, strict=True)]
        found = self.problem.realise(boxes[0].space.to_inputs(np.concatenate(wanted)))
        self.counters.update(found.counters)
        start, chaoses = 0, []
        for box, planned, where, germs in zip(boxes, plans, points, wanted, strict=True):
            runs = Runs.filled(self.problem, box.local, germs, found, start)
            start += len(germs)
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                fit = planned.fit(runs)
            verified = runs.at(where)
            good = verified[runs.good(verified)]
            self.done.append(_Element(runs, fit, len(good), tuple(str(w.message) for w in caught)))
            chaoses.append(
                PolynomialChaos(
                    fit.coefficients,
                    fit.multi_index,
                    box.local,
                    self.problem.labels,
                    verification_germs=runs.germs[good] if len(good) else None,
                    verification_response=runs.response[good] if len(good) else None,
                )
            )
        return chaoses


def collocate_elements(options: Collocation, problem: uqmbd.Problem, space: uqmbd.GermSpace) -> xr.DataTree:
    """Split the germ space where it is needed, and summarise.

    Raises
    ------
    uqmbd.StudyError
        If an option does not suit the inputs.
    uqmbd.IntegrationError
        If failures leave too few realisations in an element.
    """
    begin = problem.clock()
    limits = uqmbd.ElementLimits(options.elements or 1, options.max_elements, options.threshold)
    plan(options, space, options.order, problem.label).check(space)
    work = _Elements(options, announced_once(problem, options.max_realisations))
    refined = uqmbd.refine_elements(
        space, work.compute, limits, label=problem.label, rtol=problem.rtol, affordable=work.affordable
    )
    problem.progress.finish(problem.label)
    kept = [work.done[k] for k in refined.kept]
    for text in dict.fromkeys(text for one in kept for text in one.warned):
        warnings.warn(text, stacklevel=3)
    missed = sum(1 for one in kept if options.verify and not one.verification)
    if missed:
        warnings.warn(
            f"{problem.label}: the verification realisations of {missed} of {len(kept)} elements failed; the stated "
            "error comes from the others.",
            stacklevel=3,
        )
    first = work.done[0]
    warn_of_idle_inputs(first.runs, first.fit, problem.label)
    return problem.node(
        options,
        refined.chaos.statistics(),
        realisations=work.spent,
        wall_time=problem.clock() - begin,
        counters=dict(work.counters),
        children={
            "chaos": refined.chaos.to_dataset(),
            "nodes": _nodes(work, refined.kept),
            "elements": refined.steps,
        },
        attrs={
            "failures": sum(int((one.runs.status != Status.OK).sum()) for one in work.done),
            "fit": f"{len(kept)} elements, each by {first.fit.how}",
            "terms": len(refined.chaos.multi_index),
            "highest_degree": int(refined.chaos.multi_index.max()),
            "nodes": sum(len(np.unique(one.fit.where)) + one.fit.failed for one in kept),
            "verification": sum(one.verification for one in kept),
            "elements": len(kept),
            "elements_computed": refined.computed,
            "threshold_met": str(refined.met),
        },
    )


def _nodes(work: _Elements, kept: tuple[int, ...]) -> xr.Dataset:
    """Return the dataset `nodes`: where realisations were, in which element (-1: one that was replaced), what for."""
    place = {number: k for k, number in enumerate(kept)}
    purposes = []
    for one in work.done:
        own = np.full(len(one.runs), "verification", dtype="<U12")
        own[one.fit.where] = "fit"
        purposes.append(own)
    elements = [np.full(len(one.runs), place.get(k, -1), dtype=np.int64) for k, one in enumerate(work.done)]
    joined = [one.runs for one in work.done]
    data: dict[str, Any] = {
        "inputs": (("node", "input"), np.concatenate([r.values for r in joined])),
        "germs": (("node", "germ"), np.concatenate([r.germs for r in joined])),
        "status": (
            "node",
            np.concatenate([r.status for r in joined]).astype(np.int32),
            {"comment": "0: fine; others as of samples"},
        ),
        "message": ("node", np.array([m for r in joined for m in r.messages], dtype=str)),
        "purpose": ("node", np.concatenate(purposes)),
        "element": ("node", np.concatenate(elements), {"comment": "-1: of an element that was split further"}),
    }
    germs = np.array([str(name) for name in joined[0].space.names])
    return xr.Dataset(data, coords={**work.problem.labels.input_coords(), "germ": germs})
