"""Importance sampling on real realisations: a proposal is adapted by pilots, then frozen for the samples that count."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uqmbd.typing import Array, Index
from uqmbd_reliability.ledger import LimitStateLedger
from uqmbd_reliability.mixtures import WeightedMixture
from uqmbd_reliability.proposals import Proposal, Region, adapted, around_points, proposal

__all__ = ["Sampled", "adapt", "coefficients", "sample"]


PILOT = 150
"""Samples of each round of adaptation."""

ROUNDS = 4
ENOUGH = 1.6
"""Coefficient of variation of a single sample from which more pilots do not pay."""

REPAIRS = 3
BATCH = 100
LARGEST = 0.05
"""Share of one sample in the estimate from which a region is taken to be missed by the proposal."""


@dataclass(frozen=True, eq=False)
class Sampled:
    """Samples of the estimates, all from one proposal."""

    points: Array  # (N, d) in the standard normal space
    ratio: Array  # (N,) standard normal density over that of the proposal
    margins: Array  # (N, requirement); NaN where a realisation failed
    rows: Index  # (N,) indices in the ledger

    @property
    def failures(self) -> Array:
        """Weights of realisations that failed, shape (N,)."""
        return np.asarray(np.where(np.isnan(self.margins[:, 0]), self.ratio, 0.0))


def coefficients(weights: Array) -> Array:
    """Return the coefficient of variation of the mean of weights (N, requirement); infinite where all are zero."""
    mean = weights.mean(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = weights.std(axis=0, ddof=1) / (mean * np.sqrt(len(weights)))
    return np.where(mean > 0, found, np.inf)


def adapt(ledger: LimitStateLedger, begin: Proposal, requirements: int, generator: np.random.Generator) -> Proposal:
    """Sample pilots, and adapt the proposal to the violations of all of them.

    It ends as soon as a pilot is so good that better ones would not pay for themselves.
    """
    current = begin
    used: list[WeightedMixture] = []
    points, margins = np.zeros((0, ledger.dimension)), np.zeros((0, requirements))
    for _ in range(ROUNDS):
        if ledger.left < 3 * PILOT:
            break
        more = current.mixture.sample(PILOT, generator)
        found = ledger(more)
        used.append(current.mixture)
        points, margins = np.concatenate([points, more]), np.concatenate([margins, found])
        variance = PILOT * coefficients(_weights(current.mixture.ratio(more), found)).max() ** 2
        # each requirement has its part of the samples only
        good = variance + 1.0 < (ENOUGH**2 + 1.0) * requirements
        # all pilots are samples of the mixture of their proposals
        ratio = 1.0 / np.mean([1.0 / mixture.ratio(points) for mixture in used], axis=0)
        if not good:
            current = proposal(
                [*current.regions, *_missed(points, ratio, margins, current.regions, 3)], None, ledger.dimension
            )
        current = adapted(current, points, _weights(ratio, margins))
        if good:
            break
    return current


def sample(
    ledger: LimitStateLedger, begin: Proposal, requirements: int, target: float, generator: np.random.Generator
) -> tuple[Proposal, Sampled]:
    """Sample until all requirements have the coefficient of variation that is wanted, or the ledger is full.

    Where a single sample makes up a large part of an estimate, the proposal has missed a region: it is given one there,
    and sampling begins again, while there is room for it.
    """
    current, repairs = begin, 0
    while True:
        first, points, margins = ledger.count, np.zeros((0, ledger.dimension)), np.zeros((0, requirements))
        missed: list[Region] = []
        while (size := _next_batch(current.mixture.ratio(points), margins, target, ledger.left)) > 0:
            more = current.mixture.sample(size, generator)
            margins, points = np.concatenate([margins, ledger(more)]), np.concatenate([points, more])
            if repairs < REPAIRS and ledger.left > 4 * BATCH:
                missed = _missed(points, current.mixture.ratio(points), margins, current.regions, 1)
                if missed:
                    break
        ratio = current.mixture.ratio(points)
        if not missed:
            return current, Sampled(points, ratio, margins, first + np.arange(len(points)))
        repairs += 1
        current = proposal([*current.regions, *missed], None, ledger.dimension)
        current = adapted(current, points, _weights(ratio, margins))


def _weights(ratio: Array, margins: Array) -> Array:
    return np.asarray(np.where(margins < 0, ratio[:, None], 0.0))


def _next_batch(ratio: Array, margins: Array, target: float, left: int) -> int:
    if len(ratio) < 2 * BATCH:
        return min(BATCH, left)
    found = coefficients(_weights(ratio, margins))
    seen = np.isfinite(found)
    needed = len(ratio) * ((found[seen].max() / target) ** 2 - 1.0) if seen.any() else np.inf
    return int(min(np.clip(needed, 0.25 * BATCH, 2 * BATCH), left)) if needed > 0 else 0


def _missed(points: Array, ratio: Array, margins: Array, regions: Sequence[Region], most: int) -> list[Region]:
    """Return new regions at violations that weigh much and lie outside all that are aimed at."""
    dimension = points.shape[1]
    around = 0.3 * np.vstack([np.eye(dimension), -np.eye(dimension)])
    found: list[Region] = []
    for k in range(margins.shape[1]):
        weights = np.where(margins[:, k] < 0, ratio, 0.0)
        for place in np.argsort(-weights, kind="stable")[:most]:
            aimed = [r.blunt.mean for r in [*regions, *found] if r.requirement == k and r.direction is not None]
            square = min((float((points[place] - mean) @ (points[place] - mean)) for mean in aimed), default=np.inf)
            if weights[place] > LARGEST * weights.sum() and square > dimension + np.sqrt(2 * dimension):
                found.append(around_points(points[place] + around, k, float(np.log(weights[place] / len(points)))))
    return found
