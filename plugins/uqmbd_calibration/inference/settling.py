"""Maxima of the posterior density on the mechanism: Gauss-Newton method in a trust region.

Each step computes one realisation and climbs on the surrogate, moved so that it is exact there, within the trust
region.  A surrogate over a wide prior can have slopes that are wrong by more than their size.  Where a step does not
gain about what the surrogate predicts, realisations about the point give the slopes instead (forward differences).  So
they do where a climb would end without any step: slopes that no step has tested may be wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.typing import Array
from uqmbd_calibration.inference.climbing import Peaks, climb
from uqmbd_calibration.inference.posterior import Predictor
from uqmbd_calibration.inference.working import CHECKED, CalibrationState

__all__ = ["Mode", "settle"]


MODES, WORSE = 4, 30.0
"""Maxima that are computed on the mechanism, and by how much their log-density may be below the best one's."""

AS_LIKELY = 3.0
"""Log-mass by which a reported, but not followed, maximum may be below the best one."""

SETTLED, SETTLING = 0.3, 24
"""Step, in standard deviations of the posterior, at which a maximum is found; and how many steps there are at most."""

POOR, GOOD, MORE = 0.25, 0.75, 2.0
"""Gain of a step over the predicted gain: slopes are wrong below the first and above the last one; a step may become
longer above the second one."""

FREE = 4
"""Steps by the slopes of the surrogate, at most."""

WIDEST = 2.0
"""Initial half-width of the trust region, in standard deviations of the prior."""

DIFFERENCE = 0.1, 1e-4
"""Forward differences: in standard deviations of the posterior, and at least of the prior."""


@dataclass(frozen=True, eq=False)
class Mode:
    """A maximum of the posterior density, on the mechanism."""

    vector: Array  # (N,): of unknowns
    log_density: float  # there
    log_mass: float  # logarithm of the mass that a normal distribution there has, up to a constant that all share


@dataclass(frozen=True, eq=False)
class _Computed:
    """Realisations of the cases at a vector: minus the log-density there, with the most probable noise levels."""

    vector: Array
    real: list[list[Array]]
    cost: float


@dataclass(frozen=True, eq=False)
class _Followed:
    """A maximum, and the best realisation on the way to it."""

    mode: Mode
    at: _Computed
    hessian: Array
    predictors: list[Predictor]

    def same(self, other: _Followed) -> bool:
        """Return whether another one ended in the same maximum, within a deviation."""
        away = other.mode.vector - self.mode.vector
        return bool(away @ self.hessian @ away < 1.0)


def settle(work: CalibrationState, peaks: Peaks) -> tuple[tuple[Mode, ...], Array, int]:
    """Follow the best maxima of the surrogate on the mechanism; the predictions are moved to the best of them.

    Returns the maxima, the best first, and the vector (N,) to start from. Also returns the number of maxima of the
    surrogate that are about as likely as the best one and were not followed.
    """
    found: list[_Followed] = []
    mass = -peaks.cost - 0.5 * np.linalg.slogdet(peaks.hessian)[1]
    unseen = mass > mass.max() - AS_LIKELY
    # the surrogate's maxima compete with the median of the prior, in case it is wrong about all of them
    centre = np.zeros_like(peaks.vectors[0])
    for k in range(min(MODES, len(peaks.cost))):
        if peaks.cost[k] > peaks.cost[0] + WORSE:
            break
        best = min((one.at.cost for one in found), default=np.inf)
        if not work.affordable(2 + (CHECKED if found else 0)):
            break
        unseen[k] = False
        starts = [peaks.vectors[k], *([] if found else [centre])]
        tried = [begun for start in starts if np.isfinite((begun := _computed(work, start)).cost)]
        if not tried:
            continue
        one = _followed(work, min(tried, key=lambda begun: begun.cost), best)
        if not any(other.same(one) for other in found):
            found.append(one)
    if not found:
        return (), peaks.vectors[0], int(unseen.sum())
    found.sort(key=lambda one: -one.mode.log_mass)
    work.predictors = list(found[0].predictors)
    return tuple(one.mode for one in found), found[0].mode.vector, int(unseen.sum())


def _followed(work: CalibrationState, start: _Computed, best: float) -> _Followed:
    """Climb from a realisation to a maximum; stop a climb that stays far above the cost `best` of another maximum."""
    at, width, exact, tested, possible, settled = start, WIDEST, False, False, True, False
    inputs = len(work.unknowns.inputs)
    # realisations that are too few for a check all go to the maximum
    reserve = CHECKED if work.affordable(2 * CHECKED) else 0
    work.shift(at.vector, at.real)
    peak = climb(work.target, at.vector[None], within=width)
    for taken in range(SETTLING):
        metric = peak.hessian[0]
        step = peak.vectors[0] - at.vector
        length = float(np.abs(step[:inputs]).max())
        near = float(np.sqrt(max(step @ metric @ step, 0.0))) < SETTLED and length < 0.99 * width
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
        # slopes are computed once at a point, and at each one after those of the surrogate were wrong
        if exact and gain > 0 and not _differences(work, at, metric):
            break
        if not exact and possible and (wrong or near):
            exact = possible = _differences(work, at, metric)
            width = WIDEST if exact else width
        if not exact:
            work.shift(at.vector, at.real)
        peak = climb(work.target, at.vector[None], within=width)
        if -float(peak.cost[0]) < -best - WORSE:
            break
    # a point that no realisation is near is no maximum on the mechanism
    place, cost = (peak.vectors[0], float(peak.cost[0])) if settled else (at.vector, at.cost)
    mass = -cost - 0.5 * float(np.linalg.slogdet(peak.hessian[0])[1])
    return _Followed(Mode(place, -cost, mass), at, peak.hessian[0], list(work.predictors))


def _computed(work: CalibrationState, vector: Array) -> _Computed:
    """Compute the realisations of a vector (N,); its noise levels become the most probable ones."""
    real = work.run(vector[None])
    target = work.target
    if all(np.isfinite(values).all() for blocks in real for values in blocks):
        vector = target.with_levels(vector[None], real)[0]
    density = float(target.log_likelihood(vector[None], real)[0]) - 0.5 * float(vector @ vector)
    return _Computed(vector, real, -density)


def _differences(work: CalibrationState, at: _Computed, hessian: Array) -> bool:
    """Give the predictions the slopes of the mechanism at a point; return whether they could be computed.

    An input that machines do not share is moved for all of them at once.
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
