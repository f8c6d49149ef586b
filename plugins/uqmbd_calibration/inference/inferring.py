"""From a surrogate over the prior to draws of the posterior that real realisations confirm."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from uqmbd.typing import Array
from uqmbd_calibration.inference.cases import Case
from uqmbd_calibration.inference.climbing import Peaks, climb
from uqmbd_calibration.inference.correcting import Corrected, corrected, enough
from uqmbd_calibration.inference.posterior import Posterior, Predictor
from uqmbd_calibration.inference.sampling import Draws, sample
from uqmbd_calibration.inference.searching import spread_over_prior
from uqmbd_calibration.inference.unknowns import Unknowns

__all__ = ["Check", "Inferred", "Mode", "infer"]


CHECKED = 24
"""Draws that are computed on the mechanism at once."""

EVEN, SHIFT = 0.8, 0.1
"""Share of the weights, and shift of the means over their standard deviations, at which a surrogate is good enough."""

MODES, WORSE = 4, 30.0
"""Maxima that are computed on the mechanism, and by how much their log-density may be below the best one's."""

WIDER = 1.3
"""How much wider than the posterior realisations are spread that correct the surrogate."""

NEAR, FOLLOWED = 1.5, 6
"""Deviations of the posterior within which its maximum stays, and how often realisations follow it at most."""

SETTLED, SETTLING = 0.3, 6
"""Step of Gauss and Newton, in standard deviations of the posterior, that ends them; and how many there are at most."""


@dataclass(frozen=True)
class Check:
    """Real realisations at draws of the posterior.

    Attributes
    ----------
    draws : int
        How many.
    share : float
        Effective share of their weights, 1 where all are even.
    shift : float
        Largest shift of a mean by the weights, over its standard deviation.
    spread : float
        Largest of the standard deviations by the weights over that without, or its inverse.
    failures : int
        Realisations that failed.
    degree : int or None
        Of the correction of the surrogate; None: none.
    """

    draws: int
    share: float
    shift: float
    spread: float
    failures: int
    degree: int | None

    @property
    def passed(self) -> bool:
        """Whether the surrogate is as good as the mechanism."""
        return self.share >= EVEN and self.shift <= SHIFT


@dataclass(frozen=True, eq=False)
class Mode:
    """A maximum of the posterior density, on the mechanism.

    Attributes
    ----------
    vector : array, shape (N,)
        Of unknowns.
    log_density : float
        There.
    log_mass : float
        Logarithm of the mass that a normal distribution there has, up to a constant that all share.
    """

    vector: Array
    log_density: float
    log_mass: float


@dataclass(frozen=True, eq=False)
class Inferred:
    """What was found.

    Attributes
    ----------
    target : Posterior
        By the last surrogate.
    peak : array, shape (N,)
        Its maximum.
    draws : Draws
        Of the posterior.
    checks : tuple of Check
        One after another.
    modes : tuple of Mode
        The best first.
    widened : bool
        Whether the errors of the surrogate are in the likelihood, as they were not small enough in the end.
    """

    target: Posterior
    peak: Array
    draws: Draws
    checks: tuple[Check, ...]
    modes: tuple[Mode, ...]
    widened: bool


@dataclass(eq=False)
class _Work:
    """The cases with what is known of them so far."""

    unknowns: Unknowns
    cases: tuple[Case, ...]
    base: tuple[Predictor, ...]
    variances: tuple[list[Array], ...]
    predictors: list[Predictor] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.predictors = list(self.base)

    @property
    def target(self) -> Posterior:
        return Posterior(self.unknowns, self.cases, tuple(self.predictors))

    def affordable(self, count: int) -> bool:
        """Whether so many vectors can be computed on the mechanism."""
        wanted: dict[int, int] = {}
        for case in self.cases:
            wanted[id(case.point)] = wanted.get(id(case.point), 0) + count
        return all(case.point.left >= wanted[id(case.point)] for case in self.cases)

    def run(self, vectors: Array) -> list[list[Array]]:
        """Compute vectors (K, N) on the mechanism: values (K, n) of each block of each case."""
        found = []
        for case in self.cases:
            rows = case.point.run(case.normals(vectors))
            found.append(case.point.values(rows, case.blocks))
        return found

    def shift(self, vector: Array, real: list[list[Array]]) -> None:
        """Let predictions be the base, moved to what was computed at a vector."""
        for k, case in enumerate(self.cases):
            free, at = case.free, case.normals(vector[None])
            nothing = np.zeros(len(free)), np.eye(len(free))
            self.predictors[k] = corrected(
                self.base[k], at, real[k], free, at[0, free], nothing[1], lambda left: np.zeros(len(left))
            )

    def explore(self, peak: Array, factor: Array, count: int, seed: int) -> bool:
        """Compute realisations that are spread like the posterior, and a little wider; say whether any were left."""
        while count >= CHECKED // 3 and not self.affordable(count + CHECKED):
            count -= 1
        if not self.affordable(count + CHECKED):
            return False
        local = spread_over_prior(len(peak), count, seed)
        self.run(peak + WIDER * local @ factor.T)
        return True

    def follow(self, peak: Array, factor: Array, seeds: Iterator[int], *, explored: bool) -> tuple[Array, Array]:
        """Correct the surrogate about a maximum, and again about the one that follows, until it stays where it is."""
        inputs = max(len(case.free) for case in self.cases)
        count = max(CHECKED, enough(inputs))
        for _ in range(FOLLOWED):
            if not explored and not self.explore(peak, factor, count, next(seeds)):
                break
            explored, count = False, max(CHECKED // 2, enough(inputs, 1))
            then, factor = self.refit(peak, factor, 1)
            step = np.linalg.norm(np.linalg.solve(factor, then - peak))
            peak = then
            if step < NEAR:
                break
        return self.refit(peak, factor)

    def refit(self, peak: Array, factor: Array, times: int = 2) -> tuple[Array, Array]:
        """Fit corrections to all realisations about a maximum, with a factor of the covariance there; return new ones.

        Where the posterior is decides which realisations count, and in which coordinates, so that it is done twice
        where these are around it.
        """
        if not any(len(case.point.points) for case in self.cases):
            return _peak(self.target, peak)
        for _ in range(times):
            covariance = factor @ factor.T
            for k, case in enumerate(self.cases):
                own = case.columns[case.free]
                local = np.linalg.inv(np.linalg.cholesky(covariance[np.ix_(own, own)]))
                rows = np.arange(len(case.point.points))
                values = case.point.values(rows, case.blocks)
                centre = case.normals(peak[None])[0, case.free]
                self.predictors[k] = corrected(
                    self.base[k], case.point.points, values, case.free, centre, local, self._measure(k, peak)
                )
            peak, factor = _peak(self.target, peak)
        return peak, factor

    def _measure(self, k: int, peak: Array) -> Callable[[Array], Array]:
        """Return how much errors (K, N) of a case matter: their squares over the variance of the noise."""
        case = self.cases[k]
        sigma = np.concatenate([np.full(len(b.values), b.sigma(self.unknowns, peak[None])[0]) for b in case.blocks])

        def measure(errors: Array) -> Array:
            return np.asarray(((errors / sigma) ** 2).sum(axis=1))

        return measure

    @property
    def degree(self) -> int | None:
        """Highest degree of the corrections."""
        degrees = [p.degree for p in self.predictors if isinstance(p, Corrected)]
        return max(degrees, default=None)


def infer(
    unknowns: Unknowns,
    cases: tuple[Case, ...],
    base: tuple[Predictor, ...],
    variances: tuple[list[Array], ...],
    peaks: Peaks,
    *,
    draws: int,
    chains: int,
    seed: int,
) -> Inferred:
    """Find the posterior.

    Parameters
    ----------
    unknowns : Unknowns
    cases : tuple of Case
        With all values, without the variance of the surrogate.
    base : tuple of callable
        Predictions over the prior, of each case.
    variances : tuple of list of array
        Mean square errors that they state, of each case and block.
    peaks : Peaks
        Where the surrogate over the prior has maxima, the best first.
    draws, chains, seed : int
        Of the sampler.
    """
    work = _Work(unknowns, cases, base, variances)
    modes, start = _settled(work, peaks)
    seeds = iter(np.random.SeedSequence(seed).generate_state(4096).tolist())
    checks: list[Check] = []
    peak, factor = _peak(work.target, start)
    while work.affordable(CHECKED):
        peak, factor = work.follow(peak, factor, seeds, explored=bool(checks))
        found = sample(work.target.log_density, peak, factor, draws=draws, chains=chains, seed=next(seeds))
        checks.append(_checked(work, found, next(seeds)))
        if checks[-1].passed:
            return Inferred(work.target, peak, found, tuple(checks), modes, False)
    peak, factor = work.refit(peak, factor)
    widened = _widened(work)
    peak, factor = _peak(widened, peak)
    found = sample(widened.log_density, peak, factor, draws=draws, chains=chains, seed=next(seeds))
    return Inferred(widened, peak, found, tuple(checks), modes, True)


def _settled(work: _Work, peaks: Peaks) -> tuple[tuple[Mode, ...], Array]:
    """Follow the best maxima on the mechanism; the predictions are moved to the best of them."""
    found: list[_Followed] = []
    for k in range(min(MODES, len(peaks.cost))):
        if peaks.cost[k] > peaks.cost[0] + WORSE:
            break
        best = max((one.mode.log_density for one in found), default=-np.inf)
        one = _followed(work, peaks.vectors[k], 3 if found else SETTLING, CHECKED if found else 0, best)
        if one is not None:
            found.append(one)
    if not found:
        return (), peaks.vectors[0]
    found.sort(key=lambda one: -one.mode.log_mass)
    work.shift(found[0].at, found[0].real)
    return tuple(one.mode for one in found), found[0].mode.vector


@dataclass(frozen=True, eq=False)
class _Followed:
    """A maximum, and the last realisation on the way to it."""

    mode: Mode
    at: Array
    real: list[list[Array]]


def _followed(work: _Work, start: Array, steps: int, reserve: int, best: float) -> _Followed | None:
    """Climb to a maximum by derivatives of the surrogate and misfits of realisations; None where these fail.

    Parameters
    ----------
    work : _Work
    start : array, shape (N,)
    steps : int
        Realisations, at most.
    reserve : int
        Realisations that are left for others.
    best : float
        Log-density of the best maximum so far: what stays far below is left.
    """
    found, x, last = None, start, np.inf
    for _ in range(steps):
        if not work.affordable(1 + reserve):
            break
        real = work.run(x[None])
        if not np.isfinite(_density(work, x, real)):
            break
        work.shift(x, real)
        peak = climb(work.target, x[None])
        away = peak.vectors[0] - x
        step = float(np.sqrt(max(away @ peak.hessian[0] @ away, 0.0)))
        mass = -float(peak.cost[0]) - 0.5 * float(np.linalg.slogdet(peak.hessian[0])[1])
        found = _Followed(Mode(peak.vectors[0], -float(peak.cost[0]), mass), x, real)
        x = peak.vectors[0]
        # steps that do not shrink are those of wrong derivatives
        if step < SETTLED or step > 0.7 * last or -float(peak.cost[0]) < best - WORSE:
            break
        last = step
    return found


def _density(work: _Work, vector: Array, real: list[list[Array]]) -> float:
    return float(work.target.log_likelihood(vector[None], real)[0])


def _peak(target: Posterior, start: Array) -> tuple[Array, Array]:
    """Return the maximum near a start, and a lower triangular factor of the covariance there."""
    found = climb(target, start[None])
    for _ in range(2):
        # differences over a part of the posterior: as wide as rounding allows, as narrow as curvature asks
        deviation = np.sqrt(np.diag(np.linalg.inv(found.hessian[0])))[: len(target.unknowns.inputs)]
        found = climb(target, found.vectors, difference=np.clip(0.1 * deviation, 1e-7, 1e-2))
    covariance = np.linalg.inv(found.hessian[0])
    return found.vectors[0], np.asarray(np.linalg.cholesky(0.5 * (covariance + covariance.T)))


def _checked(work: _Work, found: Draws, seed: int) -> Check:
    """Weigh draws by the likelihood of the mechanism over that of the surrogate."""
    flat = found.flat
    rows = np.sort(np.random.default_rng(seed).choice(len(flat), CHECKED, replace=False))
    vectors = flat[rows]
    target = work.target
    real = work.run(vectors)
    away = target.log_likelihood(vectors, real) - target.log_likelihood(vectors)
    failed = int(np.count_nonzero(~np.isfinite(away)))
    if failed == len(away):
        return Check(CHECKED, 0.0, np.inf, np.inf, failed, work.degree)
    weights = np.where(np.isfinite(away), np.exp(away - np.max(away[np.isfinite(away)])), 0.0)
    weights /= weights.sum()
    share = 1.0 / float((weights**2).sum()) / len(weights)
    inputs = len(work.unknowns.inputs)
    scaled = (vectors - flat.mean(axis=0))[:, :inputs] / flat.std(axis=0)[:inputs]
    shift = np.abs(weights @ scaled - scaled.mean(axis=0)).max()
    ratio = np.sqrt(weights @ (scaled - weights @ scaled) ** 2) / scaled.std(axis=0)
    spread = float(np.maximum(ratio, 1 / np.maximum(ratio, 1e-12)).max())
    return Check(CHECKED, share, float(shift), spread, failed, work.degree)


def _widened(work: _Work) -> Posterior:
    """Return the posterior whose likelihood holds the errors of the surrogate.

    Those of realisations that are left out; where there are none, what the surrogate over the prior states.
    """
    cases = []
    for case, predictor, stated in zip(work.cases, work.predictors, work.variances, strict=True):
        blocks = []
        known = isinstance(predictor, Corrected) and len(predictor.errors) > 1
        parts = np.split(predictor.errors, predictor.splits, axis=1) if isinstance(predictor, Corrected) else stated
        for block, own, variance in zip(case.blocks, parts, stated, strict=True):
            if not known:
                blocks.append(replace(block, variance=block.variance + variance))
            elif block.robust:
                blocks.append(replace(block, variance=block.variance + (own**2).sum(axis=0)))
            else:
                blocks.append(replace(block, modes=np.concatenate([block.modes, own.T], axis=1)))
        cases.append(replace(case, blocks=tuple(blocks)))
    return Posterior(work.unknowns, tuple(cases), tuple(work.predictors))
