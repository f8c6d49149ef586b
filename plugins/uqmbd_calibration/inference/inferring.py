"""From a surrogate over the prior to draws of the posterior that realisations of the mechanism confirm."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from uqmbd.typing import Array
from uqmbd_calibration.inference.climbing import Peaks
from uqmbd_calibration.inference.correcting import CorrectedPredictions
from uqmbd_calibration.inference.machine_records import MachineRecords
from uqmbd_calibration.inference.posterior import Posterior, Predictor
from uqmbd_calibration.inference.sampling import Draws, sample
from uqmbd_calibration.inference.settling import Mode, settle
from uqmbd_calibration.inference.unknowns import Unknowns
from uqmbd_calibration.inference.working import CHECKED, CalibrationState, peak_of

__all__ = ["PosteriorCheck", "Inferred", "Mode", "infer"]


EVEN, SHIFT = 0.8, 0.1
"""Share of the weights, and shift of the means over their standard deviations, at which a surrogate is good enough."""


WITHIN = 4.0
"""Deviations of the posterior, in addition to three times the root of its dimension, within which it is sampled."""


@dataclass(frozen=True)
class PosteriorCheck:
    """Real realisations at draws of the posterior."""

    draws: int  # how many
    share: float  # effective share of their weights, 1 where all are even
    shift: float  # largest shift of a mean by the weights, over its standard deviation
    spread: float  # largest of the standard deviations by the weights over that without, or its inverse
    failures: int  # realisations that failed
    degree: int | None  # of the correction of the surrogate; None: none

    @property
    def chance(self) -> float:
        """Standard error of the shift of one mean, over its standard deviation, from the scatter of the weights."""
        # a share of 1 may be a little more by rounding
        return float(np.sqrt(max(1 / self.share - 1, 0.0) / self.draws)) if self.share > 0 else float("inf")

    @property
    def passed(self) -> bool:
        """Whether realisations confirm the surrogate."""
        return self.share >= EVEN and self.shift <= SHIFT


@dataclass(frozen=True, eq=False)
class Inferred:
    """Results of an inference."""

    target: Posterior  # by the last surrogate
    peak: Array  # (N,): its maximum
    draws: Draws  # of the posterior
    checks: tuple[PosteriorCheck, ...]  # one after another
    modes: tuple[Mode, ...]  # the best first
    widened: bool  # whether the errors of the surrogate are in the likelihood, as they were not small enough in the end
    unseen: int  # maxima of the surrogate, about as likely as the best one, that were not followed on the mechanism


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
) -> Inferred:
    """Find the posterior.

    `cases`: with all values, without the variance of the surrogate; `base`: predictions over the prior, of each case;
    `variances`: mean square errors that they state, of each case and block; `peaks`: where the surrogate over the
    prior has maxima, the best first; `draws`, `chains`, `seed`: of the sampler; `mechanism`: whether draws are those
    of the mechanism itself, not of a surrogate.
    """
    work = CalibrationState(unknowns, cases, base, variances)
    modes, start, unseen = settle(work, peaks)
    seeds = iter(np.random.SeedSequence(seed).generate_state(4096).tolist())
    checks: list[PosteriorCheck] = []
    peak, factor = peak_of(work.target, start)
    # far out in each direction, and where chance leads in so many dimensions
    about: dict[str, Any] = {"draws": draws, "chains": chains, "within": WITHIN + 3.0 * np.sqrt(len(peak))}
    if mechanism:
        peak, factor = work.follow(peak, factor, seeds, explored=False)
        found = work.draw(peak, factor, draws=draws, chains=chains, seed=next(seeds))
        return Inferred(work.target, peak, found, (), modes, False, unseen)
    while work.affordable(CHECKED):
        peak, factor = work.follow(peak, factor, seeds, explored=bool(checks))
        found = sample(work.target.log_density, peak, factor, seed=next(seeds), **about)
        checks.append(_checked(work, found, next(seeds)))
        if checks[-1].passed:
            return Inferred(work.target, peak, found, tuple(checks), modes, False, unseen)
    peak, factor = work.refit(peak, factor)
    widened = _widened(work)
    peak, factor = peak_of(widened, peak)
    found = sample(widened.log_density, peak, factor, seed=next(seeds), **about)
    return Inferred(widened, peak, found, tuple(checks), modes, True, unseen)


def _checked(work: CalibrationState, found: Draws, seed: int) -> PosteriorCheck:
    """Weigh draws by the likelihood of the mechanism over that of the surrogate."""
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

    Those of realisations that are left out; where there are none, what the surrogate over the prior states.
    """
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
                blocks.append(replace(block, variance=block.variance + variance))
            elif block.robust:
                blocks.append(replace(block, variance=block.variance + (own**2).sum(axis=0)))
            else:
                blocks.append(replace(block, modes=np.concatenate([block.modes, own.T], axis=1)))
        cases.append(replace(case, blocks=tuple(blocks)))
    return Posterior(work.unknowns, tuple(cases), tuple(work.predictors))
