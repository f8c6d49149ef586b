"""Warnings of surrogates that must not be relied on: one rule for every method that leaves a surrogate."""

from __future__ import annotations

import warnings

import numpy as np
import xarray as xr

from uqmbd.errors import SurrogateWarning
from uqmbd.results.assessment import COARSE
from uqmbd.results.chaos import (
    SPREAD_FLOOR,
    reference_spread,
    stored_surrogates,
    verified_range,
    verified_std,
    verified_trials,
)
from uqmbd.results.statistics import integration_error, over_time
from uqmbd.typing import Array, Mask
from uqmbd.wording import format_percent

__all__ = ["warn_of_surrogates"]


FACTOR = 3.0
"""Errors up to so many integration errors are none of the surrogate: the latter are measured at few realisations."""

OF_SIZE = 10.0
"""Tolerances of the integration, times the largest mean, by which two integrations may differ."""

CHANCE = 1e-3
"""Probability with which the mean of a distribution may be outside the range of independent samples of it."""

MOST = 5
"""Outputs that a warning lists."""


def warn_of_surrogates(
    node: xr.DataTree,
    label: str,
    rtol: float,
    realised: tuple[Array, Array, int] | None = None,
    *,
    timeless: bool = False,
) -> None:
    """Warn of outputs whose surrogate states a large error, or whose mean is outside the range of the realisations.

    `node` holds one kind of outputs of a method with a surrogate, or a stated error of one. `realised` holds the
    smallest and largest values (O, T) of the realisations, and their number. `timeless` outputs have no times, but a
    time axis of length one.
    """
    statistics = node.children["statistics"].to_dataset()
    names = [str(name) for name in statistics["output"].values]
    timed = not timeless and "time" in statistics["mean"].dims
    times = np.asarray(statistics["time"].values, dtype=float) if timed else None
    error, wrong = _stated(node, statistics, rtol)
    of = " of the surrogate" if stored_surrogates(node) else ""
    if found := [_words(name, error[k], wrong[k], times) for k, name in enumerate(names) if wrong[k].any()]:
        warnings.warn(
            f"{label}: the stated error{of} exceeds {COARSE:.0%} of the standard deviation: "
            f"{_listed(found)}. Do not rely on the statistics there. {_remedy(node, timed)}",
            SurrogateWarning,
            stacklevel=5,
        )
    away, outside = _outside(node, statistics, rtol, realised)
    if found := [_words(name, away[k], outside[k], times) for k, name in enumerate(names) if outside[k].any()]:
        warnings.warn(
            f"{label}: the mean{of} is outside the range of the realisations, by a part of the standard "
            f"deviation: {_listed(found)}. Do not rely on the statistics there. {_remedy(node, timed)}",
            SurrogateWarning,
            stacklevel=5,
        )


def _stated(node: xr.DataTree, statistics: xr.Dataset, rtol: float) -> tuple[Array, Mask]:
    """Return the stated errors (O, T), and where they exceed the limit, and the error of the integration."""
    std = over_time(statistics["std"].values)
    error = np.full(std.shape, np.nan)
    if "verification_error" in statistics:
        error = over_time(statistics["verification_error"].values)
    else:
        for _, data, rows in stored_surrogates(node):
            stated = data.get("verification_error")
            if stated is not None and stated.dims[0] == "output":
                error[rows] = over_time(stated.values)
    # an output that the surrogate takes for constant is compared with its realisations
    seen = over_time(verified_std(node, statistics["std"].shape))
    spread = reference_spread(np.fmax(std, seen))
    return error, (error > COARSE) & (error * spread > FACTOR * integration_error(statistics, rtol))


def _outside(
    node: xr.DataTree, statistics: xr.Dataset, rtol: float, realised: tuple[Array, Array, int] | None
) -> tuple[Array, Mask]:
    """Return by how much of the standard deviation (O, T) means are outside the range of all realisations, and where.

    By more than a hundredth of it, and than the integration errs.

    A realisation that enters the surrogate counts, as do those of its verification.  Where the former are not known,
    the latter may miss something rare that moves the mean: by Cantelli's inequality no more than some standard
    deviations, with a probability that is next to one.
    """
    mean, std = (over_time(statistics[name].values) for name in ("mean", "std"))
    low, high, verified = verified_range(node, statistics["mean"].shape)
    count, low, high = verified, over_time(low), over_time(high)
    if realised is not None and realised[0].shape == mean.shape:
        count = max(count, realised[2])
        low, high = np.fmin(low, realised[0]), np.fmax(high, realised[1])
    # where all realisations come to nearly the same, as at a common start, a fit misses it by a little
    spread = reference_spread(std)
    slack = np.maximum(FACTOR * integration_error(statistics, rtol), SPREAD_FLOOR * spread)
    # of an output that hardly varies, the mean and the realisations may come from different integrations
    largest = np.where(np.isfinite(mean), np.abs(mean), 0.0).max(axis=1, initial=0.0)
    floor = OF_SIZE * rtol * largest[:, None]
    slack = np.where(spread <= floor, np.maximum(slack, floor), slack)
    if count <= verified:
        trials = max(verified_trials(node), 1.0)
        slack = slack + np.sqrt(np.expm1(-np.log(CHANCE) / trials)) * std
    beyond = np.fmax(low - mean, mean - high)
    return np.divide(beyond, spread, out=np.full_like(spread, np.inf), where=spread > 0), beyond > slack


def _words(name: str, error: Array, wrong: Mask, times: Array | None) -> str:
    """Return an output, when (T,) it is wrong, and by how much at most."""
    where = np.flatnonzero(wrong)
    worst = int(where[error[where].argmax()])
    largest = format_percent(float(error[worst]))
    if times is None:
        return f"{name!r} ({largest})"
    first, last = times[where[0]], times[where[-1]]
    if len(where) == 1:
        return f"{name!r} at t = {first:.6g} s ({largest})"
    when = f"from t = {first:.6g} s to t = {last:.6g} s"
    if len(where) <= where[-1] - where[0]:
        when = f"at {len(where)} of {len(times)} times {when}"
    return f"{name!r} {when} (up to {largest} at t = {times[worst]:.6g} s)"


def _listed(found: list[str]) -> str:
    more = len(found) - MOST
    return ", ".join(found[:MOST]) + (f", and {more} more" if more > 0 else "")


def _remedy(node: xr.DataTree, timed: bool) -> str:
    """Return what makes the error smaller."""
    surrogates = stored_surrogates(node)
    stated = node.children["statistics"].to_dataset().get("verification_error")
    own = [one.data.attrs.get("remedy", "") for one in surrogates if one.kind == "surrogate"]
    own += [stated.attrs.get("remedy", "")] if stated is not None and not surrogates else []
    if own or not surrogates:
        advice = next((str(one) for one in own if one), "use a method that samples")
        return f"{advice[:1].upper()}{advice[1:].rstrip('.')}."
    end = ", or study a shorter time." if timed else ", or use a method that samples."
    if any(one.split for one in surrogates):
        return f"Allow more elements, raise the order{end}"
    if timed and all(one.equal_times for one in surrogates) and "alignment" not in node.attrs:
        return f"Raise the order, split the inputs into elements, align realisations at events or phases{end}"
    return f"Raise the order, split the inputs into elements{end}"
