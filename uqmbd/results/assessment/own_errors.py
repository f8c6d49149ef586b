"""Collect the stated errors of a method: standard errors of samples, and stated errors of surrogates."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.results.chaos import (
    StoredSurrogate,
    exceeds_locally,
    reference_spread,
    stored_surrogates,
)
from uqmbd.results.statistics import (
    divisor,
    independent_errors,
    integration_error,
    over_time,
    studentised,
    usual_errors,
    varying,
)
from uqmbd.status import Status
from uqmbd.typing import Array

__all__ = ["NO_SPREAD", "NO_VARIATION", "OwnError", "own_error", "replicates_of", "root_mean_square"]


NO_SPREAD = "no spread"
"""Kind of a verdict on an output that does not vary."""

NO_VARIATION = "does not vary beyond the integration error"
"""Statement on an output that does not vary."""

_REMEDIES = {"chaos": "raise the order", "elements": "increase max_elements, or raise the order"}

MOST_SAMPLES = 500
"""Maximum number of samples from which the correlation of neighbouring times is estimated."""

CONFIDENCE = 0.01
"""Probability that the error of a surrogate exceeds its bound, if its errors are normal."""


@dataclass(frozen=True, eq=False)
class OwnError:
    """Stated errors of the mean and standard deviation of a method, for O outputs and T times."""

    # mean, std, kurtosis: (O, T), the statistics themselves
    mean: Array
    std: Array
    kurtosis: Array
    # noise_mean, noise_std: (O, T), standard errors, 0 if the method states none. Some methods multiply standard errors
    # by a factor, so that 1.96 of them give a 95 % interval. If this factor is known, these fields are the errors
    # without the factor; each test of agreement computes the factor for its level
    noise_mean: Array
    noise_std: Array
    # (O, T): error bound of the surrogate for mean and standard deviation: its stated error times its standard
    # deviation, with a margin for few verification realisations; 0 if no error is stated
    bias: Array
    missed: Array  # (O, T): error bound `bias` without the margin
    # (O,): root mean square of the stated error over time, relative to the standard deviation; NaN if not stated
    stated: Array
    samples: int  # number of successful samples; 0 if the method has no standard errors
    freedom: float  # degrees of freedom of standard errors from samples; infinite for stated errors
    # (S, O, T): independent samples, from which the correlation of neighbouring times is estimated
    response: Array | None
    order: int | None  # order of a chaos
    # (O,): part of the standard deviation in the terms of the highest order of a chaos; NaN without one
    top_order: Array
    # (O, T): stated error at each time, relative to the standard deviation: 1.96 standard errors, or the stated error
    # of a surrogate; NaN if not stated
    stated_at: Array
    integration: Array  # (O, T): error of the integration, or of rounding
    # (O,): whether an output varies by more than the integration error; if not, known values of `stated`, `top_order`
    # and `stated_at` are 0
    varies: NDArray[np.bool_]
    surrogate: bool  # whether the method has a surrogate
    drawn: bool  # whether its standard errors come from samples
    words: tuple[tuple[str, str], ...]  # (O,): source of the stated error, and how to reduce it; may be empty

    def isel(self, used: NDArray[np.bool_]) -> OwnError:
        """Return the errors at selected times (T,)."""
        if used.all():
            return self
        names = ("mean", "std", "kurtosis", "noise_mean", "noise_std", "bias", "missed", "stated_at", "integration")
        parts = {name: getattr(self, name)[:, used] for name in names}
        return replace(self, **parts, response=None if self.response is None else self.response[:, :, used])

    def informed(self, other: OwnError) -> OwnError:
        """Increase the standard error of the standard deviation to the kurtosis of another method, if it is larger.

        Samples underestimate their error if they contain no realisation of a rare event. The kurtosis of a surrogate,
        or of other samples, may include the event. Stated errors of a method without samples remain unchanged.
        """
        if not self.drawn:
            return self
        known = np.isfinite(other.kurtosis) & (self.kurtosis > 1)
        excess = np.where(known, (other.kurtosis - 1) / np.where(known, self.kurtosis - 1, 1.0), 1.0)
        return replace(self, noise_std=self.noise_std * np.sqrt(np.maximum(excess, 1.0)))

    def relative(self, times: Array) -> Array:
        """Return the relative own error of the standard deviation (O,); infinite if unknown.

        The error is the root mean square over time of the sum of 1.96 standard errors and the error bound of the
        surrogate. The error is 0 for outputs that do not vary.
        """
        if not self.samples and np.isnan(self.stated).any():
            return np.full(len(self.std), np.inf)
        error, scale = _over_known(1.96 * self.noise_std + self.bias, self.std, times, np.isfinite(self.std))
        return np.where(self.varies & (scale != 0), np.nan_to_num(error / divisor(scale), nan=np.inf), 0.0)

    def largest(self, times: Array | None) -> tuple[Array, Array]:
        """Return the largest stated error (O,) of the standard deviation over times (T,), and its time (O,), in s.

        The error is relative to the standard deviation; infinite if no error is stated.
        """
        stated = np.where(np.isfinite(self.std).all(axis=0), self.stated_at, -np.inf)
        if not stated.shape[1]:
            return np.full(len(stated), np.inf), np.full(len(stated), np.nan)
        where = np.nan_to_num(stated, nan=-np.inf).argmax(axis=1)
        error = np.where(np.isnan(stated).all(axis=1), np.inf, stated[np.arange(len(stated)), where])
        at = np.full(len(stated), np.nan) if times is None else np.asarray(times, dtype=float)[where]
        return np.where(np.isfinite(error), error, np.inf), at

    def floored(self) -> NDArray[np.bool_]:
        """Return whether the lower limit of the denominator affects the largest stated error of each output (O,).

        The denominator of a stated error is the standard deviation, but at least 1 % of its maximum over time. The
        limit has an effect if some error, divided by the standard deviation at its time, exceeds the largest stated
        error.
        """
        stated = np.where(np.isfinite(self.std).all(axis=0), self.stated_at, 0.0)
        return exceeds_locally(stated, self.std, np.nan_to_num(stated).max(axis=-1, initial=0.0))


def root_mean_square(values: Array, times: Array) -> Array:
    """Return the root mean square over time (O,) of values (O, T), by the trapezoidal rule; NaN without times.

    >>> root_mean_square(np.array([[3.0, 3.0, 3.0], [0.0, 0.0, 0.0]]), np.array([0.0, 0.5, 1.0])).tolist()
    [3.0, 0.0]
    """
    if not values.shape[1]:
        return np.full(len(values), np.nan)
    if len(times) < 2:
        return np.asarray(np.abs(values).max(axis=1), dtype=float)
    # scale, so that squares of differences of 1e-200 do not underflow
    largest = np.abs(values).max(axis=1)
    scale = np.where((largest > 0) & np.isfinite(largest), largest, 1.0)
    mean_square = np.trapezoid((values / scale[:, None]) ** 2, times, axis=1) / (times[-1] - times[0])
    return np.asarray(scale * np.sqrt(mean_square), dtype=float)


def _over_known(error: Array, std: Array, times: Array, known: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return root mean squares (O,) of errors and standard deviations over known times (O, T); NaN without times."""
    # unknown errors of one output do not affect the other outputs
    rows = [(error[o : o + 1, used], std[o : o + 1, used], times[used]) for o, used in enumerate(known)]
    found = [[root_mean_square(x, at)[0] for x in (own, spread)] for own, spread, at in rows]
    squares: Array = np.array(found, dtype=float).reshape(len(std), 2)
    return squares[:, 0], squares[:, 1]


def own_error(node: xr.DataTree, rtol: float = 0.0, *, dependence: bool = True) -> OwnError:
    """Collect the stated errors of a method.

    `node`: node of a propagator, with statistics over time or of scalar outputs; `rtol`: tolerance of the integration,
    0 if unknown; `dependence`: whether to read samples for the correlation of neighbouring times.

    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels(["x"], [], [0.0, 1.0])
    >>> statistics = statistics_dataset(axes, mean=[[0.0, 0.0]], std=[[1.0, 1.0]], std_error_mean=[[0.1, 0.1]],
    ...                                 std_error_std=[[0.05, 0.1]])
    >>> node = propagator_node("a", statistics, propagator="p", realisations=100, wall_time=0.0)
    >>> found = own_error(node)
    >>> found.samples, found.noise_std.tolist(), found.relative(np.array([0.0, 1.0])).round(3).tolist()
    (100, [[0.05, 0.1]], [0.155])
    """
    statistics = node.children["statistics"].to_dataset()
    variables = statistics.variables
    mean, std = over_time(variables["mean"].values), over_time(variables["std"].values)
    noisy = {"std_error_mean", "std_error_std"} <= set(statistics.data_vars)
    count, replicates = _design(node)
    errors = [
        np.nan_to_num(over_time(variables[name].values), nan=np.inf) if noisy else np.zeros_like(mean)
        for name in ("std_error_mean", "std_error_std")
    ]
    noise = _before_widening(statistics, errors, count, replicates) if noisy else errors
    surrogates = stored_surrogates(node)
    bias, missed, stated, stated_at = _surrogate(surrogates, statistics, std)
    order, top = _orders(surrogates, len(mean))
    vary = varying(statistics, rtol)
    drawn = noisy and ("samples" in node.children or _option(node, "samples", None) is not None)
    # if the error of a surrogate is unknown, the sampling error of its moments must not replace it
    unknown = np.nan if surrogates and not drawn else 0.0
    larger = errors[1] if drawn else np.maximum(*errors)
    if noisy:
        relative = 1.96 * larger / divisor(reference_spread(np.nan_to_num(std)))
        stated_at = np.nan_to_num(stated_at, nan=unknown) + relative
    if noisy and not drawn:
        # the standard errors of a method without samples are its stated error
        times = variables["time"].values if "time" in statistics.dims else np.zeros(1)
        own, scale = _over_known(1.96 * larger, std, times, np.isfinite(std) & np.isfinite(larger))
        stated = np.where(scale == 0, 0.0, np.hypot(np.nan_to_num(stated, nan=unknown), own / divisor(scale)))
    plain = noisy and not replicates and "variance_reduction" not in statistics
    return OwnError(
        mean=mean,
        std=std,
        kurtosis=over_time(variables["kurtosis"].values) if "kurtosis" in statistics else np.full_like(std, 3.0),
        noise_mean=noise[0],
        noise_std=noise[1],
        bias=bias,
        missed=missed,
        stated=np.where(vary | np.isnan(stated), stated, 0.0),
        # standard errors of a surrogate are sampling errors of its moments, not errors of realisations
        samples=count if noisy and (drawn or not surrogates) else 0,
        freedom=float(max(replicates - 1 if replicates else count - 1, 1)) if drawn else np.inf,
        response=_response(node, mean.shape) if plain and dependence else None,
        order=order,
        top_order=np.where(vary | np.isnan(top), top, 0.0),
        stated_at=np.where(vary[:, None] | np.isnan(stated_at), stated_at, 0.0),
        integration=integration_error(statistics, rtol),
        varies=vary,
        surrogate=bool(surrogates),
        drawn=drawn,
        words=_words(surrogates, statistics, len(mean)),
    )


def _words(surrogates: Sequence[StoredSurrogate], statistics: xr.Dataset, outputs: int) -> tuple[tuple[str, str], ...]:
    """Return the source of the stated error of each output, and advice on reducing it: empty if unknown."""
    attrs = statistics["verification_error"].attrs if "verification_error" in statistics else {}
    name = str(attrs.get("named", ""))
    found = [(f"method ({name})" if name else "method", str(attrs.get("remedy", "")))] * outputs
    for part in surrogates:
        remedy = str(part.data.attrs.get("remedy", _REMEDIES["elements" if part.split else "chaos"]))
        for row in part.rows.tolist():
            found[row] = "surrogate", remedy
    return tuple(found)


def _before_widening(statistics: xr.Dataset, errors: list[Array], count: int, replicates: int) -> list[Array]:
    """Return standard errors (O, T) of mean and standard deviation without their widening, if it is known.

    Errors of replicates are widened for their small number. For independent samples the widening is known if the stated
    errors come from `sample_statistics`. A method of a plugin may state other errors.
    """
    if replicates:
        return [error / studentised(replicates) for error in errors]
    if count < 2 or not {"skewness", "kurtosis"} <= set(statistics.data_vars):
        return errors
    std, skewness, kurtosis = (over_time(statistics.variables[name].values) for name in ("std", "skewness", "kurtosis"))
    # an output that does not occur in some realisations has fewer samples
    share = over_time(statistics.variables["censored"].values) if "censored" in statistics else np.zeros((1, 1))
    there = np.maximum(np.rint((1.0 - share) * count), 2.0)
    widened, usual = independent_errors(std, skewness, kurtosis, there), usual_errors(std, kurtosis, there)
    found = []
    for error, wide, plain in zip(errors, widened, usual, strict=True):
        found.append(np.where(np.isclose(error, wide, rtol=1e-9, atol=0.0), plain, error))
    return found


def _design(node: xr.DataTree) -> tuple[int, int]:
    """Return the number of successful samples, and the number of replicates of a design (0: independent samples)."""
    count = int(node.attrs.get("realisations", 0)) - int(node.attrs.get("failures", 0))
    if "samples" in node.children:
        status = np.asarray(node.children["samples"].to_dataset(inherit=False).variables["status"].values)
        successful = int(np.count_nonzero(status == Status.OK))
        # realisations for other purposes, such as Sobol' indices, are not samples
        count = successful if len(status) == _option(node, "samples", len(status)) else max(successful, count)
    return count, replicates_of(node)


def replicates_of(node: xr.DataTree) -> int:
    """Return the number of independent replicates of a sampling design; 0 for independent samples."""
    if str(_option(node, "sampling", "random")) == "random" or "independent_samples" in node.attrs:
        return 0
    return max(int(_option(node, "replicates", 2)), 2)


def _option(node: xr.DataTree, name: str, default: Any) -> Any:
    try:
        return dict(json.loads(node.attrs.get("options", "{}"))).get(name, default)
    except (TypeError, ValueError):
        return default


def _surrogate(
    surrogates: Sequence[StoredSurrogate], statistics: xr.Dataset, std: Array
) -> tuple[Array, Array, Array, Array]:
    """Return the error of a surrogate: its bound (O, T), the bound without margin, and stated errors (O,) and (O, T).

    The values are the fields ``bias``, ``missed``, ``stated`` and ``stated_at`` of `OwnError`.
    """
    from scipy.special import chdtri

    # methods without a surrogate do not state the number of realisations behind their stated error; assume 8
    stated_at, verified = np.full_like(std, np.nan), np.full((len(std), 1), 8.0)
    sources = [(statistics, np.arange(len(std)))]
    for _, data, rows in surrogates:
        if "verification_weights" in data:
            # equivalent number of realisations of equal weight
            verified[rows] = 1 / np.sum(data["verification_weights"].values ** 2)
        else:
            verified[rows] = max(int(data.sizes.get("verification", 8)), 1)
        if "verification_error" not in statistics:
            sources.append((data, rows))
    sources = [(data, rows) for data, rows in sources if "verification_error" in data]
    if not sources:
        return np.zeros_like(std), np.zeros_like(std), np.full(len(std), np.nan), stated_at
    for data, rows in sources:
        error = data["verification_error"]
        others = [d for d in error.dims if d not in ("output", "time")]
        stated_at[rows] = np.abs(over_time((error.max(others) if others else error).values))
    # the standard deviation is NaN after the end of results that end early
    found = np.where(np.isfinite(std), stated_at * reference_spread(np.nan_to_num(std)), np.nan)
    if "stated_error" in statistics:
        # this error is also known for outputs that do not vary in the method
        found = np.where(np.isfinite(std), over_time(statistics["stated_error"].values), np.nan)
    # the margin: the mean square of few verification errors may be too small
    margin = np.sqrt(verified / chdtri(verified, 1.0 - CONFIDENCE))
    times = statistics["time"].values if "time" in statistics.dims else np.zeros(1)
    size, scale = _over_known(found, std, times, np.isfinite(found) & np.isfinite(std))
    return margin * found, found, np.where(scale == 0, size, size / divisor(scale)), stated_at


def _orders(surrogates: Sequence[StoredSurrogate], outputs: int) -> tuple[int | None, Array]:
    """Return the order of a surrogate, and the part of the standard deviation in its terms of the highest degree (O,).

    The order is the largest degree in any input, as in the option `order`. The part is known only for expansions at
    equal times.
    """
    orders, top = [], np.full(outputs, np.nan)
    for part in surrogates:
        if "multi_index" not in part.data or part.data["multi_index"].dims != ("term", "input"):
            continue
        degree = part.data["multi_index"].values.sum(axis=1)
        orders.append(int(part.data["multi_index"].values.max(initial=0)))
        if part.equal_times:
            square = part.data["coefficients"].values.reshape(len(degree), len(part.rows), -1) ** 2
            whole = square[degree > 0].sum(axis=(0, 2))
            highest = square[degree == max(degree.max(), 1)].sum(axis=(0, 2))
            top[part.rows] = np.sqrt(np.where(whole > 0, highest / divisor(whole), 0.0))
    return max(orders, default=None), top


def _response(node: xr.DataTree, shape: tuple[int, ...]) -> Array | None:
    if "samples" not in node.children:
        return None
    data = node.children["samples"].to_dataset(inherit=False).variables
    fine = np.flatnonzero(data["status"].values == Status.OK)[:MOST_SAMPLES]
    response = data["response"].isel(sample=fine).values.reshape(len(fine), *shape)
    return response if len(fine) > 1 else None
