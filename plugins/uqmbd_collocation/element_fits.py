"""Elements with fits of markers or of harmonics, instead of outputs at equal times."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import uqmbd
from uqmbd.results import AlignedChaos, QuasiPeriodicChaos, Status
from uqmbd_collocation.expanded import Expanded
from uqmbd_collocation.fitting import Fit
from uqmbd_collocation.plans import Plans
from uqmbd_collocation.record import nodes_of_elements
from uqmbd_collocation.refinement import Limits, Refinement, history
from uqmbd_collocation.runs import CollocationRuns

__all__ = ["ElementFits", "FittedElement"]


@dataclass(frozen=True, eq=False)
class FittedElement:
    """Element with its realisations."""

    chaos: Any
    fit: Fit
    runs: CollocationRuns
    verified: CollocationRuns
    refinement: Refinement | None
    sequence: tuple[str, ...] = ()
    lost: float = 0.0
    """Share of the element's nodes and verification realisations that have another sequence of markers."""

    @property
    def met(self) -> bool:
        """Whether the refinement of the element met the tolerance; true without a refinement."""
        return self.refinement is None or self.refinement.met


@dataclass
class ElementFits(ABC):
    """All computed elements in order of computation, including replaced ones."""

    problem: uqmbd.extend.Problem
    plans: Plans
    source: Any  # integrates realisations; has the counts `spent`, `failures` and `counters`
    tolerance: Limits
    given: uqmbd.extend.Verification | None = None  # verification realisations; None: separate for each element
    done: list[FittedElement] = field(default_factory=list)

    @abstractmethod
    def fitted(self, box: uqmbd.extend.GermBox, points: uqmbd.extend.VerificationPoints) -> FittedElement:
        """Return the fit of an element, with its verification at points."""

    def points(self, boxes: list[uqmbd.extend.GermBox]) -> list[uqmbd.extend.VerificationPoints]:
        """Return the verification points of the next elements."""
        return self.plans.points_of_elements(boxes, len(self.done))

    def compute(self, boxes: Iterable[uqmbd.extend.GermBox]) -> list[Any]:
        """Return fitted and verified elements for given boxes."""
        boxes = list(boxes)
        found = [self.fitted(box, own) for box, own in zip(boxes, self.points(boxes), strict=True)]
        self.done += found
        return [one.chaos for one in found]

    @property
    def verified_counters(self) -> Counter[str]:
        """Counters of the solver, summed over all verification realisations."""
        found = Counter[str]()
        for one in self.done:
            found.update(one.verified.counters)
        return found

    def expanded(
        self,
        chaos: AlignedChaos | QuasiPeriodicChaos,
        kept: Sequence[FittedElement],
        fitted: str,
        counters: Counter[str],
        children: Mapping[str, Any],
        attrs: Mapping[str, Any],
    ) -> Expanded:
        """Return the surrogate of the retained elements, with all data of its node; `fitted`: the fitted quantity."""
        if len(kept) == 1 and kept[0].refinement is not None:
            children = {**children, "refinement": history(kept[0].refinement.steps)}
        self.problem.progress.finish(self.problem.label)
        verified = [one.verified for one in self.done if len(one.verified)]
        known = [one.chaos.verification_germs for one in kept if one.chaos.verification_germs is not None]
        return Expanded(
            chaos,
            self.source.spent + sum(len(runs) for runs in verified),
            counters,
            nodes_of_elements(self.problem.labels, chaos.space.names, [(one.runs, one.verified) for one in self.done]),
            children=children,
            attrs={
                "failures": self.source.failures + sum(int((runs.status != Status.OK).sum()) for runs in verified),
                "fit": f"{fitted} by {kept[0].fit.how}",
                "terms": len(chaos.multi_index),
                "highest_degree": int(np.max(chaos.multi_index)),
                "elements": len(kept),
                "verification": sum(map(len, known)),
                **attrs,
                **({} if kept[0].refinement is None else {"tolerance_met": str(all(one.met for one in kept))}),
            },
        )
