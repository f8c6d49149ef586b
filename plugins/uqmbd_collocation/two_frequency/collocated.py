"""Collocation of frequencies and amplitudes: of motions that are sums of harmonics of one or two frequencies."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import uqmbd
from uqmbd.extend import QuasiPeriodicElement
from uqmbd.results import QuasiPeriodicChaos, Status
from uqmbd.typing import Array
from uqmbd_collocation.computing import computed
from uqmbd_collocation.expanded import Expanded
from uqmbd_collocation.fitting import Fit
from uqmbd_collocation.plans import Plans
from uqmbd_collocation.record import nodes_of_elements, warn_of_failures
from uqmbd_collocation.refinement import Limits, Refinement, history
from uqmbd_collocation.runs import Runs
from uqmbd_collocation.two_frequency.realised import SeriesProblem

__all__ = ["expand_series"]


@dataclass(frozen=True, eq=False)
class _Fitted:
    """An element."""

    chaos: QuasiPeriodicChaos
    fit: Fit
    runs: Runs
    verified: Runs
    refinement: Refinement | None


@dataclass
class _Elements:
    """All elements that were computed, replaced ones too, in that order."""

    problem: uqmbd.extend.Problem
    plans: Plans
    series: SeriesProblem
    tolerance: Limits
    given: uqmbd.extend.Verification | None = None
    done: list[_Fitted] = field(default_factory=list)

    def compute(self, boxes: Iterable[uqmbd.extend.GermBox]) -> list[QuasiPeriodicChaos]:
        """Fit and verify the elements of some boxes."""
        plans, boxes = self.plans, list(boxes)
        points = plans.points_of_elements(boxes, len(self.done))
        found = [self._fitted(box, own) for box, own in zip(boxes, points, strict=True)]
        self.done += found
        return [one.chaos for one in found]

    def _fitted(self, box: uqmbd.extend.GermBox, points: uqmbd.extend.VerificationPoints) -> _Fitted:
        """Fit an element, and verify it at points by the outputs themselves."""
        problem, local = self.problem, box.local
        verified = Runs(problem, local)
        verification = self.given or verified.verification(points)
        if self.given is not None:
            points = self.given.points
        warn_of_failures(verification, problem.label)
        runs, refined = Runs(self.series, local), self.plans.adaptive != "no"
        if refined:
            runs.scale = self._scale(verification)
        fit, refinement = computed(runs, self.plans, points if refined else points[:0], self.tolerance)
        waves = self.series.split(fit.coefficients)
        chaos = QuasiPeriodicChaos(
            (QuasiPeriodicElement(uqmbd.extend.GermBox.whole(local), **vars(waves)),),
            self.series.lattice,
            float(problem.times[0]),
            fit.multi_index,
            problem.labels,
            **verification.known,
        )
        return _Fitted(chaos, fit, runs, verified, refinement)

    def _scale(self, known: uqmbd.extend.Verification) -> Array:
        """Return what errors of frequencies and outputs (1 + O,) are compared with.

        That of a frequency moves phases at the last time: the output that moves most for its standard deviation counts.
        """
        std = known.std.max(axis=-1, initial=0.0)
        moving = std > 0
        phase = float((std[moving] / self.series.scales[moving]).min(initial=1.0))
        return np.concatenate([[phase / self.series.length], np.where(moving, std, np.inf)])


def expand_series(
    problem: uqmbd.extend.Problem,
    space: uqmbd.extend.GermSpace,
    plans: Plans,
    limits: uqmbd.extend.ElementLimits,
    tolerance: Limits,
    given: uqmbd.extend.Verification | None = None,
) -> Expanded:
    """Find frequencies and harmonics, and expand them; `given` are verification realisations that are known.

    Raise StudyError if motions are no sums of harmonics of one or two frequencies, IntegrationError if failures leave
    too few realisations.
    """
    series = SeriesProblem(problem)
    series.find(space.to_inputs(plans.first_nodes(space)))
    work, children = _Elements(problem, plans, series, tolerance, given), dict[str, Any]()
    if limits.elements is None:
        (chaos,), kept = work.compute([uqmbd.extend.GermBox.whole(space)]), work.done
    else:
        refined = uqmbd.extend.refine_elements(space, work.compute, limits, label=problem.label, rtol=problem.rtol)
        chaos, kept, children = refined.chaos, [work.done[k] for k in refined.kept], {"elements": refined.steps}
    if len(kept) == 1 and kept[0].refinement is not None:
        children["refinement"] = history(kept[0].refinement.steps)
    problem.progress.finish(problem.label)
    verified = [one.verified for one in work.done if len(one.verified)]
    counters = Counter(series.counters)
    for runs in verified:
        counters.update(runs.counters)
    frequencies = sum(e.box.probability * e.frequencies[0] for e in chaos.elements)
    met = [one.refinement is None or one.refinement.met for one in kept]
    return Expanded(
        chaos,
        series.spent + sum(len(runs) for runs in verified),
        counters,
        nodes_of_elements(problem.labels, space.names, [(one.runs, one.verified) for one in work.done]),
        children=children,
        attrs={
            "failures": series.failures + sum(int((runs.status != Status.OK).sum()) for runs in verified),
            "fit": f"frequencies and amplitudes by {kept[0].fit.how}",
            "terms": len(chaos.multi_index),
            "highest_degree": int(chaos.multi_index.max()),
            "elements": len(kept),
            "verification": sum(
                len(one.chaos.verification_germs) for one in kept if one.chaos.verification_germs is not None
            ),
            **{f"frequency_{k + 1}": float(w) for k, w in enumerate(frequencies)},
            "frequency_units": "rad/s",
            "harmonics": len(chaos.lattice),
            "residual": series.residual,
            "longer": series.longer,
            **({} if kept[0].refinement is None else {"tolerance_met": str(all(met))}),
        },
    )
