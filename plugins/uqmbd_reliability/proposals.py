"""Mixtures for importance sampling, at design points and known violations, adapted to weighted violations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import log_ndtr

from uqmbd.typing import Array
from uqmbd_reliability.mixtures import Normal, Outside, WeightedMixture
from uqmbd_reliability.searching import DesignPoint

__all__ = ["Proposal", "Region", "adapted", "around_points", "from_design_point", "proposal", "round_region"]


FULL = 10
"""Largest number of inputs for which distributions are adapted in all directions.

For more inputs, one direction and the common variance of all others are adapted."""

STANDARD, ROUND, LEAST, BLUNT = 0.05, 0.08, 0.12, 0.18
"""Share of the standard normal distribution in the mixture, and least shares of regions of a requirement.

`ROUND` is the least share of the round region, and `LEAST` the least share of all other regions together. `BLUNT` is
the share of the fixed distribution of a region. These shares bound the weights by 1 / `STANDARD`, and near a region by
a small multiple of the probability of the region."""

PRIOR = 6.0
"""Weight of the previous proposal in an adaptation, as a number of violations. For covariances, twice the number of
adapted directions is added."""


@dataclass(frozen=True, eq=False)
class Region:
    """Region of likely violations."""

    sharp: Normal | Outside  # adapted distribution
    blunt: Normal  # fixed distribution
    requirement: int  # index of the violated requirement
    log_share: float  # logarithm of an estimate of its probability
    direction: Array | None = None
    """Unit vector (d,) into the violation; None: all points farther from the origin than the nearest violation."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """Mixture with the purpose of its parts: the standard normal one, then sharp and blunt parts of each region."""

    mixture: WeightedMixture
    regions: tuple[Region, ...]


def from_design_point(point: DesignPoint) -> Region:
    """Return the region behind a design point.

    For a plane, the mean distance of violations from the limit is about 1 / beta.
    A normal distribution with this mean and deviation, combined with a wider one, needs 420 realisations for a standard
    error of 5 %. This applies at any beta above 2.
    """
    beta, unit = point.beta, point.direction
    depth = 1.0 / max(beta, 1.0)
    basis, covariance = _basis_and_covariance(unit, depth**2, 1.0)
    sharp = Normal(point.point + depth * unit, basis, covariance)
    return Region(sharp, Normal.round(point.point), point.requirement, float(log_ndtr(-beta)), unit)


def around_points(points: Array, requirement: int, log_share: float) -> Region:
    """Return the region that contains violations (K, d)."""
    mean = points.mean(axis=0)
    unit = mean / max(float(np.linalg.norm(mean)), 1e-12)
    along = (points - mean) @ unit
    across = ((points - mean) ** 2).sum(axis=1) - along**2
    dimension = points.shape[1]
    rest = max(float(across.mean()) / max(dimension - 1, 1), 0.05)
    depth = max(float(along.var()), 0.02)
    basis, covariance = _basis_and_covariance(unit, depth, rest)
    sharp = Normal(mean, basis, covariance, rest if dimension > FULL else 1.0)
    return Region(sharp, Normal.round(mean), requirement, log_share, unit)


def round_region(points: Array, requirement: int) -> Region:
    """Return the region outside a sphere about the origin that contains violations (K, d); its blunt part is wide."""
    dimension = points.shape[1]
    nearest = float((points**2).sum(axis=1).min())
    wide = Normal.round(np.zeros(dimension), 1.0 + nearest / dimension)
    return Region(Outside.around(np.sqrt(nearest), dimension), wide, requirement, -np.inf)


def proposal(regions: Sequence[Region], shares: Array | None, dimension: int) -> Proposal:
    """Return the mixture of regions: all requirements have equal weight, which is divided among their regions.

    `shares` (region,): probabilities of the regions within their requirement; default: the estimated ones.
    """
    logs = np.array([region.log_share for region in regions])
    owner = np.array([region.requirement for region in regions])
    aimed = np.array([region.direction is not None for region in regions])
    parts = np.zeros(len(regions))
    for k in np.unique(owner):
        own = owner == k
        guess = np.exp(logs[own] - logs[own].max()) if shares is None else shares[own]
        guess = guess / guess.sum() if guess.sum() > 0 else np.full(own.sum(), 1 / own.sum())
        least = np.where(aimed[own], LEAST / max(int(aimed[own].sum()), 1), ROUND)
        parts[own] = least + (1.0 - least.sum()) * guess
    parts *= (1.0 - STANDARD) / parts.sum()
    listed: list[Normal | Outside] = [Normal.round(np.zeros(dimension))]
    weights = [STANDARD]
    for region, part in zip(regions, parts, strict=True):
        listed += [region.sharp, region.blunt]
        weights += [(1.0 - BLUNT) * part, BLUNT * part]
    return Proposal(WeightedMixture.of(listed, weights), tuple(regions))


def adapted(old: Proposal, points: Array, weights: Array) -> Proposal:
    """Return the proposal whose sharp parts have means and covariances of violations among points (K, d).

    `weights` (K, requirement) are zero for satisfied requirements. This is the cross-entropy update of a mixture: one
    step of expectation maximisation, shrunk towards the previous proposal.
    """
    logs = old.mixture.log_densities(points)[:, 1:]
    both = np.logaddexp(logs[:, ::2], logs[:, 1::2])
    owner = np.array([region.requirement for region in old.regions])
    regions, shares = list(old.regions), np.zeros(len(owner))
    for k in np.unique(owner):
        own = np.flatnonzero(owner == k)
        belongs = np.exp(both[:, own] - np.logaddexp.reduce(both[:, own], axis=1, keepdims=True))
        for place, j in enumerate(own):
            w = weights[:, k] * belongs[:, place]
            regions[j], shares[j] = _moved(old.regions[j], points, w), w.sum()
    return proposal(regions, shares, points.shape[1])


def _basis_and_covariance(unit: Array, along: float, across: float) -> tuple[Array, Array]:
    """Return basis and covariance with variances `along` and `across` a direction, for all adapted directions."""
    if len(unit) > FULL:
        return unit[:, None], np.array([[along]])
    return np.eye(len(unit)), across * np.eye(len(unit)) + (along - across) * np.outer(unit, unit)


def _moved(region: Region, points: Array, weights: Array) -> Region:
    total = weights.sum()
    if not total > 0:
        return region
    log_share = float(np.log(total))
    normal, unit = region.sharp, region.direction
    if isinstance(normal, Outside) or unit is None:
        nearest = float(np.sqrt((points[weights > 0] ** 2).sum(axis=1).min()))
        outside = Outside.around(nearest, points.shape[1])
        sharp = outside if isinstance(normal, Outside) and outside.radius < normal.radius else normal
        return replace(region, sharp=sharp, log_share=log_share)
    # normalise, so that squares of weights do not underflow
    weights = weights / total
    effective = 1.0 / float((weights**2).sum())
    basis = normal.basis
    dimension, width = basis.shape
    few = effective / (effective + 2.0)  # few violations determine a single number
    centre = weights @ points
    # shift only in the adapted directions, because the mean in the others is noise
    mean = normal.mean + effective / (effective + PRIOR) * (basis @ (basis.T @ (centre - normal.mean)))
    away = points - mean
    # adapt the variances along and across, and with enough violations all covariances
    along = float(weights @ (away @ unit) ** 2)
    across = (float(weights @ (away**2).sum(axis=1)) - along) / max(dimension - 1, 1)
    before = float(unit @ basis @ normal.covariance @ basis.T @ unit)
    others = normal.rest if dimension > FULL else (float(np.trace(normal.covariance)) - before) / max(dimension - 1, 1)
    along, across = few * along + (1 - few) * before, few * across + (1 - few) * others
    _, simple = _basis_and_covariance(unit, along, across)
    spread = (away @ basis * weights[:, None]).T @ (away @ basis)
    trust = effective / (effective + PRIOR + 2 * width)
    covariance = trust * spread + (1.0 - trust) * simple
    rest = across if dimension > FULL else 1.0
    return replace(region, sharp=Normal(mean, basis, covariance, rest), log_share=log_share)
