"""Aligned collocation: expansion of marker times, and of the motion between markers.

Markers are events, or equal phases of a clock. The times of markers, and the outputs between markers in normalised
time, are smooth functions of the inputs. At equal times, in contrast, outputs are discontinuous in the inputs, or their
phases drift apart.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Collection
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

__all__ = ["Alignment", "align", "followed", "with_event_errors"]

Alignment = Literal["events", "phase"]
Sequence = tuple[str, ...]
Paths = EventTrajectories | PhaseTrajectories | CombinedTrajectories

SPREAD = 4096
"""Number of points of the germ space at which the required phases are estimated."""

EXTENSIONS = 6
"""Largest number of fits, each with more markers, until all samples of the statistics reach the last time."""

FOLLOWED = 0.15
"""Initial number of verification realisations that are integrated from event to event, over the number of
realisations."""

LATE = 1e-12
"""Largest distance of the last marker from the last output time, relative to the range of times."""


@dataclass
class _AlignedElements(ElementFits):
    """Elements with segments between markers."""

    source: Paths

    def points(self, boxes: list[uqmbd.extend.GermBox]) -> list[uqmbd.extend.VerificationPoints]:
        """Return the verification points of the next elements; given verification points replace random points."""
        drawn = super().points(boxes)
        if self.given is None:
            return drawn
        # a refinement needs at least one verification point in each box
        known = [self.given.points[box.contains(self.given.points.germs)] for box in boxes]
        return [a if len(a) or self.plans.adaptive == "no" else b for a, b in zip(known, drawn, strict=True)]

    def fitted(self, box: uqmbd.extend.GermBox, points: uqmbd.extend.VerificationPoints) -> FittedElement:
        """Return the fit of an element; repeat the fit if new realisations have more events than earlier ones."""
        while True:
            before = self.source.least, self.source.longer
            found = self._fitted_once(box, points)
            if (self.source.least, self.source.longer) == before:
                return found

    def _fitted_once(self, box: uqmbd.extend.GermBox, points: uqmbd.extend.VerificationPoints) -> FittedElement:
        """Fit an element to its nodes with the most frequent sequence, and verify the fit at `points`."""
        paths, problem, plans, local = self.source, self.problem, self.plans, box.local
        nodes = plans.first_nodes(local)
        sequences = paths.sequences(local.to_inputs(nodes))
        sequence = Counter(sequences).most_common(1)[0][0]
        lost = float(np.mean([other != sequence for other in sequences]))
        watching = Watching(problem, paths)
        verified = CollocationRuns(watching, local)
        verification = self._given_in(box, points) or verified.verification(points)
        if (elsewhere := watching.elsewhere(sequence)).any():
            share, count = _weighted_share(verified, points, elsewhere), len(verification)
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
                    # a warning at the end of the run states the share of all such nodes
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
                # add the number of markers that the latest sample needs, at the mean rate of the last markers
                pace = max(float(np.diff(edges[0])[-PER_TURN:].mean()), 1e-9 * float(np.ptp(problem.times)))
                further = cutting.farther(float(late.max()), pace)
            if further is None:
                share, since = float(np.mean(late > LATE * np.ptp(problem.times))), problem.times[-1] - late.max()
                warnings.warn(
                    f"{problem.label}: a share of {share:.2g} of the samples does not reach the last output time "
                    f"within the {paths.what} that the integrated nodes have. Statistics are NaN from t = {since:.6g} "
                    "s on. Raise the order, truncate the distributions, or use an earlier last output time.",
                    EndsEarlyWarning,
                    stacklevel=2,
                )
                break
            cutting = further
        chaos = with_event_errors(
            chaos, box, paths, points, len(nodes), plans.max_realisations - self.spent - len(points)
        )
        return FittedElement(chaos, fit, runs, verified, refinement, sequence, lost)

    def further(self, chaos: AlignedChaos, kept: Collection[int]) -> list[AlignedChaos]:
        """Verify elements, given by their indices, at additional points in regions of large errors."""
        if self.given is None and len(kept) > 1 and chaos.verification_germs is not None:
            for k, own in zip(kept, self.plans.further(chaos, self.spent), strict=True):
                if len(own):
                    self.done[k] = _verified(self.done[k], own, self.problem.label)
        return [self.done[k].chaos for k in kept]

    @property
    def spent(self) -> int:
        """Number of realisations so far."""
        return int(self.source.spent + sum(len(one.verified) for one in self.done))

    def _given_in(
        self, box: uqmbd.extend.GermBox, points: uqmbd.extend.VerificationPoints
    ) -> uqmbd.extend.Verification | None:
        """Return given verification realisations in a box; None unless there is one for each of `points`."""
        if self.given is None or len(points) != (inside := box.contains(self.given.points.germs)).sum():
            return None
        return uqmbd.extend.Verification(box.local, self.given.points[inside], self.given.response[inside], len(points))


def with_event_errors(
    chaos: AlignedChaos,
    box: uqmbd.extend.GermBox,
    source: Paths,
    points: uqmbd.extend.VerificationPoints,
    nodes: int,
    room: int,
) -> AlignedChaos:
    """Return the chaos of an element with the errors of its event times, from a few verification points.

    Some verification realisations are also integrated from event to event. Their number is initially 15 % of the
    realisations of the element. If none of them has an error of the event times, more are integrated, up to `room`
    realisations.
    """
    element = chaos.elements[0]
    events = np.array([bool(label) for label in element.events])
    if isinstance(source, PhaseTrajectories) or not events.any() or not len(points):
        return chaos
    paths = source.events if isinstance(source, CombinedTrajectories) else source
    found, room = element, max(room, 1)
    for count in range(min(followed(nodes, len(points)), room), min(len(points), room) + 1):
        few = points[:count]
        ends = np.full((count, len(events)), np.nan)
        ends[:, events] = paths.event_times(box.space.to_inputs(few.germs), tuple(x for x in element.events if x))
        found = element.verified(box.local, chaos.multi_index, few.germs, few.weights, ends)
        # realisations with another sequence of events have no error of the event times
        if not np.isnan(np.array(found.event_errors)[events]).all():
            break
    return replace(chaos, elements=(found,))


def followed(nodes: int, verify: int) -> int:
    """Return the initial number of verification realisations that are integrated from event to event."""
    return min(verify, max(int(FOLLOWED * (nodes + verify)), 1))


def align(
    problem: uqmbd.extend.Problem,
    space: uqmbd.extend.GermSpace,
    plans: Plans,
    paths: Paths,
    limits: uqmbd.extend.ElementLimits,
    tolerance: Limits,
    given: uqmbd.extend.Verification | None = None,
) -> Expanded:
    """Expand marker times and the motion between markers; split elements by sequences and errors.

    Raise StudyError if the mechanism has too many events or no clock, and IntegrationError if realisations fail.
    """
    paths.prepare(space.to_inputs(plans.first_nodes(space)))
    work, children = _AlignedElements(problem, plans, paths, tolerance, given), dict[str, Any]()
    if limits.elements is None:
        boxes = _boxes(paths, plans, space, limits.most)
        chaos = AlignedChaos.joined(work.compute(boxes), boxes)
        chaos, kept = AlignedChaos.joined(work.further(chaos, range(len(boxes))), boxes), work.done
    else:
        refined = uqmbd.extend.refine_elements(
            space,
            work.compute,
            limits,
            label=problem.label,
            rtol=problem.rtol,
            lost=lambda number: work.done[number].lost,
            further=work.further,
        )
        chaos, kept, children = refined.chaos, [work.done[k] for k in refined.kept], {"elements": refined.steps}
    mixed = sum(one.lost * e.box.probability for one, e in zip(kept, chaos.elements, strict=True))
    if mixed > 0:
        warnings.warn(
            f"{problem.label}: in some of the {len(kept)} elements, realisations have different sequences of "
            f"{paths.what}. Realisations with another sequence than their element have a probability of about "
            f"{max(mixed, 1e-3):.1%}. {_remedy(limits, len(kept))}.",
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


def _verified(element: FittedElement, points: uqmbd.extend.VerificationPoints, label: str) -> FittedElement:
    """Return an element with additional verification realisations; warn of failed realisations."""
    chaos, known = element.chaos, uqmbd.extend.VerificationPoints
    before = known(chaos.verification_germs, len(chaos.verification_germs) * chaos.verification_weights)
    first = uqmbd.extend.Verification(chaos.space, before, chaos.verification_response, len(before))
    more = element.verified.verification(points)
    warn_of_failures(more, label)
    both = first.joined(more)
    return replace(element, chaos=replace(chaos, **both.known))


def _remedy(limits: uqmbd.extend.ElementLimits, count: int) -> str:
    """Return advice on how to obtain smaller elements if sequences differ."""
    if limits.elements is None:
        return (
            "Raise max_elements"
            if count >= limits.most
            else "Use elements='adaptive', which splits elements by their errors"
        )
    return "Raise max_elements" if limits.adaptive else "Raise elements"


def _weighted_share(runs: CollocationRuns, points: uqmbd.extend.VerificationPoints, which: Mask) -> float:
    """Return the share of successful realisations with a property, weighted by the weights of the points (V,)."""
    where = runs.at(points.germs)
    good = np.flatnonzero(runs.good(where))
    place = np.cumsum(runs.status == Status.OK) - 1
    return points[good].share(which[place[where[good]]])


def _boxes(paths: Paths, plans: Plans, space: uqmbd.extend.GermSpace, most: int) -> list[uqmbd.extend.GermBox]:
    """Split the germ space until all nodes of each box have the same sequence, or until there are `most` boxes."""
    boxes, done = [uqmbd.extend.GermBox.whole(space)], list[uqmbd.extend.GermBox]()
    while boxes:
        box = boxes.pop(0)
        nodes = plans.first_nodes(box.local)
        sequences = paths.sequences(space.to_inputs(nodes))
        room = len(done) + len(boxes) + 2 <= most
        if len(set(sequences)) > 1 and room and (germ := _split_index(box, nodes, sequences)) is not None:
            boxes += box.split(germ)
        else:
            done.append(box)
    return done


def _scale(known: uqmbd.extend.Verification, times: Array) -> Array:
    """Return the scales (1 + O,) of the errors of time and outputs.

    The scale of an output is its largest standard deviation over time, or infinity if that is 0. An error of marker
    times equal to the scale of the time changes no output by more than its scale: it is the smallest ratio of standard
    deviation to largest rate.
    """
    std = known.std.max(axis=-1, initial=0.0)
    rate = np.abs(np.gradient(known.response, times, axis=-1)).max(axis=(0, 2), initial=0.0)
    moving = (std > 0) & (rate > 0)
    tick = (std[moving] / rate[moving]).min(initial=float(times[-1] - times[0]))
    return np.concatenate([[tick], np.where(std > 0, std, np.inf)])


def _split_index(box: uqmbd.extend.GermBox, nodes: Array, sequences: list[Sequence]) -> int | None:
    """Return the index of the germ along which a split separates the sequences best."""
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
