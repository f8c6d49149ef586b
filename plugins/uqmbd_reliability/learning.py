"""Reliability analysis with a surrogate, realisations near the limits, and a correction by missed violations.

The steps of `uqmbd_reliability.analysis` (search, splitting, sampling) run on the surrogate, whose evaluations have
negligible cost. The proposal of the sampling step gives a population of weighted points. Realisations are computed at
points at which the sign of a margin is uncertain. A Gaussian process (of scikit-learn) of the residuals corrects the
surrogate, and both steps repeat. Then the surrogate is frozen, and the probability is

    P = P of the surrogate + P(violation, not predicted) - P(predicted, no violation).

Realisations drawn from the population give estimates of the last two terms. Points with an uncertain sign are drawn
more often. The estimator of Hansen and Hurwitz is unbiased for every surrogate. Half of the points are drawn from
the unchanged proposal, so that no weight is larger than twice the weight in importance sampling.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.special import chdtri, ndtr

import uqmbd
from uqmbd.typing import Array, Index
from uqmbd_reliability.analysis import Analysis, analyse
from uqmbd_reliability.estimating import ProbabilityEstimate, failing, with_any
from uqmbd_reliability.importance import Sampled
from uqmbd_reliability.ledger import LimitState, LimitStateLedger
from uqmbd_reliability.proposals import Proposal

__all__ = ["FIRST", "gaussian_processes", "learn"]


POPULATION = 10_000
CYCLES, BATCH = 4, 32
FIRST = 40
"""Number of standard normal points at the start."""

FREE = 10_000
"""Number of evaluations of the surrogate to find the proposal."""

PLAIN = 0.5
"""Share of draws from the unchanged proposal."""

DOUBT = 1e-4
"""Points with a larger probability of a wrong sign count as uncertain in the bound on unobserved sign errors."""


@dataclass(frozen=True, eq=False)
class _Population:
    points: Array
    ratio: Array
    predicted: Array
    doubt: Array
    drawn: Array


def gaussian_processes() -> tuple[Any, ...]:
    """Return scikit-learn's modules of Gaussian processes, of their kernels, and of its exceptions."""
    modules = ("gaussian_process", "gaussian_process.kernels", "exceptions")
    needed = partial(uqmbd.extend.require_package, purpose="Reliability(surrogate=...)", install="uqmbd[learning]")
    return tuple(needed(f"sklearn.{module}") for module in modules)


def learn(
    limit: LimitState,
    predict: Callable[[Array], Array],
    dimension: int,
    *,
    target: float = 0.05,
    most: int = 3000,
    generator: np.random.Generator,
) -> Analysis | None:
    """Estimate probabilities of margins below zero, with a surrogate `predict` from (K, d) to (K, requirement).

    Other arguments are the same as for `analyse`; `most` counts only realisations of the mechanism. Return None if the
    surrogate has no violation, because it is useless then.
    """
    ledger = LimitStateLedger(limit, dimension, most)
    ledger(generator.standard_normal((FIRST, dimension)))
    free, population = None, None
    for cycle in range(CYCLES):
        corrected = _CorrectedSurrogate.of(predict, ledger)
        found = analyse(
            lambda u, by=corrected: (by(u), np.zeros(len(u), dtype=bool)),  # type: ignore[misc] # bound in the loop
            dimension,
            target=0.02,
            most=FREE,
            generator=generator,
        )
        if found.used is None:
            break
        free, population = found, _population(found.used, corrected, generator)
        if cycle < CYCLES - 1 and ledger.left > 2 * BATCH:
            chosen = np.unique(generator.choice(POPULATION, BATCH, p=population.drawn))
            ledger(population.points[chosen])
    if free is None or population is None:
        return None
    return _verified(free, ledger, population, target, generator)


@dataclass(frozen=True, eq=False)
class _CorrectedSurrogate:
    """Surrogate of margins, corrected by Gaussian processes of its residuals."""

    predict: Callable[[Array], Array]
    # process of each requirement; None if there are fewer than ten residuals, or all are zero
    processes: tuple[Any, ...]
    scales: tuple[float, ...]  # root mean square of the residuals of each requirement

    @classmethod
    def of(cls, predict: Callable[[Array], Array], ledger: LimitStateLedger) -> _CorrectedSurrogate:
        """Return the surrogate with a fit to all computed residuals."""
        gaussian, kernels, exceptions = gaussian_processes()
        known = ledger.points
        left = ledger.margins - predict(known)
        length = 2.0 * np.sqrt(ledger.dimension)
        processes, scales = [], []
        for column in left.T:
            fine = np.isfinite(column)
            scale = float(np.sqrt((column[fine] ** 2).mean())) if fine.any() else 0.0
            process = None
            if fine.sum() >= 10 and scale > 0:
                kernel = kernels.ConstantKernel(1.0, (1e-2, 1e4)) * kernels.RBF(length, (0.3, 100.0))
                kernel += kernels.WhiteKernel(1e-3, (1e-8, 1.0))
                process = gaussian.GaussianProcessRegressor(kernel, n_restarts_optimizer=0)
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", exceptions.ConvergenceWarning)
                    process.fit(known[fine], column[fine] / scale)
            processes.append(process)
            scales.append(scale)
        return cls(predict, tuple(processes), tuple(scales))

    def __call__(self, points: Array) -> Array:
        """Return margins (K, requirement)."""
        found = self.predict(points)
        for k, (process, scale) in enumerate(zip(self.processes, self.scales, strict=True)):
            if process is not None:
                found[:, k] += scale * process.predict(points)
        return found

    def doubt(self, points: Array, margins: Array) -> Array:
        """Return the probability that the sign of a margin is wrong, (K, requirement)."""
        found = np.empty_like(margins)
        for k, (process, scale) in enumerate(zip(self.processes, self.scales, strict=True)):
            error = 1.0 if process is None else process.predict(points, return_std=True)[1]
            least = max(scale * 1e-9, 1e-12 * float(np.abs(margins[:, k]).max()), 1e-300)
            found[:, k] = ndtr(-np.abs(margins[:, k]) / np.maximum(scale * error, least))
        return found


def _population(used: Proposal, corrected: _CorrectedSurrogate, generator: np.random.Generator) -> _Population:
    points = used.mixture.sample(POPULATION, generator)
    ratio, predicted = used.mixture.ratio(points), corrected(points)
    doubt = corrected.doubt(points, predicted)
    wanted = ratio[:, None] * np.sqrt(doubt * (1.0 - doubt))
    total = wanted.sum(axis=0)
    shares = (wanted / np.where(total > 0, total, 1.0)).mean(axis=1)
    drawn = PLAIN / len(points) + (1.0 - PLAIN) * shares
    return _Population(points, ratio, predicted, doubt, drawn / drawn.sum())


def _verified(
    free: Analysis, ledger: LimitStateLedger, population: _Population, target: float, generator: np.random.Generator
) -> Analysis:
    """Draw realisations with the surrogate frozen, until the probabilities are accurate enough."""
    drawn = np.zeros(0, dtype=np.int64)
    rows = np.zeros(0, dtype=np.int64)
    place: dict[int, int] = {}
    estimates: list[ProbabilityEstimate] = []
    lost = int(np.isnan(ledger.margins[:FIRST, 0]).sum())
    while ledger.left > 0:
        more = generator.choice(len(population.points), min(2 * BATCH, ledger.left), p=population.drawn)
        new = [int(k) for k in dict.fromkeys(more.tolist()) if k not in place]
        first = ledger.count
        if new:
            ledger(population.points[new])
        place.update({k: first + i for i, k in enumerate(new)})
        drawn = np.concatenate([drawn, more])
        rows = np.array([place[int(k)] for k in drawn])
        estimates = _estimates(population, drawn, ledger.margins[rows], lost)
        if len(drawn) >= 3 * BATCH and all(_settled(one, target) for one in estimates):
            break
    weights = population.ratio[drawn] / (len(population.points) * population.drawn[drawn])
    margins = ledger.margins[rows]
    # scale the weights of these draws to the more accurate probability
    counted = float(np.where(with_any(margins)[:, -1] < 0, weights, 0.0).mean())
    if counted > 0 and estimates:
        weights = weights * (estimates[-1].probability / counted)
    sampled = Sampled(population.points[drawn], weights, margins, rows)
    wrong = int(((margins < 0) != (population.predicted[drawn] < 0)).any(axis=1).sum())
    notes = (
        (
            f"the surrogate misclassified {wrong} of {len(drawn)} realisations of the mechanism, most of which were "
            "chosen where it is uncertain"
        ),
    )
    return Analysis(tuple(estimates), free.design_points, sampled, ledger, notes, used=free.used)


def _settled(one: ProbabilityEstimate, target: float) -> bool:
    return one.probability > 0 and one.upper - one.lower < 2 * 1.96 * target * one.probability


def _estimates(population: _Population, drawn: Index, margins: Array, lost: int) -> list[ProbabilityEstimate]:
    weights = population.ratio[drawn] / (len(population.points) * population.drawn[drawn])
    real, guess = with_any(margins), with_any(population.predicted)
    # for the violation of any requirement, the largest probability of a wrong sign counts
    doubt = with_any(-population.doubt)
    failed = np.isnan(real[:, 0])
    gone, most_gone = failing(np.where(failed, weights, 0.0), FIRST, lost)
    kept = max(1.0 - gone, 1e-12)
    found = []
    for k in range(real.shape[1]):
        violated, foreseen = real[:, k] < 0, guess[drawn, k] < 0
        counted = np.where(guess[:, k] < 0, population.ratio, 0.0)
        # for the bound on unobserved errors: weights of points with an uncertain sign, and of predicted violations
        unsure, sure = np.flatnonzero(-doubt[:, k] > DOUBT), np.flatnonzero(counted)
        most = max(_weight_quantile(population, unsure, 0.95), _weight_quantile(population, sure, 0.5))
        # a failed realisation with a predicted violation also counts as a false prediction
        missed, false = weights * (violated & ~foreseen), weights * (~violated & foreseen)
        mean = float(counted.mean() + missed.mean() - false.mean())
        error = float(np.hypot(_error(counted), _error(missed - false)))
        low, high = _combined(mean, counted, missed, false, most)
        high = min(high + most_gone, 1.0)
        found.append(ProbabilityEstimate(min(max(mean / kept, low), high), error / kept, low, high))
    return found


def _weight_quantile(population: _Population, chosen: Index, share: float) -> float:
    """Return the quantile of the weights of draws at given points, for a share of these points."""
    if not len(chosen):
        return 0.0
    weights = population.ratio[chosen] / (len(population.points) * population.drawn[chosen])
    return float(np.quantile(weights, share))


def _error(values: Array) -> float:
    return float(values.std(ddof=1) / np.sqrt(len(values)))


def _combined(mean: float, counted: Array, missed: Array, false: Array, most: float) -> tuple[float, float]:
    """Return the 95 % interval of `mean`, the mean of ``counted + missed - false``.

    The method is that of variance estimates recovery (Zou and Donner).
    """
    sampling = 1.96 * _error(counted)
    above, below = _interval(missed, most), _interval(false, most)
    one, other = float(missed.mean()), float(false.mean())
    low = mean - np.sqrt(sampling**2 + (one - above[0]) ** 2 + (below[1] - other) ** 2)
    high = mean + np.sqrt(sampling**2 + (above[1] - one) ** 2 + (other - below[0]) ** 2)
    return max(float(low), 0.0), min(max(float(high), 0.0), 1.0)


def _interval(weights: Array, most: float) -> tuple[float, float]:
    """Return bounds of a mean of weights of rare events, valid also without any event (Fay and Feuer)."""
    each = weights / len(weights)
    total, square = each.sum(), (each**2).sum()
    low = square / (2 * total) * chdtri(2 * total**2 / square, 0.975) if total > 0 else 0.0
    largest = max(each.max(), most / len(weights))
    if not largest > 0:
        return float(low), 0.0
    total, square = total + largest, square + largest**2
    return float(low), float(square / (2 * total) * chdtri(2 * total**2 / square, 0.025))
