"""Computation of posterior draws that realisations of the mechanism verify, from a surrogate over the prior."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from uqmbd.typing import Array
from uqmbd_calibration.inference.climbing import Peaks
from uqmbd_calibration.inference.correcting import CorrectedPredictions
from uqmbd_calibration.inference.machine_records import MachineRecords
from uqmbd_calibration.inference.maxima import (
    CombinedPosterior,
    PartOfPosterior,
    Parts,
    combined_draws,
    log_mass_of,
    shares_of,
)
from uqmbd_calibration.inference.posterior import Posterior, Predictor
from uqmbd_calibration.inference.sampling import Draws, sample
from uqmbd_calibration.inference.settling import Mode, settle
from uqmbd_calibration.inference.unknowns import Unknowns
from uqmbd_calibration.inference.working import CHECKED, CalibrationState, peak_of

__all__ = ["PART", "PosteriorCheck", "Inferred", "Mode", "infer"]


LEAST_SHARE, MOST_SHIFT = 0.8, 0.1
"""Accepted surrogates: least effective share of weights; largest shift of a mean, in standard deviations."""


PART = 0.01
"""Probability above which another maximum of the posterior is sampled, or a warning reports that it is not."""

WITHIN = 4.0
"""Radius of the sampled region, in standard deviations of the posterior, in addition to three times the square root of
the dimension."""


GROWTH, WIDEST = 4.0, 1e3
"""Factor by which the radius grows if it cuts off draws; radius from which on the region is unlimited instead."""

NEAR_LIMIT, MOST_NEAR_LIMIT = 0.8, 1e-3
"""Share of the radius beyond which a draw is near the limit; share of draws near the limit above which the region
grows. Fewer than one of 10^7 draws of a normal distribution are near the limit."""


@dataclass(frozen=True)
class PosteriorCheck:
    """Check of the surrogate by realisations at draws of the posterior."""

    draws: int  # number of draws
    share: float  # effective share of their weights, 1 for equal weights
    shift: float  # largest shift of a mean by the weights, in standard deviations
    spread: float  # largest ratio of standard deviations with and without weights, or its inverse
    failures: int  # number of failed realisations
    degree: int | None  # of the correction of the surrogate; None: no correction

    @property
    def chance(self) -> float:
        """Standard error of the shift of one mean, in standard deviations, from the scatter of the weights."""
        # rounding can make a share slightly larger than 1
        return float(np.sqrt(max(1 / self.share - 1, 0.0) / self.draws)) if self.share > 0 else float("inf")

    @property
    def passed(self) -> bool:
        """Whether realisations confirm the surrogate."""
        return self.share >= LEAST_SHARE and self.shift <= MOST_SHIFT


@dataclass(frozen=True, eq=False)
class Inferred:
    """Results of an inference."""

    target: Posterior  # posterior by the last surrogate
    peak: Array  # (N,): maximum of its density
    draws: Draws  # draws of the posterior
    checks: tuple[PosteriorCheck, ...]  # in order of time
    modes: tuple[Mode, ...]  # maxima, the best first
    widened: bool  # whether the likelihood includes the surrogate errors, because the last errors were too large
    unseen: int  # number of maxima of the surrogate, about as likely as the best one, without a search on the mechanism


def infer(
    unknowns: Unknowns,
    cases: tuple[MachineRecords, ...],
    base: tuple[Predictor, ...],
    variances: tuple[list[Array], ...],
    peaks: Peaks,
    *,
    draws: int,
    chains: int,
    seed: int,
    mechanism: bool = False,
    further: int = 0,
) -> Inferred:
    """Return draws of the posterior with checks.

    `cases`: records without the variance of the surrogate; `base`: predictions over the prior for each case;
    `variances`: their stated mean square errors for each case and block; `peaks`: maxima of the surrogate over the
    prior, the best first; `draws`, `chains`, `seed`: options of the sampler; `mechanism`: whether to sample with the
    mechanism itself instead of a surrogate; `further`: realisations that each additional maximum may add.
    """
    work = CalibrationState(unknowns, cases, base, variances)
    modes, start, unseen = settle(work, peaks)
    seeds = iter(np.random.SeedSequence(seed).generate_state(4096).tolist())
    # limit of the sampled region: far in each direction, plus the typical distance in this dimension
    about: dict[str, Any] = {"draws": draws, "chains": chains, "within": WITHIN + 3.0 * np.sqrt(len(start))}
    if mechanism:
        peak, factor = work.follow(*peak_of(work.target, start), seeds, explored=False)
        found = work.draw(peak, factor, draws=draws, chains=chains, seed=next(seeds))
        return Inferred(work.target, peak, found, (), modes, False, unseen)
    shares = shares_of([mode.log_mass for mode in modes])
    likely = [k for k in range(len(modes)) if k == 0 or shares[k] > PART]
    parts, numbers = Parts.separate([modes[k].vector for k in likely], [modes[k].hessian for k in likely])
    numbers = [likely[k] for k in numbers]
    sampled: list[_SampledPart] = []
    for k, number in enumerate(numbers or [0]):
        if k:
            for point in {id(case.point): case.point for case in cases}.values():
                point.most += further
            if not work.affordable(2 * CHECKED):
                break
            start, work.predictors = modes[number].vector, list(modes[number].predictors)
        sampled.append(_sampled(work, start, parts, k, len(numbers) > 1, seeds, about))
    return _combined(sampled, parts, modes, numbers, unseen, seed)


@dataclass(frozen=True, eq=False)
class _SampledPart:
    """Part of a posterior, checks of its surrogate, and whether surrogate errors widen the part."""

    part: PartOfPosterior
    checks: tuple[PosteriorCheck, ...]
    widened: bool


def _sampled(
    work: CalibrationState,
    start: Array,
    parts: Parts,
    number: int,
    several: bool,
    seeds: Iterator[int],
    about: dict[str, Any],
) -> _SampledPart:
    """Draw from the part of a maximum, and correct the surrogate until realisations confirm it."""
    checks: list[PosteriorCheck] = []
    peak, factor = peak_of(work.target, start)

    def drawn(target: Posterior) -> PartOfPosterior:
        density = parts.density(number, target.log_density) if several else target.log_density
        limits = dict(about)
        found = sample(density, peak, factor, seed=next(seeds), **limits)
        while np.isfinite(limits["within"]) and _at_limit(found, peak, factor, limits["within"]):
            limits["within"] = GROWTH * limits["within"] if limits["within"] < WIDEST else np.inf
            found = sample(density, peak, factor, seed=next(seeds), **limits)
        mass = log_mass_of(density, peak, factor, found, next(seeds), limits["within"]) if several else 0.0
        return PartOfPosterior(target, peak, found, mass)

    while work.affordable(CHECKED):
        peak, factor = work.follow(peak, factor, seeds, explored=bool(checks))
        part = drawn(work.target)
        checks.append(_checked(work, part.draws, next(seeds)))
        if checks[-1].passed:
            return _SampledPart(part, tuple(checks), False)
    peak, factor = work.refit(peak, factor)
    widened = _widened(work)
    peak, factor = peak_of(widened, peak)
    return _SampledPart(drawn(widened), tuple(checks), True)


def _at_limit(found: Draws, peak: Array, factor: Array, within: float) -> bool:
    """Return whether the limit of the sampled region cuts off draws, for example of a posterior along a curve."""
    local = np.linalg.solve(factor, (found.flat - peak).T)
    far = (local**2).sum(axis=0) > (NEAR_LIMIT * within) ** 2
    return bool(far.mean() > MOST_NEAR_LIMIT)


def _combined(
    sampled: Sequence[_SampledPart],
    parts: Parts,
    modes: tuple[Mode, ...],
    numbers: Sequence[int],
    unseen: int,
    seed: int,
) -> Inferred:
    """Combine the draws about all maxima; if a part is widened, its check becomes the last check."""
    first = sampled[0].part
    if len(sampled) == 1:
        one = sampled[0]
        return Inferred(first.target, first.peak, first.draws, one.checks, modes, one.widened, unseen)
    masses = {number: one.part.log_mass for number, one in zip(numbers, sampled, strict=False)}
    # the mass of a maximum that was not sampled is the mass of a normal distribution
    modes = tuple(replace(mode, log_mass=masses.get(k, mode.log_mass)) for k, mode in enumerate(modes))
    target = CombinedPosterior(
        first.target.unknowns,
        first.target.cases,
        first.target.predictors,
        Parts(parts.vectors[: len(sampled)], parts.hessians[: len(sampled)]),
        tuple(one.part.target for one in sampled),
    )
    ordered = sorted(sampled, key=lambda one: one.widened)
    return Inferred(
        target,
        first.peak,
        combined_draws([one.part for one in sampled], seed),
        tuple(check for one in ordered for check in one.checks),
        modes,
        any(one.widened for one in sampled),
        unseen,
    )


def _checked(work: CalibrationState, found: Draws, seed: int) -> PosteriorCheck:
    """Weight draws by the ratio of two likelihoods: by the mechanism, and by the surrogate."""
    flat = found.flat
    rows = np.sort(np.random.default_rng(seed).choice(len(flat), CHECKED, replace=False))
    vectors = flat[rows]
    target = work.target
    real = work.run(vectors)
    away = target.log_likelihood(vectors, real) - target.log_likelihood(vectors)
    failed = int(np.count_nonzero(~np.isfinite(away)))
    if failed == len(away):
        return PosteriorCheck(CHECKED, 0.0, np.inf, np.inf, failed, work.degree)
    weights = np.where(np.isfinite(away), np.exp(away - np.max(away[np.isfinite(away)])), 0.0)
    weights /= weights.sum()
    share = 1.0 / float((weights**2).sum()) / len(weights)
    inputs = len(work.unknowns.inputs)
    scaled = (vectors - flat.mean(axis=0))[:, :inputs] / flat.std(axis=0)[:inputs]
    shift = np.abs(weights @ scaled - scaled.mean(axis=0)).max()
    ratio = np.sqrt(weights @ (scaled - weights @ scaled) ** 2) / scaled.std(axis=0)
    spread = float(np.maximum(ratio, 1 / np.maximum(ratio, 1e-12)).max())
    return PosteriorCheck(CHECKED, share, float(shift), spread, failed, work.degree)


def _widened(work: CalibrationState) -> Posterior:
    """Return the posterior whose likelihood includes the errors of the surrogate.

    The errors are leave-one-out errors, or the stated errors of the surrogate over the prior if there are none. One
    input determines the errors of all recorded values, so that all may have one sign. Stated variances are therefore
    multiplied by the number N of values. This covariance covers errors e with any correlation: for deviations s,
    ``e e' <= N diag(s^2)`` if the squares of ``e / s`` add up to N.
    """
    many = sum(len(block.values) for case in work.cases for block in case.blocks)
    cases = []
    for case, predictor, stated in zip(work.cases, work.predictors, work.variances, strict=True):
        blocks = []
        known = isinstance(predictor, CorrectedPredictions) and len(predictor.errors) > 1
        parts = (
            np.split(predictor.errors, predictor.splits, axis=1)
            if isinstance(predictor, CorrectedPredictions)
            else stated
        )
        for block, own, variance in zip(case.blocks, parts, stated, strict=True):
            if not known:
                blocks.append(replace(block, variance=block.variance + many * variance))
            elif block.robust:
                blocks.append(replace(block, variance=block.variance + many * (own**2).sum(axis=0)))
            else:
                blocks.append(replace(block, modes=np.concatenate([block.modes, own.T], axis=1)))
        cases.append(replace(case, blocks=tuple(blocks)))
    return Posterior(work.unknowns, tuple(cases), tuple(work.predictors))
