"""Maxima of the posterior density on the mechanism: Gauss-Newton method in a trust region.

Each step computes one realisation and shifts the surrogate to be exact there. The step then climbs on this surrogate
within the trust region. Over a wide prior, slopes of a surrogate can have errors larger than the slopes. Forward
differences of realisations replace them if a step does not gain about the predicted increase. Forward differences also
replace the slopes if a climb would end without any step, because no step has then tested the slopes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.typing import Array
from uqmbd_calibration.inference.climbing import Peaks, climb
from uqmbd_calibration.inference.posterior import Predictor
from uqmbd_calibration.inference.working import CHECKED, CalibrationState

__all__ = ["Mode", "settle"]


MODES, MOST_BELOW = 4, 30.0
"""Largest number of maxima computed on the mechanism, and their largest distance in log-density below the best one."""

AS_LIKELY = 3.0
"""A maximum without a search is reported if its log-mass is at most this much below the log-mass of the best
maximum."""

SMALL_STEP, MOST_STEPS = 0.3, 24
"""End of a search: step length, in standard deviations of the posterior, and largest number of steps."""

POOR, GOOD, MORE = 0.25, 0.75, 2.0
"""Ratios of actual to predicted gain. Slopes count as wrong below the first and above the last ratio; above the second
one, the next step may be longer."""

FREE = 4
"""Largest number of steps with the slopes of the surrogate."""

WIDEST = 2.0
"""Initial half-width of the trust region, in standard deviations of the prior."""

DIFFERENCE = 0.1, 1e-4
"""Step of forward differences, in standard deviations of the posterior; least step, in standard deviations of the
prior."""


@dataclass(frozen=True, eq=False)
class Mode:
    """Maximum of the posterior density on the mechanism."""

    vector: Array  # (N,): vector of unknowns
    log_density: float  # log-density at the vector
    log_mass: float  # logarithm of the mass about it, up to a common constant; initially for a normal distribution
    hessian: Array  # (N, N): of minus the log-density
    predictors: tuple[Predictor, ...]  # surrogates that are exact at the vector, one for each case


@dataclass(frozen=True, eq=False)
class _Computed:
    """Realisations of the cases at a vector, and the negative log-density and most probable noise levels there."""

    vector: Array
    real: list[list[Array]]
    cost: float


@dataclass(frozen=True, eq=False)
class _SearchResult:
    """Result of a search: the maximum, and the best realisation."""

    mode: Mode
    at: _Computed

    def same(self, other: _SearchResult) -> bool:
        """Return whether another search ended within one deviation of the same maximum."""
        away = other.mode.vector - self.mode.vector
        return bool(away @ self.mode.hessian @ away < 1.0)


def settle(work: CalibrationState, peaks: Peaks) -> tuple[tuple[Mode, ...], Array, int]:
    """Search on the mechanism from the best maxima of the surrogate; shift the predictions to the best result.

    Return the maxima, the best first, and the vector (N,) to start from. Return also the number of maxima of the
    surrogate that are about as likely as the best one but had no search.
    """
    found: list[_SearchResult] = []
    mass = -peaks.cost - 0.5 * np.linalg.slogdet(peaks.hessian)[1]
    unseen = mass > mass.max() - AS_LIKELY
    # also start from the median of the prior, because the surrogate may be wrong about all its maxima
    centre = np.zeros_like(peaks.vectors[0])
    for k in range(min(MODES, len(peaks.cost))):
        if peaks.cost[k] > peaks.cost[0] + MOST_BELOW:
            break
        best = min((one.at.cost for one in found), default=np.inf)
        if not work.affordable(2 + (CHECKED if found else 0)):
            break
        unseen[k] = False
        starts = [peaks.vectors[k], *([] if found else [centre])]
        tried = [begun for start in starts if np.isfinite((begun := _computed(work, start)).cost)]
        if not tried:
            continue
        one = _search_from(work, min(tried, key=lambda begun: begun.cost), best)
        if not any(other.same(one) for other in found):
            found.append(one)
    if not found:
        return (), peaks.vectors[0], int(unseen.sum())
    found.sort(key=lambda one: -one.mode.log_mass)
    work.predictors = list(found[0].mode.predictors)
    return tuple(one.mode for one in found), found[0].mode.vector, int(unseen.sum())


def _search_from(work: CalibrationState, start: _Computed, best: float) -> _SearchResult:
    """Climb from a realisation to a maximum; stop a climb that stays far above the cost `best` of another maximum."""
    at, width, exact, tested, possible, settled = start, WIDEST, False, False, True, False
    inputs = len(work.unknowns.inputs)
    # spend all realisations on the maximum if they are too few for a check
    reserve = CHECKED if work.affordable(2 * CHECKED) else 0
    work.shift(at.vector, at.real)
    peak = climb(work.target, at.vector[None], within=width)
    for taken in range(MOST_STEPS):
        metric = peak.hessian[0]
        step = peak.vectors[0] - at.vector
        length = float(np.abs(step[:inputs]).max())
        near = float(np.sqrt(max(step @ metric @ step, 0.0))) < SMALL_STEP and length < 0.99 * width
        settled = near and (exact or (tested and width >= WIDEST) or not possible)
        if settled or not work.affordable(1 + reserve):
            break
        tried = None if near else _computed(work, peak.vectors[0])
        gain = -np.inf if tried is None else at.cost - tried.cost
        predicted = at.cost - float(peak.cost[0])
        if tried is not None and gain > 0:
            at = tried
        fits = POOR * predicted <= gain <= MORE * predicted
        tested, wrong = tested or (fits and not near), not fits or taken >= FREE
        if gain <= 0 or (exact and gain < POOR * predicted):
            width = max(0.25 * length, 1e-6)
        elif gain > GOOD * predicted:
            width = max(width, 2.0 * length)
        # compute slopes once at a point, then at each new point after slopes of the surrogate were wrong
        if exact and gain > 0 and not _differences(work, at, metric):
            break
        if not exact and possible and (wrong or near):
            exact = possible = _differences(work, at, metric)
            width = WIDEST if exact else width
        if not exact:
            work.shift(at.vector, at.real)
        peak = climb(work.target, at.vector[None], within=width)
        if -float(peak.cost[0]) < -best - MOST_BELOW:
            break
    # without a nearby realisation, the peak of the surrogate is not a maximum on the mechanism
    place, cost = (peak.vectors[0], float(peak.cost[0])) if settled else (at.vector, at.cost)
    mass = -cost - 0.5 * float(np.linalg.slogdet(peak.hessian[0])[1])
    return _SearchResult(Mode(place, -cost, mass, peak.hessian[0], tuple(work.predictors)), at)


def _computed(work: CalibrationState, vector: Array) -> _Computed:
    """Compute the realisations of a vector (N,), and set its noise levels to the most probable ones."""
    real = work.run(vector[None])
    target = work.target
    if all(np.isfinite(values).all() for blocks in real for values in blocks):
        vector = target.with_levels(vector[None], real)[0]
    density = float(target.log_likelihood(vector[None], real)[0]) - 0.5 * float(vector @ vector)
    return _Computed(vector, real, -density)


def _differences(work: CalibrationState, at: _Computed, hessian: Array) -> bool:
    """Set the slopes of the predictions to the slopes of the mechanism at a point; return whether this succeeded.

    Separate inputs of several machines are moved at the same time.
    """
    inputs = max(len(case.columns) for case in work.cases)
    if not work.affordable(inputs + CHECKED):
        return False
    part, least = DIFFERENCE
    steps = np.maximum(part / np.sqrt(np.maximum(np.diag(hessian), 1e-300)), least)
    moved = np.repeat(at.vector[None], inputs, axis=0)
    for case in work.cases:
        for k in case.free:
            column = case.columns[k]
            moved[k, column] = at.vector[column] + steps[column]
    used = sorted({int(k) for case in work.cases for k in case.free})
    real = work.run(moved[used])
    if not all(np.isfinite(values).all() for blocks in real for values in blocks):
        return False
    for k, case in enumerate(work.cases):
        rows = [used.index(int(i)) for i in case.free]
        values = [np.concatenate([one, other[rows]]) for one, other in zip(at.real[k], real[k], strict=True)]
        work.tangent(k, at.vector, 1.0 / steps[case.columns[case.free]], values)
    return True
