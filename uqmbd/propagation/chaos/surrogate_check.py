"""Warn of unreliable surrogates, by one rule for every method that returns a surrogate."""

from __future__ import annotations

import warnings

import numpy as np
import xarray as xr

from uqmbd.errors import SurrogateWarning
from uqmbd.results.assessment import COARSE
from uqmbd.results.chaos import (
    SPREAD_FLOOR,
    StoredSurrogate,
    exceeds_locally,
    reference_spread,
    spread_words,
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
"""Ratio of a stated error to the integration error up to which the surrogate is not the cause.

The integration error is measured on few realisations.
"""

OF_SIZE = 10.0
"""Allowed difference between two integrations, relative to the product of tolerance and largest mean."""

CHANCE = 1e-3
"""Probability that the mean of a distribution is outside the range of independent samples from it."""

MOST = 5
"""Maximum number of outputs in a warning."""


def warn_of_surrogates(
    node: xr.DataTree,
    label: str,
    rtol: float,
    realised: tuple[Array, Array, int] | None = None,
    *,
    timeless: bool = False,
) -> None:
    """Warn of outputs whose surrogate states a large error, or whose mean is outside the range of the realisations.

    `node` contains one kind of outputs of a method with a surrogate, or with the stated error of a surrogate.
    `realised` contains the minimum and maximum (O, T) of the realisations, and their number. `timeless` outputs have no
    times, but a time axis of length one.
    """
    statistics = node.children["statistics"].to_dataset()
    names = [str(name) for name in statistics["output"].values]
    timed = not timeless and "time" in statistics["mean"].dims
    times = np.asarray(statistics["time"].values, dtype=float) if timed else None
    error, wrong = _stated(node, statistics, rtol)
    of = " of the surrogate" if stored_surrogates(node) else ""
    if found := [_words(name, error[k], wrong[k], times) for k, name in enumerate(names) if wrong[k].any()]:
        bad = np.flatnonzero(wrong.any(axis=1))
        std = over_time(statistics["std"].values)
        whole = spread_words(timed and exceeds_locally(error[bad], std[bad], np.full(len(bad), COARSE)).any())
        warnings.warn(
            f"{label}: the stated error{of} exceeds {COARSE:.0%} of {whole}: {_listed(found)}. Do not rely on these "
            f"statistics. {_remedy(node, timed, names, wrong)}",
            SurrogateWarning,
            stacklevel=5,
        )
    away, outside = _outside(node, statistics, rtol, realised)
    if found := [_words(name, away[k], outside[k], times) for k, name in enumerate(names) if outside[k].any()]:
        warnings.warn(
            f"{label}: the mean{of} is outside the range of the realisations, by this share of the standard deviation: "
            f"{_listed(found)}. Do not rely on these statistics. {_remedy(node, timed, names, outside)}",
            SurrogateWarning,
            stacklevel=5,
        )


def _stated(node: xr.DataTree, statistics: xr.Dataset, rtol: float) -> tuple[Array, Mask]:
    """Return the stated errors (O, T), and a mask of errors above the limit and above the integration error."""
    std = over_time(statistics["std"].values)
    error = np.full(std.shape, np.nan)
    if "verification_error" in statistics:
        error = over_time(statistics["verification_error"].values)
    else:
        for _, data, rows in stored_surrogates(node):
            stated = data.get("verification_error")
            if stated is not None and stated.dims[0] == "output":
                error[rows] = over_time(stated.values)
    # if the surrogate of an output is constant, the realisations determine the scale of its error
    seen = over_time(verified_std(node, statistics["std"].shape))
    spread = reference_spread(np.fmax(std, seen))
    return error, (error > COARSE) & (error * spread > FACTOR * integration_error(statistics, rtol))


def _outside(
    node: xr.DataTree, statistics: xr.Dataset, rtol: float, realised: tuple[Array, Array, int] | None
) -> tuple[Array, Mask]:
    """Return the distances (O, T) of means from the range of realisations, over the std, and a mask of large ones.

    A large distance exceeds both one hundredth of the standard deviation and three times the integration error.

    The range includes realisations of the surrogate and of its verification. If realisations of the surrogate are
    unknown, those of the verification may miss a rare event that changes the mean. By Cantelli's inequality, this
    change is almost certainly at most some standard deviations.
    """
    mean, std = (over_time(statistics[name].values) for name in ("mean", "std"))
    low, high, verified = verified_range(node, statistics["mean"].shape)
    count, low, high = verified, over_time(low), over_time(high)
    if realised is not None and realised[0].shape == mean.shape:
        count = max(count, realised[2])
        low, high = np.fmin(low, realised[0]), np.fmax(high, realised[1])
    # if all realisations nearly agree, as at a common start, a fit has a small distance from their range
    spread = reference_spread(std)
    slack = np.maximum(FACTOR * integration_error(statistics, rtol), SPREAD_FLOOR * spread)
    # mean and realisations of an output that hardly varies may come from different integrations
    largest = np.where(np.isfinite(mean), np.abs(mean), 0.0).max(axis=1, initial=0.0)
    floor = OF_SIZE * rtol * largest[:, None]
    slack = np.where(spread <= floor, np.maximum(slack, floor), slack)
    if count <= verified:
        trials = max(verified_trials(node), 1.0)
        slack = slack + np.sqrt(np.expm1(-np.log(CHANCE) / trials)) * std
    beyond = np.fmax(low - mean, mean - high)
    return np.divide(beyond, spread, out=np.full_like(spread, np.inf), where=spread > 0), beyond > slack


def _words(name: str, error: Array, wrong: Mask, times: Array | None) -> str:
    """Describe an output, the times (T,) of large errors, and the largest error."""
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


def _remedy(node: xr.DataTree, timed: bool, names: list[str], wrong: Mask) -> str:
    """Return advice, based on the surrogates, to reduce the errors of outputs at times (O, T) of large errors."""
    statistics = node.children["statistics"].to_dataset()
    remedy = str(statistics["verification_error"].attrs.get("remedy", "")) if "verification_error" in statistics else ""
    advice = [remedy or "use a sampling method"] * len(names)
    bad = np.flatnonzero(wrong.any(axis=1))
    surrogates = [one for one in stored_surrogates(node) if np.isin(one.rows, bad).any()]
    expanded = _expansion_remedy([one for one in surrogates if one.kind != "surrogate"], node, timed)
    for one in surrogates:
        custom = str(one.data.attrs.get("remedy", "")) or "use a sampling method"
        for row in one.rows.tolist():
            advice[row] = expanded if one.kind != "surrogate" else custom
    found: dict[str, list[str]] = {}
    for row in bad.tolist():
        found.setdefault(advice[row].rstrip("."), []).append(repr(names[row]))
    if len(found) == 1:
        (text,) = found
        return f"{text[:1].upper()}{text[1:]}."
    return " ".join(f"For {_listed(own)}: {text[:1].lower()}{text[1:]}." for text, own in found.items())


def _expansion_remedy(surrogates: list[StoredSurrogate], node: xr.DataTree, timed: bool) -> str:
    """Return advice to reduce the errors of polynomial surrogates."""
    end = f"{', study a shorter time' if timed else ''}, or use a sampling method"
    if any(one.split for one in surrogates):
        return f"Increase max_elements, raise the order{end}"
    if timed and all(one.equal_times for one in surrogates) and "alignment" not in node.attrs:
        return f"Raise the order, split the inputs into elements, align realisations at events or phases{end}"
    return f"Raise the order, split the inputs into elements{end}"
