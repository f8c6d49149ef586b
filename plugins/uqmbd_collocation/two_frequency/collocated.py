"""Collocation of frequencies and amplitudes of motions that are sums of harmonics of one or two frequencies."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import uqmbd
from uqmbd.extend import QuasiPeriodicElement
from uqmbd.results import QuasiPeriodicChaos
from uqmbd.typing import Array
from uqmbd_collocation.computing import computed
from uqmbd_collocation.element_fits import ElementFits, FittedElement
from uqmbd_collocation.expanded import Expanded
from uqmbd_collocation.plans import Plans
from uqmbd_collocation.record import warn_of_failures
from uqmbd_collocation.refinement import Limits
from uqmbd_collocation.runs import CollocationRuns
from uqmbd_collocation.two_frequency.realised import SeriesProblem

__all__ = ["expand_series"]


@dataclass
class _TwoFrequencyElements(ElementFits):
    """Elements of harmonic series."""

    source: SeriesProblem

    def fitted(self, box: uqmbd.extend.GermBox, points: uqmbd.extend.VerificationPoints) -> FittedElement:
        """Return the fit of an element, verified by the outputs at `points`."""
        problem, local = self.problem, box.local
        verified = CollocationRuns(problem, local)
        verification = self.given or verified.verification(points)
        if self.given is not None:
            points = self.given.points
        warn_of_failures(verification, problem.label)
        runs, refined = CollocationRuns(self.source, local), self.plans.adaptive != "no"
        if refined:
            runs.scale = self._scale(verification)
        fit, refinement = computed(runs, self.plans, points if refined else points[:0], self.tolerance)
        waves = self.source.split(fit.coefficients)
        chaos = QuasiPeriodicChaos(
            (QuasiPeriodicElement(uqmbd.extend.GermBox.whole(local), **vars(waves)),),
            self.source.lattice,
            float(problem.times[0]),
            fit.multi_index,
            problem.labels,
            **verification.known,
        )
        return FittedElement(chaos, fit, runs, verified, refinement)

    def _scale(self, known: uqmbd.extend.Verification) -> Array:
        """Return the scales of errors of frequencies, rad/s, and outputs (1 + O,).

        The scale of an output is its largest standard deviation over time, or infinity if that is 0. The scale of the
        frequencies is the frequency error that gives a limiting phase error in rad at the last time. The limiting phase
        error is the smallest ratio of standard deviation to root mean square of an output, at most 1.
        """
        std = known.std.max(axis=-1, initial=0.0)
        moving = std > 0
        phase = float((std[moving] / self.source.scales[moving]).min(initial=1.0))
        return np.concatenate([[phase / self.source.length], np.where(moving, std, np.inf)])


def expand_series(
    problem: uqmbd.extend.Problem,
    space: uqmbd.extend.GermSpace,
    plans: Plans,
    limits: uqmbd.extend.ElementLimits,
    tolerance: Limits,
    given: uqmbd.extend.Verification | None = None,
    known: Callable[[Array], uqmbd.extend.Dense | None] = lambda _: None,
) -> Expanded:
    """Find frequencies and harmonics, and expand them; `given`: available verification realisations.

    `known`: function that returns available realisations at inputs (K, d), with observed quantities.

    Raise StudyError if motions are not sums of harmonics of one or two frequencies, and IntegrationError if too few
    realisations succeed.
    """
    series = SeriesProblem(problem, computed_before=known)
    series.find(space.to_inputs(plans.first_nodes(space)))
    work, children = _TwoFrequencyElements(problem, plans, series, tolerance, given), dict[str, Any]()
    if limits.elements is None:
        (chaos,), kept = work.compute([uqmbd.extend.GermBox.whole(space)]), work.done
    else:
        refined = uqmbd.extend.refine_elements(space, work.compute, limits, label=problem.label, rtol=problem.rtol)
        chaos, kept, children = refined.chaos, [work.done[k] for k in refined.kept], {"elements": refined.steps}
    counters = Counter(series.counters)
    counters.update(work.verified_counters)
    frequencies = sum(e.box.probability * e.frequencies[0] for e in chaos.elements)
    return work.expanded(
        chaos,
        kept,
        "frequencies and amplitudes",
        counters,
        children,
        {
            **{f"frequency_{k + 1}": float(w) for k, w in enumerate(frequencies)},
            "frequency_units": "rad/s",
            "harmonics": len(chaos.lattice),
            "residual": series.residual,
            "longer": series.longer,
        },
    )
