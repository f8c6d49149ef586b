"""Control variates: mean and variance of samples, with a surrogate of known moments, or a low-cost model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uqmbd.typing import Array
from uqmbd_montecarlo.jointmoments import JointMoments

__all__ = ["FOLDS", "LEAST_SAMPLES", "Controlled", "controlled_statistics", "controls", "fold_of", "variables"]


FOLDS = 10
"""Parts of the samples; the factors of each part come from the others, so that they do not depend on it."""

LEAST_SAMPLES = 5 * FOLDS
"""With fewer samples the factors are too uncertain: a poor surrogate would increase the error."""

# What is gathered of each sample. The responses are not gathered themselves but by what the surrogate leaves of them:
# where it is good, no digits are lost.
_D, _W, _I, _Z1, _Z2 = range(5)
_MEAN_TARGETS, _ALL_TARGETS = (_D, _I), (_D, _W, _I)


@dataclass(frozen=True)
class Controlled:
    """Estimates with a control, each of shape (C,), in the units of `variables`; variances in their square."""

    mean: Array  # of the responses less the shift
    variance: Array  # of the responses
    error_mean: Array  # standard error, as `error_variance`
    error_variance: Array
    alone_mean: Array  # standard error without control, as `alone_variance`
    alone_variance: Array
    reduction_mean: Array
    """Variance of the estimate without control over that with it, as `reduction_variance`; at most 4.5e15."""
    reduction_variance: Array


def fold_of(index: ArrayLike, samples: int) -> NDArray[np.int64]:
    """Return the fold of each sample: equal parts in sequence."""
    return np.asarray(index, dtype=np.int64) * FOLDS // samples


def variables(response: Array, surrogate: Array, fine: NDArray[np.bool_]) -> Array:
    """Return I u - z, I u^2 - z^2, I, and the controls z and z^2 - 1 of samples, shape (S, 5, C).

    u is the `response` (S, C) less the shift (a number near its mean, the same for all samples), over the surrogate's
    deviation; its values at failed samples have no effect. z is the `surrogate` (S, C) less its expectation, over its
    deviation. I is 1 for a sample that succeeded (`fine`), else 0. The expectations of the controls over all samples,
    failed ones included, are zero.
    """
    found = np.empty((len(fine), 5, response.shape[1]))
    good = fine[:, None]
    u = np.where(good, response, 0.0)
    found[:, _D] = u - surrogate
    # u^2 - z^2 without cancellation
    found[:, _W] = found[:, _D] * (u + surrogate)
    found[:, _I] = good
    found[:, _Z1] = surrogate
    found[:, _Z2] = surrogate**2 - 1.0
    return found


def controls(surrogate: Array) -> Array:
    """Return the moments of realisations of the surrogate alone, shape (S, 2, C), from those of `variables`."""
    return np.stack([surrogate, surrogate**2 - 1.0], axis=1)


def controlled_statistics(folds: Sequence[JointMoments], further: JointMoments | None = None) -> Controlled:
    """Estimate mean and variance from `folds` of `variables` with a surrogate as control variate, cross-fitted.

    The mean of fold k is mean(u_k) - b_k mean(z_k), whose factor b_k is the regression coefficient of the other folds:
    it is independent of the fold, so the estimate is unbiased for any surrogate (Avramidis and Wilson, A splitting
    scheme for control variates, 1993; Glasserman, Monte Carlo Methods in Financial Engineering, 2003, section 4.1). The
    second moment is estimated likewise with the controls z and z^2 - 1; the square of the mean (with the same
    controls), less its own variance, is subtracted. So the variance is unbiased except for the error of that last term.
    Standard errors come from the residuals, each with the factors of the other folds. The errors of the variance come
    from fourth powers: with heavy tails they are too small, more often so where the surrogate is good everywhere but in
    the tails.

    If the expectations of the controls are unknown, their means over `further` replace them. These are moments of
    `controls` at two or more independent realisations of the surrogate: approximate control variates (Gorodetsky et
    al., Journal of Computational Physics 408 (2020) 109257). With two levels they are multifidelity Monte Carlo
    (Peherstorfer, Willcox and Gunzburger, SIAM Journal on Scientific Computing 38 (2016) A3163-A3194). With n samples
    and N further realisations the best factors are those above times N / (n + N). The variance of these means is added
    to that of the estimate.

    Where samples failed, responses and successes are estimated alike, and divided: the statistics are those of the
    inputs that do not fail, as without a control, though the surrogate's expectation is known over all inputs only.
    """
    used = [fold for fold in folds if fold.count]
    others = _others(used)
    plain = _moments(*_estimate(used, others, _ALL_TARGETS, (), None))
    both = _moments(*_estimate(used, others, _ALL_TARGETS, (_Z1, _Z2), further))
    (response, success), covariance = _estimate(used, others, _MEAN_TARGETS, (_Z1,), further)
    mean = response / success
    of_mean = _quadratic(np.stack([1 / success, -mean / success]), covariance)
    return Controlled(
        mean,
        both[1],
        np.sqrt(of_mean),
        np.sqrt(both[3]),
        np.sqrt(plain[2]),
        np.sqrt(plain[3]),
        _ratio(plain[2], of_mean),
        _ratio(plain[3], both[3]),
    )


def _moments(values: Array, covariance: Array) -> tuple[Array, Array, Array, Array]:
    """Mean and variance of the samples that succeeded, and the variances of both estimates."""
    response, square, success = values[0], values[1] + 1.0, values[2]
    mean, second = response / success, square / success
    of_mean = _quadratic(np.stack([1 / success, 0 * mean, -mean / success]), covariance)
    slope = np.stack([-2 * mean / success, 1 / success, (2 * mean**2 - second) / success])
    # the square of the mean exceeds that of the expectation by the variance of the mean, whose own square counts twice
    return mean, second - mean**2 + of_mean, of_mean, _quadratic(slope, covariance) + 2 * of_mean**2


def _estimate(
    folds: Sequence[JointMoments],
    others: Sequence[JointMoments],
    targets: tuple[int, ...],
    controls: tuple[int, ...],
    further: JointMoments | None,
) -> tuple[Array, Array]:
    """Estimate expectations of targets (N, C) with controls, and the covariance (N, N, C) of these estimates."""
    count = sum(fold.count for fold in folds)
    weight = 1.0 if further is None else further.count / (count + further.count)
    total: JointMoments | None = None
    factors = np.zeros((len(targets), 2, folds[0].mean.shape[1]))
    for fold, rest in zip(folds, others, strict=True):
        matrix, taken = _residual(rest, targets, controls, weight)
        residual = fold.transformed(matrix)
        if further is not None:
            expected = np.einsum("nvc,vc->nc", taken, further.mean)
            residual = replace(residual, mean=residual.mean + expected)
            factors += taken * (fold.count / count)
        total = residual if total is None else total.merge(residual)
    if total is None:
        raise ValueError("no samples")
    covariance = total.products / (count * (count - 1))
    if further is not None:
        covariance += further.transformed(factors).products / (further.count * (further.count - 1))
    return total.mean, covariance


def _residual(
    fitted_to: JointMoments, targets: tuple[int, ...], controls: tuple[int, ...], weight: float
) -> tuple[Array, Array]:
    """Return the matrix (N, 5, C) that maps `variables` to targets less their regression on the controls, weighted.

    Also the factors (N, 2, C) of both controls that are taken off.
    """
    columns = fitted_to.mean.shape[1]
    matrix, taken = np.zeros((len(targets), 5, columns)), np.zeros((len(targets), 2, columns))
    for row, off, target in zip(matrix, taken, targets, strict=True):
        row[target] = 1.0
        # a response is what the surrogate leaves of it, and the surrogate: its factor in the response is one more
        own = {_D: (_Z1,), _W: (_Z2,), _I: ()}[target]
        for control in own:
            row[control] = 1.0 if control not in controls else 1.0 - weight
        for control, factor in zip(controls, _regression(fitted_to.products, target, controls), strict=True):
            row[control] -= weight * factor
            off[control - _Z1] = weight * (factor + float(control in own))
    return matrix, taken


def _regression(products: Array, target: int, controls: tuple[int, ...]) -> list[Array]:
    """Return coefficients (C,) of the controls, one or two; 0 for a redundant control."""
    if not controls:
        return []
    first, *second = controls
    alone = _divided(products[first, target], products[first, first])
    if not second:
        return [alone]
    slope = _divided(products[first, second[0]], products[first, first])
    own = products[second[0], second[0]] - slope * products[first, second[0]]
    own = np.where(own > 1e-10 * products[second[0], second[0]], own, 0.0)
    factor = _divided(products[second[0], target] - slope * products[first, target], own)
    return [alone - slope * factor, factor]


def _others(folds: Sequence[JointMoments]) -> list[JointMoments]:
    """Moments of all folds but each, by merging from both ends."""
    empty = folds[0].empty()
    left, right = [empty], [empty]
    for fold in folds[:-1]:
        left.append(left[-1].merge(fold))
    for fold in folds[:0:-1]:
        right.append(right[-1].merge(fold))
    return [one.merge(other) for one, other in zip(left, reversed(right), strict=True)]


def _quadratic(vector: Array, matrix: Array) -> Array:
    return np.asarray(np.maximum(np.einsum("ic,ijc,jc->c", vector, matrix, vector), 0.0))


def _divided(value: Array, by: Array) -> Array:
    found: Array = np.divide(value, by, out=np.zeros_like(value), where=by > 0)
    return found


def _ratio(plain: Array, controlled: Array) -> Array:
    least = np.finfo(float).eps * plain
    found: Array = np.divide(plain, np.maximum(controlled, least), out=np.ones_like(plain), where=plain > 0)
    return found
