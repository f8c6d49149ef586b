"""Aligned collocation: realisations are compared at landmarks, and the motion between them is expanded.

Landmarks are events, or equal phases of a clock: their times, and the outputs between them in normalised time, are
smooth in the inputs where outputs at equal times jump, or drift apart.
"""

from __future__ import annotations

import warnings
from collections import Counter
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

import uqmbd
from uqmbd.extend import AlignedElement
from uqmbd.results import AlignedChaos, Status
from uqmbd.typing import Array, Mask
from uqmbd_collocation.alignment.aligned_problem import AlignedProblem
from uqmbd_collocation.alignment.combined_trajectories import CombinedTrajectories
from uqmbd_collocation.alignment.event_trajectories import EventTrajectories
from uqmbd_collocation.alignment.impossible import EndsEarlyWarning
from uqmbd_collocation.alignment.markers import PER_TURN
from uqmbd_collocation.alignment.phase_trajectories import STANDS, PhaseTrajectories
from uqmbd_collocation.alignment.watching import Watching
from uqmbd_collocation.computing import computed
from uqmbd_collocation.element_fits import ElementFits, FittedElement
from uqmbd_collocation.expanded import Expanded
from uqmbd_collocation.plans import Plans
from uqmbd_collocation.record import warn_of_failures
from uqmbd_collocation.refinement import Limits
from uqmbd_collocation.runs import CollocationRuns

__all__ = ["Alignment", "align"]

Alignment = Literal["events", "phase"]
Sequence = tuple[str, ...]
Paths = EventTrajectories | PhaseTrajectories | CombinedTrajectories

SPREAD = 4096
"""Points of the germ space at which the phases that are needed are estimated."""

EXTENSIONS = 6
"""Fits, each to more phases, until all samples of the statistics reach the last time."""

FOLLOWED = 0.15
"""Verification realisations that are followed from event to event besides, over all realisations of an element."""

LATE = 1e-12
"""Part of the times by which the last landmark may miss the last of them."""


@dataclass
class _AlignedElements(ElementFits):
    """Elements between landmarks."""

    source: Paths

    def points(self, boxes: list[uqmbd.extend.GermBox]) -> list[uqmbd.extend.VerificationPoints]:
        """Return the verification points of the next elements: those that are known, where there are some."""
        drawn = super().points(boxes)
        if self.given is None:
            return drawn
        # a refinement cannot do without any
        known = [self.given.points[box.contains(self.given.points.germs)] for box in boxes]
        return [a if len(a) or self.plans.adaptive == "no" else b for a, b in zip(known, drawn, strict=True)]

    def fitted(self, box: uqmbd.extend.GermBox, points: uqmbd.extend.VerificationPoints) -> FittedElement:
        """Fit an element; anew, where realisations that were computed on the way have more events than those before."""
        while True:
            before = self.source.least, self.source.longer
            found = self._fitted_once(box, points)
            if (self.source.least, self.source.longer) == before:
                return found

    def _fitted_once(self, box: uqmbd.extend.GermBox, points: uqmbd.extend.VerificationPoints) -> FittedElement:
        """Fit an element to those of its nodes that have the most frequent sequence; verify it at points."""
        paths, problem, plans, local = self.source, self.problem, self.plans, box.local
        nodes = plans.first_nodes(local)
        sequences = paths.sequences(local.to_inputs(nodes))
        sequence = Counter(sequences).most_common(1)[0][0]
        lost = float(np.mean([other != sequence for other in sequences]))
        watching = Watching(problem, paths)
        verified = CollocationRuns(watching, local)
        verification = self._known(box, points) or verified.verification(points)
        if (elsewhere := watching.elsewhere(sequence)).any():
            share, count = _share(verified, points, elsewhere), len(verification)
            lost = (lost * len(nodes) + count * share) / (len(nodes) + count)
        warn_of_failures(verification, problem.label)
        scale = _scale(verification, problem.times) if plans.adaptive != "no" else None
        spread = uqmbd.extend.monte_carlo_rule(local, SPREAD, 0, "sobol").nodes
        cutting = paths.cutting(local, nodes, spread, sequence)
        for extension in range(EXTENSIONS):
            aligned = AlignedProblem(problem, cutting.cut, len(cutting.labels), paths.points)
            runs = CollocationRuns(aligned, local)
            runs.scale = scale
            with warnings.catch_warnings():
                if lost:
                    # the share of all such nodes is reported at the end
                    warnings.simplefilter("ignore")
                fit, refinement = computed(runs, plans, points if scale is not None else points[:0], self.tolerance)
            edges, nodal = aligned.split(fit.coefficients)
            chaos = AlignedChaos(
                (
                    AlignedElement.through(
                        uqmbd.extend.GermBox.whole(local), cutting.labels, edges, nodal, cutting.landmarks
                    ),
                ),
                fit.multi_index,
                problem.labels,
                **verification.known,
            )
            late = chaos.late()
            if not (late > LATE * np.ptp(problem.times)).any():
                break
            further = None
            if cutting.farther and extension < EXTENSIONS - 1:
                # so many landmarks more as the last of all samples lacks, at the mean pace of the last ones
                pace = max(float(np.diff(edges[0])[-PER_TURN:].mean()), 1e-9 * float(np.ptp(problem.times)))
                further = cutting.farther(float(late.max()), pace)
            if further is None:
                share, since = float(np.mean(late > LATE * np.ptp(problem.times))), problem.times[-1] - late.max()
                warnings.warn(
                    f"{problem.label}: {share:.2g} of the samples do not reach the last output time within the "
                    f"{paths.what} that nodes were followed to; statistics are NaN from t = {since:.6g} s on. Raise "
                    "the order, truncate the inputs, or end earlier.",
                    EndsEarlyWarning,
                    stacklevel=2,
                )
                break
            cutting = further
        chaos = self._with_event_errors(chaos, box, points, len(nodes))
        return FittedElement(chaos, fit, runs, verified, refinement, sequence, lost)

    def _with_event_errors(
        self,
        chaos: AlignedChaos,
        box: uqmbd.extend.GermBox,
        points: uqmbd.extend.VerificationPoints,
        nodes: int,
    ) -> AlignedChaos:
        """Return the chaos of an element with the errors of its event times, from a few verification points.

        These few are followed from event to event besides: at most a fifth of the realisations of the element.
        """
        element = chaos.elements[0]
        events = np.array([bool(label) for label in element.events])
        if isinstance(self.source, PhaseTrajectories) or not events.any() or not len(points):
            return chaos
        paths = self.source.events if isinstance(self.source, CombinedTrajectories) else self.source
        few = points[: min(len(points), max(int(FOLLOWED * (nodes + len(points))), 1))]
        ends = np.full((len(few), len(events)), np.nan)
        ends[:, events] = paths.event_times(box.space.to_inputs(few.germs), tuple(x for x in element.events if x))
        found = element.verified(box.local, chaos.multi_index, few.germs, few.weights, ends)
        return replace(chaos, elements=(found,))

    def _known(
        self, box: uqmbd.extend.GermBox, points: uqmbd.extend.VerificationPoints
    ) -> uqmbd.extend.Verification | None:
        """Return the given realisations in a box, if they are those at some points."""
        if self.given is None or len(points) != (inside := box.contains(self.given.points.germs)).sum():
            return None
        return uqmbd.extend.Verification(box.local, self.given.points[inside], self.given.response[inside], len(points))


def align(
    problem: uqmbd.extend.Problem,
    space: uqmbd.extend.GermSpace,
    plans: Plans,
    paths: Paths,
    limits: uqmbd.extend.ElementLimits,
    tolerance: Limits,
    given: uqmbd.extend.Verification | None = None,
) -> Expanded:
    """Expand the times of markers and the motion between them, in elements where sequences differ or errors are large.

    Raise StudyError if the mechanism has too many events or no clock, IntegrationError if realisations fail.
    """
    paths.prepare(space.to_inputs(plans.first_nodes(space)))
    work, children = _AlignedElements(problem, plans, paths, tolerance, given), dict[str, Any]()
    if limits.elements is None:
        boxes = _boxes(paths, plans, space, limits.most)
        chaos, kept = AlignedChaos.joined(work.compute(boxes), boxes), work.done
    else:
        refined = uqmbd.extend.refine_elements(
            space,
            work.compute,
            limits,
            label=problem.label,
            rtol=problem.rtol,
            lost=lambda number: work.done[number].lost,
        )
        chaos, kept, children = refined.chaos, [work.done[k] for k in refined.kept], {"elements": refined.steps}
    mixed = sum(one.lost * e.box.probability for one, e in zip(kept, chaos.elements, strict=True))
    if mixed > 0:
        warnings.warn(
            f"{problem.label}: after {len(kept)} elements the sequence of {paths.what} still differs within some of "
            f"them; realisations of about {max(mixed, 1e-3):.1%} of the probability are represented by their "
            f"neighbours. {_remedy(limits, len(kept))}.",
            stacklevel=3,
        )
    standing = sum(e.box.probability for one, e in zip(kept, chaos.elements, strict=True) if one.sequence == STANDS)
    if standing > 0 and isinstance(paths, PhaseTrajectories):
        warnings.warn(paths.of_standing(standing, [one.sequence for one in kept]), stacklevel=3)
    return work.expanded(
        chaos,
        kept,
        f"{paths.landmarks} and segments",
        work.verified_counters + paths.counters,
        children,
        {
            "segments": max(len(e.events) for e in chaos.elements),
            "mixed": float(mixed),
            **({"standing": float(standing)} if isinstance(paths, PhaseTrajectories) else {}),
            **paths.attributes([one.sequence for one in kept]),
        },
    )


def _remedy(limits: uqmbd.extend.ElementLimits, count: int) -> str:
    """Return advice on smaller elements for different sequences."""
    if limits.elements is None:
        return "Raise max_elements" if count >= limits.most else "Give elements='adaptive', which splits by the error"
    return "Raise max_elements" if limits.adaptive else "Raise elements"


def _share(runs: CollocationRuns, points: uqmbd.extend.VerificationPoints, which: Mask) -> float:
    """Return the share, by the weights of points (V,), that realisations without failure represent."""
    where = runs.at(points.germs)
    good = np.flatnonzero(runs.good(where))
    place = np.cumsum(runs.status == Status.OK) - 1
    return points[good].share(which[place[where[good]]])


def _boxes(paths: Paths, plans: Plans, space: uqmbd.extend.GermSpace, most: int) -> list[uqmbd.extend.GermBox]:
    """Split the germ space until the nodes of each box have the same sequence, or there are enough boxes."""
    boxes, done = [uqmbd.extend.GermBox.whole(space)], list[uqmbd.extend.GermBox]()
    while boxes:
        box = boxes.pop(0)
        nodes = plans.first_nodes(box.local)
        sequences = paths.sequences(space.to_inputs(nodes))
        room = len(done) + len(boxes) + 2 <= most
        if len(set(sequences)) > 1 and room and (germ := _guilty(box, nodes, sequences)) is not None:
            boxes += box.split(germ)
        else:
            done.append(box)
    return done


def _scale(known: uqmbd.extend.Verification, times: Array) -> Array:
    """Return the scales of errors of the time and of the outputs (1 + O,).

    An error of the time is that of the output which moves fastest for its standard deviation.
    """
    std = known.std.max(axis=-1, initial=0.0)
    rate = np.abs(np.gradient(known.response, times, axis=-1)).max(axis=(0, 2), initial=0.0)
    moving = (std > 0) & (rate > 0)
    tick = (std[moving] / rate[moving]).min(initial=float(times[-1] - times[0]))
    return np.concatenate([[tick], np.where(std > 0, std, np.inf)])


def _guilty(box: uqmbd.extend.GermBox, nodes: Array, sequences: list[Sequence]) -> int | None:
    """Germ along which a split separates the sequences best."""
    best, germ = np.inf, None
    for k in range(nodes.shape[1]):
        if not box.divisible(k):
            continue
        lower, _ = box.split(k)
        below = nodes[:, k] <= lower.upper[k]
        mixed = 0.0
        for side in (below, ~below):
            counts = Counter(s for s, inside in zip(sequences, side, strict=True) if inside)
            total = sum(counts.values())
            mixed += total - max(counts.values(), default=0)
        if mixed < best:
            best, germ = mixed, k
    return germ
