"""Event-aligned collocation: realisations are followed from event to event, and what lies between is expanded."""

from __future__ import annotations

import warnings
from collections import Counter
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import AlignedChaos, AlignedElement, Status
from uqmbd.typing import Array, Index
from uqmbd_collocation.plans import Plans
from uqmbd_collocation.record import nodes_of, warn_of_failures
from uqmbd_collocation.runs import Runs

__all__ = ["align_with_events"]


POINTS = 65
"""Chebyshev points of a segment."""
NOISE = 1e-10
"""Size of a coefficient in time, over the largest one of its output, that is rounding."""

MOST_SEGMENTS = 60
"""Segments of a realisation beyond which a motion is not followed: bounces that die down have no end."""


@dataclass
class _Followed:
    """Realisations that were followed from event to event, each once."""

    problem: uqmbd.Problem
    space: uqmbd.GermSpace
    least: int = 1
    spent: int = 0
    known: dict[bytes, uqmbd.History] = field(default_factory=dict)

    def at(self, germs: Array) -> list[uqmbd.History]:
        """Histories at germ points (K, d), with at least as many segments as any has within the output times."""
        while True:
            missing = [k for k, row in enumerate(germs) if not self._enough(self.known.get(row.tobytes()))]
            if missing:
                new = germs[missing]
                self.problem.progress.start(self.problem.label, self.spent + len(new))
                found = self.problem.histories(self.space.to_inputs(new), POINTS, self.least)
                self.spent += len(new)
                for row, history in zip(new, found, strict=True):
                    self.known[row.tobytes()] = history
                    self.problem.progress.advance(self.problem.label, 1)
            wanted = 1 + max((h.inside for h in self.known.values()), default=1)
            if wanted > MOST_SEGMENTS:
                raise uqmbd.StudyError(
                    f"{self.problem.label}: a realisation has {wanted - 1} segments between events until the last "
                    f"output time, more than {MOST_SEGMENTS}: bounces die down. End before that, or use elements."
                )
            if wanted <= self.least and not missing:
                break
            self.least = max(wanted, self.least)
        return [self.known[row.tobytes()] for row in germs]

    def _enough(self, history: uqmbd.History | None) -> bool:
        return history is not None and (bool(history.message) or len(history.labels) >= self.least or history.final)


def align_with_events(
    propagator: uqmbd.Propagator, problem: uqmbd.Problem, space: uqmbd.GermSpace, plans: Plans, most: int
) -> xr.DataTree:
    """Expand event times and the motion between events; split the germ space where sequences of events differ.

    Raises
    ------
    uqmbd.StudyError
        If the mechanism has no events, or too many.
    uqmbd.IntegrationError
        If realisations fail.
    """
    begin = problem.clock()
    if not problem.model.events:
        raise uqmbd.StudyError(
            f"{problem.label}: alignment='events' needs a mechanism with events, as the impacts of uqmbd_contact; "
            f"mechanism {problem.mechanism!r} has none. Leave alignment out."
        )
    followed = _Followed(problem, space)
    terms = uqmbd.index_set(space.dimension, plans.order, plans.index_set, plans.weights)
    boxes = [uqmbd.GermBox.whole(space)]
    done: list[tuple[uqmbd.GermBox, Array, Array]] = []
    mixed = 0.0
    while boxes:
        box = boxes.pop(0)
        quadrature = uqmbd.gauss_tensor(box.local, plans.order + 1)
        sequences = [_sequence(problem, h, followed.least) for h in followed.at(quadrature.nodes)]
        if len(set(sequences)) == 1:
            done.append((box, quadrature.nodes, quadrature.weights))
        elif len(done) + len(boxes) + 2 <= most and (germ := _guilty(box, quadrature.nodes, sequences)) is not None:
            boxes += box.split(germ)
        else:
            done.append((box, quadrature.nodes, quadrature.weights))
    elements = []
    for box, nodes, weights in done:
        element, lost = _element(box, nodes, weights, followed, terms, problem)
        elements.append(element)
        mixed += lost * box.probability
    points, verified = plans.verification_points(space), Runs(problem, space)
    verification = verified.verification(points)
    warn_of_failures(verification, problem.label)
    known = len(verification.germs) > 0
    chaos = AlignedChaos(
        tuple(elements),
        terms,
        problem.labels,
        verification_germs=verification.germs if known else None,
        verification_response=verification.response if known else None,
    )
    if mixed > 0:
        warnings.warn(
            f"{problem.label}: after {len(elements)} elements the sequence of events still differs within some of "
            f"them; realisations of about {mixed:.1%} of the probability are represented by their neighbours. Raise "
            "max_elements.",
            stacklevel=3,
        )
    problem.progress.finish(problem.label)
    return problem.node(
        propagator,
        chaos.statistics(),
        realisations=followed.spent + len(points),
        wall_time=problem.clock() - begin,
        counters=dict(verified.counters),
        children={"aligned": chaos.to_dataset(), "nodes": _nodes(followed, verified)},
        attrs={
            # a realisation that fails while it is followed ends the method
            "failures": int((verified.status != Status.OK).sum()) if len(points) else 0,
            "fit": f"event times and segments by projection with {plans.order + 1} Gauss nodes per input",
            "terms": len(terms),
            "highest_degree": int(terms.max()),
            "elements": len(elements),
            "segments": max(len(e.events) for e in elements),
            "verification": len(verification.germs),
            "mixed": mixed,
        },
    )


def _nodes(followed: _Followed, verified: Runs) -> xr.Dataset:
    """Return the dataset `nodes`: those that were followed, and those of the verification."""
    germs = np.array([np.frombuffer(key) for key in followed.known])
    status, messages, purpose = np.zeros(len(germs), dtype=np.int64), [""] * len(germs), ["fit"] * len(germs)
    if len(verified):
        germs, status = np.concatenate([germs, verified.germs]), np.concatenate([status, verified.status])
        messages += verified.messages
        purpose += ["verification"] * len(verified)
    space = followed.space
    about = (followed.problem.labels, space.names, space.to_inputs(germs), germs, status, messages)
    return nodes_of(*about, np.array(purpose, dtype=str))


def _sequence(problem: uqmbd.Problem, history: uqmbd.History, least: int) -> tuple[str, ...]:
    if history.message:
        raise uqmbd.IntegrationError(f"{problem.label}: a realisation failed: {history.message}")
    return history.labels[:least]


def _guilty(box: uqmbd.GermBox, nodes: Array, sequences: list[tuple[str, ...]]) -> int | None:
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


def _in_time(nodal: Array) -> Array:
    """Chebyshev coefficients of values (..., P) at the points of a segment, without those that are rounding."""
    count = nodal.shape[-1]
    vander = np.polynomial.chebyshev.chebvander(-np.cos(np.pi * np.arange(count) / (count - 1)), count - 1)
    found = nodal @ np.linalg.inv(vander).T
    size = np.abs(found).max(axis=(0, 1, 3), keepdims=True)
    large = np.flatnonzero((np.abs(found) > NOISE * size).any(axis=(0, 1, 2)))
    kept: Array = found[..., : int(large[-1]) + 1 if len(large) else 1]
    return kept


def _element(
    box: uqmbd.GermBox, nodes: Array, weights: Array, followed: _Followed, terms: Index, problem: uqmbd.Problem
) -> tuple[AlignedElement, float]:
    """Project event times and segments; and the share of nodes whose sequence is another one."""
    histories = followed.at(nodes)
    sequences = [_sequence(problem, h, followed.least) for h in histories]
    chosen = Counter(sequences).most_common(1)[0][0]
    same = np.array([s == chosen for s in sequences])
    count = len(chosen)
    kept = [h for h, ok in zip(histories, same, strict=True) if ok]
    edges = np.array([h.edges[: count + 1] for h in kept])
    segments = np.array([h.response[:count] for h in kept])
    psi = box.local.evaluate(nodes[same], terms)
    if same.all():
        adjoint = (psi * weights[:, None]).T
    else:
        usable = terms.sum(axis=1) <= max(0, int(np.sqrt(same.sum())) - 1)
        adjoint = np.zeros(psi.T.shape)
        adjoint[usable] = np.linalg.pinv(psi[:, usable])
    found = AlignedElement(box, chosen, adjoint @ edges, _in_time(np.tensordot(adjoint, segments, axes=1)))
    return found, float(np.mean(~same))
