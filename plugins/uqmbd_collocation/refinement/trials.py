"""End of a refinement by the errors of mean and standard deviation at fresh points.

The points at which a refinement checks its steps select favourable errors.  A trial therefore computes new points, and
only these state the errors.  Four looks at fresh points together accept a too small bound in at most 5 % of runs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import uqmbd
from uqmbd.typing import Array, Index
from uqmbd_collocation.refinement.steps import Limits, missed_share, scale_of
from uqmbd_collocation.runs import CollocationRuns

__all__ = ["LOOKS", "Trials", "enough_points"]

LOOKS = 4
"""Maximum number of comparisons of bounds from fresh points with the limit, in all trials."""

LEAST = 32
"""Minimum number of points of a trial."""

FURTHER = 48
"""Maximum number of points of a trial, in addition to the number of all realisations so far."""

GROWTH = 1.25
"""Ratio of successive numbers of points that are considered for a trial."""

FIRST = 0.25
"""Number of points of the first look of a trial, relative to their predicted number."""

STREAM = 0x7E5200
"""Random stream of the points of the first look."""

STUDENT = 2.4
"""Quantile of Student's t of a look, for about 30 realisations, at one of `LOOKS` looks."""

SCATTER = 0.5
"""Expected scatter of an estimate, in standard errors, which increases the bound."""


@dataclass(frozen=True, eq=False)
class _Scatter:
    """Estimate of an expectation (O, T): its significant part, and the scatter of one realisation."""

    significant: Array
    single: Array

    @classmethod
    def of(cls, values: Array, weights: Array) -> _Scatter:
        """Estimate from values (V, O, T) of realisations with weights (V,)."""
        share = (weights / weights.sum()).reshape(-1, 1, 1)
        mean, count = (share * values).sum(axis=0), len(values)
        error = np.sqrt(count / (count - 1) * (share**2 * (values - mean) ** 2).sum(axis=0))
        return cls(np.sign(mean) * np.maximum(np.abs(mean) - error, 0.0), np.sqrt(count) * error)


def enough_points(wrong: Array, products: Array, weights: Array, std: Array, limit: float, most: int) -> int | None:
    """Return the smallest number of fresh points whose bounds are probably at most `limit`; None above `most`.

    `wrong`, `products` (V, O, T): contributions of known realisations to the errors of mean and variance; `weights`
    (V,); `std` (O, T): standard deviation of the surrogate. The significant part of the estimates counts as error, and
    at least the mean square error for the variance, by which a projection underestimates it.

    >>> wrong = np.tile([0.1, -0.1], 8)[:, None, None]
    >>> enough_points(wrong, 2 * wrong, np.ones(16), np.ones((1, 1)), 0.05, 100)
    50
    """
    if most < LEAST:
        return None
    mean, product = _Scatter.of(wrong, weights), _Scatter.of(products, weights)
    square = np.average(wrong**2, axis=0, weights=weights)
    low, high = np.minimum(product.significant, 0.0), np.maximum(product.significant, square)
    counts = LEAST * GROWTH ** np.arange(1 + int(np.log(most / LEAST) / np.log(GROWTH)))
    for count in [int(number) for number in counts]:
        part = (STUDENT + SCATTER) / np.sqrt(count)
        below = std - np.sqrt(np.maximum(std**2 + low - part * product.single, 0.0))
        above = np.sqrt(std**2 + high + part * product.single) - std
        in_mean = np.abs(mean.significant) + part * mean.single
        if max(below.max(), above.max(), in_mean.max()) <= limit:
            return count
    return None


@dataclass
class Trials:
    """Verification points of a refinement, and its trials with fresh points."""

    runs: CollocationRuns
    points: uqmbd.extend.VerificationPoints  # all points so far
    limits: Limits
    fresh: uqmbd.extend.VerificationPoints | None = None  # points of all trials
    confirming: uqmbd.extend.VerificationPoints | None = None  # points that confirmed the end
    looks: int = 0

    def missed(self, coefficients: Array, multi_index: Index) -> float:
        """Return the missing part of the standard deviation at all points so far."""
        return missed_share(self.runs, coefficients, multi_index, self.points)

    def end(self, coefficients: Array, multi_index: Index, error: float) -> bool:
        """Return whether fresh points confirm errors of mean and standard deviation below the limit.

        `error`: root mean square error of single realisations, over the largest standard deviation. There is no trial
        if more nodes probably cost less than its points.
        """
        limit, worst = self.limits.moments, self.limits.error
        if limit is None or worst is None or not np.isfinite(error):
            return False
        spent, nodes = len(self.runs), len(self.runs) - len(self.points)
        # the nodes of a method whose error decreases like that of samples
        costs = nodes * ((error / worst) ** 2 - 1)
        most = int(min(spent + FURTHER, costs, self.limits.most - self.limits.reserved - spent))
        own = self.points[:0]
        while self.looks < LOOKS:
            count = self._count(coefficients, multi_index, limit, most)
            if count is None:
                return False
            # few known points predict too many; a bound above the limit needs more points than before
            count = max(count, int(GROWTH * len(own))) if len(own) else max(LEAST, round(FIRST * count))
            if count > most:
                return False
            own = self._with_more(own, count - len(own))
            found = self._bounds(coefficients, multi_index, own)
            if found is None:
                return False
            if (found <= limit * self._scale(coefficients)).all():
                self.confirming = own
                return True
        return False

    def _with_more(self, own: uqmbd.extend.VerificationPoints, count: int) -> uqmbd.extend.VerificationPoints:
        """Return the points of a trial with `count` new ones, which are computed later."""
        drawn = uqmbd.extend.VerificationPoints.drawn
        new, joined = drawn(self.runs.space, count, self.limits.seed, STREAM + self.looks), type(own).joined
        self.looks += 1
        self.fresh = new if self.fresh is None else joined([self.fresh, new])
        self.points = joined([self.points, new])
        return joined([own, new])

    def _scale(self, coefficients: Array) -> Array:
        variance = np.sum(coefficients[1:] ** 2, axis=0)
        return scale_of(self.runs, coefficients[0], variance)[:, None]

    def _count(self, coefficients: Array, multi_index: Index, limit: float, most: int) -> int | None:
        """Return the number of points of a trial, from the scatter at all points so far; None: no trial."""
        known = self.runs.verification(self.points)
        if most < LEAST or len(known) < 2:
            return None
        surrogate = np.einsum("kp,pot->kot", self.runs.space.evaluate(known.points.germs, multi_index), coefficients)
        scale = self._scale(coefficients)
        wrong = (known.response - surrogate) / scale
        products = wrong * (known.response + surrogate - 2 * coefficients[0]) / scale
        std = np.sqrt(np.sum(coefficients[1:] ** 2, axis=0)) / scale
        return enough_points(wrong, products, known.points.weights, std, limit, most)

    def _bounds(self, coefficients: Array, multi_index: Index, points: uqmbd.extend.VerificationPoints) -> Array | None:
        """Return bounds (2, O, T) of the errors of mean and standard deviation; None if too many points failed."""
        known, labels = self.runs.verification(points), self.runs.problem.labels
        if not len(known):
            return None
        chaos = known.chaos(coefficients, multi_index, labels)
        found = known.moment_errors(chaos.mean, chaos.std, [chaos], [known], [1.0], labels, looks=LOOKS)
        shape = (len(labels.outputs), -1)
        return np.array([values.values.reshape(shape) for values in found.data_vars.values()]) if found else None
