"""Draws about several maxima of a posterior, in proportion to the probability about each maximum.

Each point belongs to the nearest maximum, in deviations of the posterior at that maximum. A sampler draws from the
part of each maximum, and bridge sampling (Meng and Wong, 1996) computes the probability of the part.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln, logsumexp

from uqmbd.typing import Array, Index, Mask
from uqmbd_calibration.inference.posterior import Posterior
from uqmbd_calibration.inference.sampling import FREEDOM, Draws

__all__ = ["CombinedPosterior", "PartOfPosterior", "Parts", "combined_draws", "log_mass_of", "shares_of"]


APART = 3.0
"""Least distance of two maxima that are sampled separately, in standard deviations of the posterior at either of
them."""

PROPOSED, ITERATIONS = 4096, 50
"""Bridge sampling: number of proposals for a part, and number of iterations of the estimate."""


@dataclass(frozen=True, eq=False)
class Parts:
    """Maxima (M, N) of a posterior and their Hessians (M, N, N), which divide the space of unknowns into parts."""

    vectors: Array
    hessians: Array

    @classmethod
    def separate(cls, vectors: Sequence[Array], hessians: Sequence[Array]) -> tuple[Parts, list[int]]:
        """Return the maxima that are far enough from all earlier ones, and their indices."""
        kept: list[int] = []
        for k in range(len(vectors)):
            nearest = [
                min(_squares(vectors[k][None], vectors[i], hessians[j])[0] for j in (i, k)) > APART**2 for i in kept
            ]
            if all(nearest):
                kept.append(k)
        return cls(np.array([vectors[k] for k in kept]), np.array([hessians[k] for k in kept])), kept

    def of(self, vectors: Array) -> Index:
        """Return the index (K,) of the maximum that is nearest to each vector (K, N)."""
        away = [_squares(vectors, one, hessian) for one, hessian in zip(self.vectors, self.hessians, strict=True)]
        return np.asarray(np.argmin(np.stack(away), axis=0))

    def density(self, number: int, log_density: Callable[[Array], Array]) -> Callable[[Array], Array]:
        """Return a log-density that is minus infinity outside the part of a maximum."""
        if len(self.vectors) == 1:
            return log_density

        def within(vectors: Array) -> Array:
            own: Mask = self.of(vectors) == number
            found = np.full(len(vectors), -np.inf)
            if own.any():
                found[own] = log_density(vectors[own])
            return found

        return within


@dataclass(frozen=True, eq=False)
class PartOfPosterior:
    """Draws about one maximum, their surrogate, and the logarithm of the unnormalised probability of the part."""

    target: Posterior
    peak: Array
    draws: Draws
    log_mass: float


@dataclass(frozen=True, eq=False)
class CombinedPosterior(Posterior):
    """Posterior with a surrogate about each maximum; its cases belong to the first maximum."""

    parts: Parts
    targets: tuple[Posterior, ...]

    def predictions(self, vectors: Array) -> list[list[Array]]:
        """Return predictions (K, n) of each block of each case, by the surrogate of the nearest maximum."""
        number = self.parts.of(vectors)
        found = [[np.empty((len(vectors), len(block.values))) for block in case.blocks] for case in self.cases]
        for k, target in enumerate(self.targets):
            if (own := number == k).any():
                for arrays, blocks in zip(found, target.predictions(vectors[own]), strict=True):
                    for array, values in zip(arrays, blocks, strict=True):
                        array[own] = values
        return found


def log_mass_of(
    log_density: Callable[[Array], Array], peak: Array, factor: Array, draws: Draws, seed: int, within: float
) -> float:
    """Return the logarithm of the integral of a density over (2 pi)^(N/2), by bridge sampling with Student's t.

    `peak` (N,), `factor` (N, N): centre and factor of the covariance; `draws`: of the density; `within`: distance from
    the centre beyond which the density counts as zero, in deviations.
    """
    dimension = len(peak)
    generator = np.random.default_rng(seed)
    scale = np.sqrt(FREEDOM / generator.chisquare(FREEDOM, PROPOSED))
    proposed = generator.standard_normal((PROPOSED, dimension)) * scale[:, None]
    constant = gammaln((FREEDOM + dimension) / 2) - gammaln(FREEDOM / 2) - dimension / 2 * np.log(FREEDOM / 2)

    def log_q(local: Array) -> Array:
        tail = 0.5 * (FREEDOM + dimension) * np.log1p((local**2).sum(axis=1) / FREEDOM)
        return np.asarray(constant - tail - np.log(np.diag(factor)).sum())

    density = np.where((proposed**2).sum(axis=1) <= within**2, log_density(peak + proposed @ factor.T), -np.inf)
    of_proposals = density - log_q(proposed)
    local = np.asarray(np.linalg.solve(factor, (draws.flat - peak).T).T, dtype=float)
    of_draws = draws.log_density.ravel() - log_q(local)
    effective = min(float(draws.ess.min()), float(len(of_draws)))
    one, two = (np.log(n / (effective + PROPOSED)) for n in (effective, PROPOSED))
    found = float(np.median(of_draws))
    for _ in range(ITERATIONS):
        above = logsumexp(of_proposals - np.logaddexp(one + of_proposals, two + found)) - np.log(PROPOSED)
        below = logsumexp(-np.logaddexp(one + of_draws, two + found)) - np.log(len(of_draws))
        found = float(above - below)
    return found


def shares_of(log_masses: Sequence[float]) -> Array:
    """Return the shares (M,) of masses from their logarithms."""
    given = np.asarray(log_masses, dtype=float)
    return np.asarray(np.exp(given - logsumexp(given))) if len(given) else given


def combined_draws(parts: Sequence[PartOfPosterior], seed: int) -> Draws:
    """Return draws of all parts in proportion to their probabilities, in random order in each chain."""
    if len(parts) == 1:
        return parts[0].draws
    shares, generator = shares_of([part.log_mass for part in parts]), np.random.default_rng(seed)
    chains, count = parts[0].draws.log_density.shape
    count = min(count, *(part.draws.log_density.shape[1] for part in parts))
    vectors, density = [], []
    for chain in range(chains):
        chosen = generator.permutation(np.repeat(np.arange(len(parts)), _rounded_counts(shares, count)))
        rows = generator.permuted(np.tile(np.arange(count), (len(parts), 1)), axis=1)
        each = [rows[k][: np.count_nonzero(chosen == k)] for k in range(len(parts))]
        own, lp = np.empty((count, parts[0].draws.vectors.shape[2])), np.empty(count)
        for k, part in enumerate(parts):
            own[chosen == k], lp[chosen == k] = (
                part.draws.vectors[chain, each[k]],
                part.draws.log_density[chain, each[k]],
            )
        vectors.append(own)
        density.append(lp)
    every = [part.draws for part in parts]
    # a mean over all draws is a weighted sum of independent means of the parts
    effective = 1 / sum(share**2 / one.ess for share, one in zip(shares, every, strict=True) if share > 0)
    return Draws(
        vectors=np.array(vectors),
        log_density=np.array(density),
        rhat=np.max([one.rhat for one in every], axis=0),
        ess=np.asarray(effective),
        acceptance=float(shares @ [one.acceptance for one in every]),
        correlation=max(one.correlation for one in every),
        steps=min(one.steps for one in every),
        converged=all(one.converged for one in every),
    )


def _rounded_counts(shares: Array, count: int) -> Index:
    """Return integers (M,) in proportion to shares, with the sum `count`."""
    found = np.floor(shares * count).astype(int)
    left = np.argsort(found - shares * count, kind="stable")[: count - int(found.sum())]
    found[left] += 1
    return found


def _squares(vectors: Array, centre: Array, hessian: Array) -> Array:
    """Return squared distances (K,) of vectors (K, N) from a centre, in deviations."""
    away = vectors - centre
    return np.asarray(np.einsum("ki,ij,kj->k", away, hessian, away))
