"""Factors of least cost for which the probability of a violation, by samples of a surrogate, equals the target."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.optimize
from scipy import stats
from scipy.special import ndtr

from uqmbd.typing import Array, Index
from uqmbd_reliability.allocation.surrogates import MarginSurrogate
from uqmbd_reliability.allocation.tightening import Tightened

__all__ = ["MarginSamples", "Tightest", "cheapest"]

SMOOTH = 0.05
"""Width of the smooth step from safe to violated, relative to the standard deviation of the margin."""

NEAR = 4.0
"""Distance from the limit, in widths, beyond which a sample does not contribute to the derivative."""

STEP = 1e-4
"""Step of the logarithm of a factor, for the derivative of a margin."""

ITERATIONS = 60

AFFINE = 64
"""Number of samples that test whether germs are affine maps of inputs."""

COARSE, COARSE_HITS = 2**16, 600
"""Least number of samples for the optimisation, and least expected number of violations among them. The final count
uses all samples."""

CLOSE = 5e-4
"""Relative error of the final common factor."""


@dataclass(frozen=True, eq=False)
class MarginSamples:
    """Samples of the present inputs, tightened by factors, and their margins by a surrogate."""

    germs: Array  # (N, d)
    tightened: Tightened  # inputs, scaled about their means by factors
    surrogate: MarginSurrogate  # surrogate of the margins

    @cached_property
    def centres(self) -> Array | None:
        """Germs (n,) of the centres of contraction; None if a germ is not an affine map of its input.

        If all germs are affine maps, as for normal, truncated and uniform inputs, they are contracted like the inputs.
        Contraction takes a hundredth of the time of mapping the inputs.
        """
        few, columns = self.germs[:AFFINE], self.tightened.columns
        ones = np.ones(len(columns))
        drawn = [self._mapped(few, factor * ones)[:, columns] for factor in (0.0, 0.3, 1.0)]
        straight = np.allclose(drawn[1], 0.7 * drawn[0] + 0.3 * drawn[2], rtol=0, atol=1e-9)
        return np.asarray(drawn[0][0]) if straight else None

    def _mapped(self, germs: Array, factors: Array) -> Array:
        space = self.surrogate.space
        return space.to_germs(self.tightened.values(space.to_inputs(germs), factors))

    def at(self, factors: Array, rows: Index | None = None) -> Array:
        """Return the germs of tightened samples, shape (N, d)."""
        germs = self.germs if rows is None else self.germs[rows]
        if self.centres is None:
            return self._mapped(germs, factors)
        found, columns = germs.copy(), self.tightened.columns
        found[:, columns] = self.centres + factors * (germs[:, columns] - self.centres)
        return found

    def least(self, factors: Array, rows: Index | None = None) -> Array:
        """Return the smallest margin of each sample, shape (N,)."""
        return np.asarray(self.surrogate.margins(self.at(factors, rows)).min(axis=1))

    def probability(self, factors: Array) -> float:
        """Return the share of samples that are violations."""
        return float(np.mean(self.least(factors) < 0))

    def smooth(self, logarithms: Array, width: float) -> tuple[float, Array]:
        """Return a smooth estimate of the probability, and its derivatives by the logarithms of the factors, (n,)."""
        factors = np.exp(logarithms)
        least = self.least(factors)
        probability = float(ndtr(-least / width).mean())
        near = np.flatnonzero(np.abs(least) < NEAR * width)
        density = stats.norm.pdf(least[near] / width) / width
        slope = np.zeros(len(factors))
        for k in range(len(factors)):
            ends = [factors * np.exp(sign * STEP * (np.arange(len(factors)) == k)) for sign in (1, -1)]
            above, below = (self.least(end, near) for end in ends)
            slope[k] = -(density * (above - below)).sum() / (2 * STEP * len(least))
        return probability, slope


@dataclass(frozen=True, eq=False)
class Tightest:
    """Result of the optimisation of tolerances."""

    factors: Array  # (n,) factors of the tolerances
    probability: float  # share of violations among the samples of the surrogate
    slope: Array  # (n,) relative change of the probability for a relative change of each tolerance
    alike: float  # cost of tightening all tolerances by one common factor instead


def cheapest(
    surrogate: MarginSurrogate, tightened: Tightened, germs: Array, target: float, narrowest: float
) -> Tightest:
    """Return the factors of least cost between `narrowest` and 1 whose probability is at most `target`.

    Sequential quadratic programming (SciPy's SLSQP) finds the logarithms of the factors from the reliability index of
    the smooth probability. Then all factors within their bounds are multiplied by one number, so that the count equals
    the target.

    If no factors reach the probability, all of them are `narrowest`.
    """
    fine = MarginSamples(germs, tightened, surrogate)
    count = len(tightened.names)
    loose = np.ones(count)
    loosest = fine.probability(loose)
    coarse = MarginSamples(germs[: max(COARSE, int(COARSE_HITS / target))], tightened, surrogate)
    width = _width(coarse, loose)
    if loosest <= target:
        return Tightest(loose, loosest, _slope(coarse, loose, width), tightened.cost(loose))
    tightest = loose * narrowest
    tight = coarse.probability(tightest)
    if tight > target:
        still = fine.probability(tightest)
        return Tightest(tightest, still, _slope(coarse, tightest, width), tightened.cost(tightest))
    start = _scaled_to_target(coarse, loose, target, narrowest)
    width = _width(coarse, start)
    index = -float(stats.norm.ppf(target))
    scale = tightened.cost(start)

    def reserve(x: Array) -> float:
        return float(-stats.norm.ppf(np.clip(coarse.smooth(x, width)[0], 1e-12, 1 - 1e-12))) - index

    def reserve_slope(x: Array) -> Array:
        probability, slope = coarse.smooth(x, width)
        return np.asarray(-slope / stats.norm.pdf(stats.norm.ppf(np.clip(probability, 1e-12, 1 - 1e-12))))

    outcome = scipy.optimize.minimize(
        lambda x: tightened.cost(np.exp(x)) / scale,
        np.log(start),
        jac=lambda x: tightened.slope(np.exp(x)) / scale,
        method="SLSQP",
        bounds=[(np.log(narrowest), 0.0)] * count,
        constraints={"type": "ineq", "fun": reserve, "jac": reserve_slope},
        options={"maxiter": ITERATIONS, "ftol": 1e-7},
    )
    shape = np.exp(np.clip(outcome.x, np.log(narrowest), 0.0))
    if tightened.cost(_scaled_to_target(coarse, shape, target, narrowest)) > scale:  # not better than one common factor
        shape = start
    factors = _scaled_to_target(fine, shape, target, narrowest, near=0.1)
    return Tightest(factors, fine.probability(factors), _slope(coarse, factors, width), scale)


def _width(samples: MarginSamples, factors: Array) -> float:
    """Return the width of the smooth step from safe to violated."""
    least = samples.least(factors)
    return max(SMOOTH * float(least.std()), np.finfo(float).eps * float(np.abs(least).max()), 1e-300)


def _slope(samples: MarginSamples, factors: Array, width: float) -> Array:
    probability, slope = samples.smooth(np.log(factors), width)
    return np.asarray(slope / max(probability, 1e-300))


def _scaled_to_target(
    samples: MarginSamples, factors: Array, target: float, narrowest: float, near: float = np.inf
) -> Array:
    """Multiply factors by one number, within their bounds, so that the count of violations equals the target.

    The search first tries numbers within `near` of 1, in logarithms.
    """

    def scaled(logarithm: float) -> Array:
        return np.asarray(np.clip(factors * np.exp(logarithm), narrowest, 1.0))

    least, most = float(np.log(narrowest / factors.max())), float(-np.log(factors.min()))
    low, high = max(least, -near), min(most, near)
    if low > least and samples.probability(scaled(low)) > target:
        low, high = least, low
    elif high < most and samples.probability(scaled(high)) <= target:
        low, high = high, most
    while high - low > CLOSE:
        middle = (low + high) / 2
        if samples.probability(scaled(middle)) > target:
            high = middle
        else:
            low = middle
    return scaled(low)
