"""Control variates for mean and variance of samples: a surrogate with known moments, or a low-cost model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uqmbd.typing import Array
from uqmbd_montecarlo.jointmoments import JointMoments

__all__ = ["FOLDS", "LEAST_SAMPLES", "Controlled", "controlled_statistics", "controls", "fold_of", "variables"]


FOLDS = 10
"""Number of parts of the samples; the factors of a part come from the other parts, and are therefore independent of
this part."""

LEAST_SAMPLES = 5 * FOLDS
"""Least number of samples; with fewer, uncertain factors of a poor surrogate would increase the error."""

# Indices of the variables of each sample. The variables are differences between response and surrogate instead of
# responses: this preserves digits if the surrogate is accurate.
_D, _W, _I, _Z1, _Z2 = range(5)
_MEAN_TARGETS, _ALL_TARGETS = (_D, _I), (_D, _W, _I)


@dataclass(frozen=True)
class Controlled:
    """Estimates with a control, each of shape (C,): means and errors of u as in `variables`, and variances of u."""

    mean: Array  # mean of the responses minus the shift
    variance: Array  # variance of the responses
    error_mean: Array  # standard error, like `error_variance`
    error_variance: Array
    alone_mean: Array  # standard error without control, like `alone_variance`
    alone_variance: Array
    reduction_mean: Array
    """Ratio of the variances of the estimate without and with control, like `reduction_variance`; at most 4.5e15."""
    reduction_variance: Array


def fold_of(index: ArrayLike, samples: int) -> NDArray[np.int64]:
    """Return the fold of each sample; folds are equal parts in sequence."""
    return np.asarray(index, dtype=np.int64) * FOLDS // samples


def variables(response: Array, surrogate: Array, fine: NDArray[np.bool_]) -> Array:
    """Return I u - z, I u^2 - z^2, I, and the controls z and z^2 - 1 of samples, shape (S, 5, C).

    I is 1 for a successful sample (`fine`), otherwise 0. `response` contains u, and `surrogate` contains z, of shape
    (S, C) each. The caller computes both: ``z = (value of the surrogate - m) / s`` and ``u = (response - shift) / s``.
    m and s are expectation and standard deviation of the surrogate over all inputs, or estimates of them. The shift is
    a number near the mean response. Values of u at failed samples have no effect. With exact m and s, the expectations
    of the controls over all inputs are zero, also if some realisations fail.
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
    """Return the controls z and z^2 - 1 of `variables`, shape (S, 2, C), for values z (S, C) of the surrogate alone."""
    return np.stack([surrogate, surrogate**2 - 1.0], axis=1)


def controlled_statistics(folds: Sequence[JointMoments], further: JointMoments | None = None) -> Controlled:
    """Return mean and variance from `folds` of `variables` with a surrogate as control variate, cross-fitted.

    The mean of fold k is mean(u_k) - b_k mean(z_k), with the regression coefficient b_k of the other folds. b_k is
    independent of fold k, so the estimate is unbiased for any surrogate (Avramidis and Wilson, A splitting scheme for
    control variates, 1993; Glasserman, Monte Carlo Methods in Financial Engineering, 2003, section 4.1). The second
    moment is estimated in the same way with the controls z and z^2 - 1. The variance is the second moment minus the
    square of the mean (with the same controls) plus the variance of the mean. So the estimate is unbiased except for
    the error of the variance of the mean. Standard errors are computed from the residuals of each fold, with the
    factors of the other folds. Errors of the variance are computed from fourth powers. With heavy tails, these errors
    may be too small; this is more frequent if the surrogate is accurate except in the tails.

    If the expectations of the controls are unknown, their means over `further` replace them. `further` contains moments
    of `controls` at two or more independent realisations of the surrogate. This method is known as approximate control
    variates (Gorodetsky et al., Journal of Computational Physics 408 (2020) 109257). With two levels, this method is
    multifidelity Monte Carlo (Peherstorfer, Willcox and Gunzburger, SIAM Journal on Scientific Computing 38 (2016)
    A3163-A3194). With n samples and N further realisations, the best factors are the above factors times N / (n + N).
    The variance of the means over `further` is added to the variance of the estimate.

    If samples fail, the expectations of responses and of successes are estimated in the same way. The estimate is the
    expectation of the responses divided by the expectation of the successes. As without a control, the statistics then
    refer to the inputs whose realisations succeed. The expectation of the surrogate is known only over all inputs.
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
    """Return mean and variance of the successful samples, and the variances of both estimates."""
    response, square, success = values[0], values[1] + 1.0, values[2]
    mean, second = response / success, square / success
    of_mean = _quadratic(np.stack([1 / success, 0 * mean, -mean / success]), covariance)
    slope = np.stack([-2 * mean / success, 1 / success, (2 * mean**2 - second) / success])
    # the square of the mean is biased by the variance of the mean; the error contains twice the square of this variance
    return mean, second - mean**2 + of_mean, of_mean, _quadratic(slope, covariance) + 2 * of_mean**2


def _estimate(
    folds: Sequence[JointMoments],
    others: Sequence[JointMoments],
    targets: tuple[int, ...],
    controls: tuple[int, ...],
    further: JointMoments | None,
) -> tuple[Array, Array]:
    """Return estimates of expectations of targets (N, C) with controls, and their covariance (N, N, C)."""
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
    """Return the matrix (N, 5, C) that maps `variables` to targets minus their weighted regression on the controls.

    Return also the factors (N, 2, C) of both controls that are subtracted.
    """
    columns = fitted_to.mean.shape[1]
    matrix, taken = np.zeros((len(targets), 5, columns)), np.zeros((len(targets), 2, columns))
    for row, off, target in zip(matrix, taken, targets, strict=True):
        row[target] = 1.0
        # a response is a difference plus the surrogate, so the factor of the control increases by one
        own = {_D: (_Z1,), _W: (_Z2,), _I: ()}[target]
        for control in own:
            row[control] = 1.0 if control not in controls else 1.0 - weight
        for control, factor in zip(controls, _regression(fitted_to.products, target, controls), strict=True):
            row[control] -= weight * factor
            off[control - _Z1] = weight * (factor + float(control in own))
    return matrix, taken


def _regression(products: Array, target: int, controls: tuple[int, ...]) -> list[Array]:
    """Return coefficients (C,) of one or two controls; 0 for a redundant control."""
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
    """Return, for each fold, the moments of all other folds, by merging from both ends."""
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
