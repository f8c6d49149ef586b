"""Importance sampling with realisations: pilots adapt a proposal, which is then fixed for the estimates."""

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
"""Number of samples of each round of adaptation."""

ROUNDS = 4
ENOUGH = 1.6
"""Coefficient of variation of a single sample below which more pilots are not worth their cost."""

REPAIRS = 3
BATCH = 100
LARGEST = 0.05
"""Largest share of one sample in an estimate; a larger share indicates that the proposal misses a region."""


@dataclass(frozen=True, eq=False)
class Sampled:
    """Samples of the estimates, all from one proposal."""

    points: Array  # (N, d) in the standard normal space
    ratio: Array  # (N,) ratio of the standard normal density to the density of the proposal
    margins: Array  # (N, requirement); NaN for failed realisations
    rows: Index  # (N,) indices in the ledger

    @property
    def failures(self) -> Array:
        """Weights of failed realisations, shape (N,); zero for the others."""
        return np.asarray(np.where(np.isnan(self.margins[:, 0]), self.ratio, 0.0))


def coefficients(weights: Array) -> Array:
    """Return the coefficients of variation of the means of weights (N, requirement); infinite if all are zero."""
    mean = weights.mean(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = weights.std(axis=0, ddof=1) / (mean * np.sqrt(len(weights)))
    return np.where(mean > 0, found, np.inf)


def adapt(ledger: LimitStateLedger, begin: Proposal, requirements: int, generator: np.random.Generator) -> Proposal:
    """Sample pilots, and adapt the proposal to the violations of all pilots.

    Adaptation stops after `ROUNDS` pilots, if few realisations are left, or if the gain by another pilot would be
    smaller than its cost.
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
        # each requirement has only its part of the samples
        good = variance + 1.0 < (ENOUGH**2 + 1.0) * requirements
        # all pilots together are samples of the mixture of their proposals
        ratio = 1.0 / np.mean([1.0 / mixture.ratio(points) for mixture in used], axis=0)
        if not good:
            current = proposal(
                [*current.regions, *_missed_regions(points, ratio, margins, current.regions, 3)], None, ledger.dimension
            )
        current = adapted(current, points, _weights(ratio, margins))
        if good:
            break
    return current


def sample(
    ledger: LimitStateLedger, begin: Proposal, requirements: int, target: float, generator: np.random.Generator
) -> tuple[Proposal, Sampled]:
    """Sample until all requirements have the target coefficient of variation, or no realisation is left.

    If a single sample contributes a large part of an estimate, the proposal misses a region. If enough realisations are
    left, this region is added to the proposal, and sampling starts again.
    """
    current, repairs = begin, 0
    while True:
        first, points, margins = ledger.count, np.zeros((0, ledger.dimension)), np.zeros((0, requirements))
        missed: list[Region] = []
        while (size := _next_batch(current.mixture.ratio(points), margins, target, ledger.left)) > 0:
            more = current.mixture.sample(size, generator)
            margins, points = np.concatenate([margins, ledger(more)]), np.concatenate([points, more])
            if repairs < REPAIRS and ledger.left > 4 * BATCH:
                missed = _missed_regions(points, current.mixture.ratio(points), margins, current.regions, 1)
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


def _missed_regions(points: Array, ratio: Array, margins: Array, regions: Sequence[Region], most: int) -> list[Region]:
    """Return new regions at violations with large weights outside all present regions."""
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
