"""Dataset of requirements from samples: importance of inputs, derivatives, and design points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import ndtr

import uqmbd
from uqmbd.extend import requirements_dataset
from uqmbd.results import requirement_names
from uqmbd.typing import Array
from uqmbd_reliability.analysis import Analysis
from uqmbd_reliability.estimating import derivatives, weighted_interval, with_any
from uqmbd_reliability.searching import DesignPoint
from uqmbd_reliability.space import StandardSpace

__all__ = ["described", "intervals_over_time"]


def described(
    problem: uqmbd.extend.Problem,
    requirements: Sequence[uqmbd.extend.Requirement],
    space: StandardSpace,
    found: Analysis,
    running: Array,
    attrs: dict[str, Any],
    time_of: Callable[[Array, int, Array], float],
) -> xr.Dataset:
    """Return the dataset ``requirements`` of an analysis.

    `running` (N, requirement, T): running margins of the samples; `time_of`: function that returns the time at which
    the margin of a requirement is smallest at a point (d,), from times (T,).
    """
    times = np.asarray(problem.over if problem.over is not None else problem.times, dtype=float)
    sampled, estimates = found.sampled, found.estimates
    names = requirement_names(requirements)
    lost = min(float(sampled.failures.mean()), 1.0 - 1e-12)
    with np.errstate(invalid="ignore"):
        by_time = np.where(with_any(running) < 0, sampled.ratio[:, None, None], 0.0)
    by = by_time.mean(axis=0) / (1.0 - lost)
    probability = np.array([one.probability for one in estimates])
    margins = with_any(sampled.margins)
    violations = np.where(margins < 0, sampled.ratio[:, None], 0.0)
    own = [[p for p in found.design_points if p.requirement == k] for k in range(len(requirements))]
    if len(names) > len(requirements):
        own.append(sorted(found.design_points, key=lambda p: p.beta))
    importance = np.array(
        [_importance(space, points, violations[:, k], sampled.points) for k, points in enumerate(own)]
    )
    gradient, error = _gradient(space, violations, sampled.points, sampled.failures)
    if found.dependent:
        error[:] = np.nan
    if space.paths:  # most violations are due to the noise, which has no direction; keys have no mean and deviation
        importance[:] = gradient[..., space.paths] = error[..., space.paths] = np.nan
    variables = {
        **_design_points(space, own, lambda p: time_of(p.point, p.requirement, times)),
        "importance": (
            ("requirement", "input"),
            importance,
            {
                "long_name": "importance of the input for the requirement",
                "comment": "squared direction cosines at the design points, weighted by their probabilities; without "
                "a design point, from the second moments of violations",
            },
        ),
        "probability_gradient": (
            ("requirement", "moment", "input"),
            gradient,
            {
                "long_name": "derivative of the probability with respect to mean and standard deviation of the input",
                "comment": "for a shift and a scaling of the standard normal variable of the input, so that a bounded "
                "input keeps its bounds; NaN for dependent inputs without a Gaussian copula",
            },
        ),
        "probability_gradient_error": (
            ("requirement", "moment", "input"),
            error,
            {"long_name": "standard error of the derivative of the probability"},
        ),
    }
    lower, upper = (np.array([getattr(one, end) for one in estimates]) for end in ("lower", "upper"))
    by = np.minimum(by, 1.0)
    data = requirements_dataset(
        requirements,
        violation_probability=probability,
        std_error=[one.error for one in estimates],
        lower=lower,
        upper=upper,
        times=times,
        violated_by=by,
        violated_by_interval=intervals_over_time(by, by_time, lower, upper, dependent=found.dependent),
        variables=variables,
        attrs=attrs,
    )
    return data.assign_coords({**problem.labels.input_coords(), "moment": ["mean", "standard deviation"]})


def intervals_over_time(
    by: Array, violations: Array, lower: Array, upper: Array, *, dependent: bool
) -> tuple[Array, Array]:
    """Return intervals (R, T) of the probabilities `by` (R, T) of a violation until each time.

    `violations` (N, R, T) are the weights of samples that have violated a requirement by a time, otherwise zero.
    `lower` and `upper` (R,) are the ends for the whole motion. This interval may be wider than the interval of the
    weights, because realisations failed, or because the splitting contradicts the samples. Intervals at earlier times
    are widened by the same excess. At times without a violation so far, and for dependent samples, the interval is from
    0 to the upper end for the whole motion.
    """
    low, high = np.zeros_like(by), np.broadcast_to(upper[:, None], by.shape).copy()
    for k in range(len(by)):
        last = violations[:, k, -1]
        if dependent or not last.any():
            continue
        whole = weighted_interval(last, 0)
        excess, share = max(upper[k] - whole[1], 0.0), min(lower[k] / whole[0], 1.0)
        known: dict[int, tuple[float, float]] = {}  # violations are permanent, so equal counts are equal samples
        for n in range(by.shape[1] - 1):
            weights = violations[:, k, n]
            count = int(np.count_nonzero(weights))
            if count and count not in known:
                known[count] = weighted_interval(weights, 0)
            if count:
                low[k, n] = share * known[count][0]
                high[k, n] = min(known[count][1] + excess, upper[k])
    low[:, -1], high[:, -1] = lower, upper
    return np.minimum(low, by), np.maximum(high, by)


def _design_points(
    space: StandardSpace, own: list[list[DesignPoint]], time_of: Callable[[DesignPoint], float]
) -> dict[str, tuple[Any, ...]]:
    most = max(map(len, own), default=0)
    shape = (len(own), most, space.dimension)
    germs, inputs = np.full(shape, np.nan), np.full(shape, np.nan)
    beta, times = np.full(shape[:2], np.nan), np.full(shape[:2], np.nan)
    for k, points in enumerate(own):
        for place, point in enumerate(points):
            germs[k, place], beta[k, place] = point.point, point.beta
            inputs[k, place] = space.to_inputs(point.point[None])[0]
            times[k, place] = time_of(point)
    dims = ("requirement", "point", "input")
    return {
        "design_points": (
            dims,
            inputs,
            {"long_name": "most likely violation", "comment": "in the inputs' units"},
        ),
        "design_points_standard": (
            dims,
            germs,
            {
                "long_name": "most likely violation, in the standard normal space",
                "comment": f"of the variables {'; '.join(space.space.names)}",
            },
        ),
        "design_times": (
            dims[:2],
            times,
            {
                "long_name": "time of the most likely violation",
                "units": "s",
                "comment": "first output time at which the margin is smallest, in the computed realisation nearest to "
                "the design point; NaN for requirements that are not over time",
            },
        ),
        "beta": (
            dims[:2],
            beta,
            {"long_name": "reliability index", "comment": "distance of the design point from the origin"},
        ),
    }


def _importance(space: StandardSpace, points: list[DesignPoint], violations: Array, samples: Array) -> Array:
    if points:
        _, inverse = space.own()
        # an input whose dependence has no separate normal variable keeps the importance of its germ
        odd = np.asarray(np.isnan(inverse).any(axis=1))
        inverse = np.where(odd[:, None], np.eye(len(inverse)), inverse)
        rows: Array = np.array([inverse @ point.direction for point in points]) ** 2
        shares = np.asarray(ndtr([-point.beta for point in points]))
        found = shares / max(shares.sum(), 1e-300) @ (rows / rows.sum(axis=1, keepdims=True))
        return np.asarray(found / found.sum())
    total = violations.sum()
    if not total > 0:
        return np.full(space.dimension, np.nan)
    # for a plane, this is also proportional to the squared direction cosines
    excess = np.maximum(violations @ (samples**2) / total - 1.0, 0.0)
    return np.asarray(excess / excess.sum()) if excess.sum() > 0 else np.full(space.dimension, np.nan)


def _gradient(space: StandardSpace, violations: Array, samples: Array, failures: Array) -> tuple[Array, Array]:
    """Return derivatives by mean and deviation of the inputs, and their errors, each (requirement, 2, input)."""
    scores, slopes = space.scores(samples), space.moment_slopes()
    shape = (violations.shape[1], 2, space.dimension)
    value, error = np.full(shape, np.nan), np.full(shape, np.nan)
    back = np.full((2, 2, space.dimension), np.nan)
    for i in range(space.dimension):
        if np.isfinite(slopes[:, :, i]).all() and abs(np.linalg.det(slopes[:, :, i])) > 0:
            # derivatives of the normal variable's parameters by moments of the input
            back[:, :, i] = np.linalg.inv(slopes[:, :, i])
    for k in range(shape[0]):
        by, covariance = derivatives(violations[:, k], scores, failures)
        value[k] = np.einsum("pi,pmi->mi", by, back)
        error[k] = np.sqrt(np.maximum(np.einsum("pmi,pqi,qmi->mi", back, covariance, back), 0.0))
    return value, error
