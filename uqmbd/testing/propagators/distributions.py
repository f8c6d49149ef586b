"""Compare distributions of a node with exact distributions: quantiles, samples, and stated errors."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from uqmbd.results import surrogate
from uqmbd.results.chaos import stored_surrogates
from uqmbd.testing.propagators.moments import ERRORS, SURROGATE, stated_errors
from uqmbd.testing.solutions import ReferenceSolution
from uqmbd.typing import Array

__all__ = ["check_quantiles", "check_samples", "check_stated_errors"]

GRID = 0.005
"""Error of probabilities of the exact distribution, which is tabulated on a grid."""

ROUNDING = 1e-6
"""Allowed error of numbers that are exact except for the integration, relative to the standard deviation."""

TAIL = 1e-6
"""Probability that correct samples fail by chance."""

FRESH = 200
"""Number of realisations for the comparison of a surrogate with the exact outputs."""


def check_quantiles(node: xr.DataTree, known: ReferenceSolution, tolerance: float, what: str) -> None:
    """Compare quantiles (probability, output, time) with the exact distribution; NaN values are omitted.

    The probability of a quantile of N samples has the standard error ``sqrt(p (1 - p) / N)``.
    """
    statistics = node.children["statistics"].to_dataset()
    if "quantile" not in statistics:
        return
    probabilities, quantiles = statistics["probability"].values, statistics["quantile"].values
    scale = known.std.max(axis=1, keepdims=True)
    own = np.nan_to_num(statistics["quantile_error"].values) if "quantile_error" in statistics else 0.0
    reach = np.broadcast_to(stated_errors(node)[0] + (tolerance + ROUNDING) * scale + own, quantiles.shape)
    count = _count(node, known)
    slack = GRID + ERRORS * np.sqrt(probabilities * (1 - probabilities) / count)
    for o, time in np.ndindex(known.std.shape):
        population = np.sort(known.population[:, o, time])
        for k, p in enumerate(probabilities):
            q = quantiles[k, o, time]
            ends = [q - reach[k, o, time], q + reach[k, o, time]]
            low, high = np.searchsorted(population, ends) / len(population)
            assert np.isnan(q) or (low <= p + slack[k] and high >= p - slack[k]), (
                f"{what}: quantiles: the {p:g} quantile of {_place(statistics, (o, time))} is {q:.6g}; the exact "
                f"value is {np.quantile(population, p):.6g}. Its exact probability is {low:.3g} to {high:.3g}; the "
                f"allowed difference is {slack[k]:.2g}."
            )


def _count(node: xr.DataTree, known: ReferenceSolution) -> float:
    """Return the number of samples of the quantiles: the stored samples, or the number from standard errors."""
    if stored_surrogates(node):
        return np.inf
    if "samples" in node.children:
        return float(np.count_nonzero(node.children["samples"]["status"].values == 0))
    statistics = node.children["statistics"].to_dataset()
    if "std_error_mean" in statistics:
        error = statistics["std_error_mean"].values
        if (error > 0).any():
            return float(np.median((known.std[error > 0] / error[error > 0]) ** 2))
    return float(node.attrs["realisations"])


def check_samples(node: xr.DataTree, known: ReferenceSolution, what: str) -> None:
    """Check that samples are draws from the joint distribution, and that responses belong to their inputs."""
    if "samples" not in node.children:
        return
    from scipy.stats import kstest

    samples = node.children["samples"].to_dataset()
    good = samples["status"].values == 0
    inputs, response = samples["inputs"].values[good], samples["response"].values[good]
    joint = known.study.mechanism.inputs
    for name, values, lower, upper in zip(joint.names, inputs.T, *joint.from_uniform(_ends(len(joint))), strict=True):
        found = kstest((values - lower) / (upper - lower), "uniform").pvalue
        assert found > TAIL, (
            f"{what}: samples: the values of the input {name!r} do not have its distribution (p = {found:.2g} in a "
            "Kolmogorov-Smirnov test). Samples must be draws from the joint distribution. Store quadrature nodes, "
            "training points and weighted samples in another child of the node."
        )
    if len(joint) > 1 and len(inputs) > 2:
        alike = np.abs(np.corrcoef(inputs.T) - np.eye(len(joint))).max()
        assert alike < ERRORS / np.sqrt(len(inputs)), (
            f"{what}: samples: two independent inputs have a correlation of {alike:.3g} in {len(inputs)} samples; "
            "expected about 0."
        )
    exact = known.exact(inputs)
    scale = known.std.max(axis=1, keepdims=True)
    error = np.abs(response - exact) / scale
    k = np.unravel_index(int(np.argmax(np.nan_to_num(error, nan=np.inf))), error.shape)
    assert error[k] < 10 * ROUNDING, (
        f"{what}: samples: the response of sample {k[0]} for {_place(samples, k[1:])} is {response[k]:.8g}, but its "
        f"inputs give {exact[k]:.8g}. Store inputs and responses in the same order."
    )


def _ends(count: int) -> Array:
    """Return the ends of the unit cube (2, count)."""
    return np.array([np.zeros(count), np.ones(count)])


def check_stated_errors(node: xr.DataTree, known: ReferenceSolution, what: str) -> None:
    """Compare stated errors of a method with true errors, without any tolerance.

    Errors of mean and standard deviation must not exceed the stated errors. The error of a surrogate is the root mean
    square of its difference from the exact outputs at new inputs.
    """
    statistics = node.children["statistics"].to_dataset()
    names = {"std_error_mean", "std_error_std", "verification_error", "stated_error"} & set(statistics)
    made = bool(stored_surrogates(node))
    if not names and not made:
        return
    scale = known.std.max(axis=1, keepdims=True)
    for name, words, stated in zip(("mean", "std"), ("mean", "standard deviation"), _stated(node), strict=True):
        error, allowed = np.abs(statistics[name].values - getattr(known, name)), stated + ROUNDING * scale
        _require(statistics, error, allowed, f"{what}: stated errors: the {words}", ", ".join(sorted(names)))
    if not made:
        return
    bound = stated_errors(node)[0] - ERRORS * _noise(statistics, "std_error_mean")
    rng = np.random.default_rng(11)
    fresh = known.study.mechanism.inputs.from_uniform(rng.random((FRESH, len(known.study.mechanism.inputs))))
    found = surrogate(node)
    values = np.asarray(found.evaluate(fresh), dtype=float)
    error = np.sqrt(np.mean((values - known.exact(fresh)) ** 2, axis=0))
    spread = np.maximum(known.std, 0.01 * scale)
    _require(statistics, error, bound + 10 * ROUNDING * spread, f"{what}: stated errors: the surrogate", "its own")


def _stated(node: xr.DataTree) -> tuple[Array, Array]:
    """Return the allowed errors (output, time) of mean and standard deviation, with a separate verification error."""
    statistics = node.children["statistics"].to_dataset()
    alone = "verification_error" in statistics and "stated_error" not in statistics and not stored_surrogates(node)
    if not alone:
        return stated_errors(node)
    std = statistics["std"].values
    spread = np.maximum(std, 0.01 * std.max(axis=-1, keepdims=True))
    bound = SURROGATE * np.nan_to_num(statistics["verification_error"].values, nan=np.inf) * spread
    return bound, bound


def _noise(statistics: xr.Dataset, name: str) -> Array:
    """Return standard errors (output, time); zero if they are missing."""
    return statistics[name].values if name in statistics else np.zeros(statistics["mean"].shape)


def _require(statistics: xr.Dataset, error: Array, allowed: Array, what: str, names: str) -> None:
    """Require that errors (output, time) do not exceed the allowed errors."""
    if (error <= np.nan_to_num(allowed, nan=np.inf)).all():
        return
    k = np.unravel_index(int(np.argmax(np.nan_to_num(error / allowed, nan=0))), error.shape)
    raise AssertionError(
        f"{what} of {_place(statistics, k)} has the error {error[k]:.2g}; the stated error ({names}) "
        f"allows {allowed[k]:.2g}. A stated error must not be less than the true error; estimate it at "
        "additional realisations."
    )


def _place(data: xr.Dataset, index: Any) -> str:
    """Name an output and a time."""
    return f"{str(data['output'].values[index[0]])!r} at {data['time'].values[index[1]]:g} s"
