"""Values of statistics: real, finite, not negative where they cannot be, and NaN only with a reason.

The reason is the attribute ``unknown`` of a variable: a JSON object from names of outputs (``*``: every one) to a
sentence.  None is needed after the time ``ends_at`` of a node, or for outputs that its attribute ``refused`` names.
Results of schemas before version 2 state no reasons: there each NaN is valid.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from uqmbd.arguments import fits, shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.typing import Array, Mask

__all__ = [
    "EVERY",
    "INTEGRATION_ERRORS",
    "check_probabilities",
    "check_values",
    "place_of",
    "real_numbers",
    "reasons_of",
    "reasons_where_missing",
    "with_default_reasons",
    "with_reasons",
]

EVERY = "*"
"""Stands for every output in the attribute ``unknown``."""

INTEGRATION_ERRORS = ("integration_error", "integration_error_rms", "integration_error_factor")
"""Stated errors of the time integration."""

_NOT_NEGATIVE = (
    "std", "variance", "std_error_mean", "std_error_std", "variance_reduction", "variance_reduction_std",
    "quantile_error", *INTEGRATION_ERRORS, "circular_std", "verification_error", "verification_factor",
    "stated_error",
)  # fmt: skip
_SHARES = ("censored", "censored_bound")
_INTERVALS = ("sobol_first_interval", "sobol_total_interval")
_KNOWN = (
    "mean", *_NOT_NEGATIVE, *_SHARES, "skewness", "kurtosis", "quantile", "smallest", "largest", "circular_mean",
    "sobol_first", "sobol_total", *_INTERVALS,
)  # fmt: skip
_NOT_STATED = "not stated"
_MAY_LACK_REASONS = ("skewness", "kurtosis", "quantile", "std_error_mean", "std_error_std")
"""A NaN of these without a reason gets the default reason in runs."""
_FINITE_BEFORE = ("mean", "std", "variance", "std_error_mean", "std_error_std", "variance_reduction",
                  "variance_reduction_std")  # fmt: skip
"""Variables that had to be finite before schema version 2."""
_MAY_BE_INFINITE = ("circular_std", "verification_factor")
"""Infinite if directions cancel, or if the uncertainty of an error is unknown."""


REAL = "expected real numbers in an array or a sequence"


def real_numbers(name: str, value: Any, *, copy: bool = True, expected: str = REAL) -> Array:
    """Return real numbers as an array; without `copy` that which is given, if it is one of them.

    Raise StudyError if they are complex, no numbers, or masked: a mask would be lost, and what is below it taken for
    a value.

    >>> real_numbers("std", [1, 2]).tolist()
    [1.0, 2.0]
    """
    if np.ma.is_masked(value):
        mask = np.asarray(np.ma.getmaskarray(value), dtype=bool)
        at = tuple(int(k) for k in np.argwhere(mask)[0])
        raise StudyError(
            f"{name!r} is a masked array with {np.count_nonzero(mask)} masked values, the first at index {at}; "
            "expected numbers, and for a statistic that is not known NaN with its reason."
        )
    number = fits(value, ArrayLike)  # NumPy reads numbers from texts, too
    if not number and isinstance(value, (np.ndarray, complex)) and np.iscomplexobj(value):
        array = np.asarray(value)
        at = tuple(int(k) for k in np.argwhere(array.imag != 0)[0]) if array.imag.any() else (0,) * array.ndim
        raise StudyError(f"{name!r} is complex, {array[at]} at index {at}; expected real numbers.")
    if not number:
        raise StudyError(f"{name!r} is {shown(value)}; {expected}.")
    return np.array(value, dtype=float, copy=copy or None)


def reasons_of(data: xr.DataArray) -> dict[str, str]:
    """Return why values of a statistic are not known, by output."""
    try:
        found = json.loads(str(data.attrs.get("unknown", "{}")))
    except ValueError:
        return {}
    return {str(k): str(v) for k, v in found.items()} if isinstance(found, dict) else {}


@typechecked
def with_reasons(data: xr.DataArray, reasons: Mapping[str, str]) -> xr.DataArray:
    """Return a statistic with reasons why its values are NaN, in addition to those that it has.

    Parameters
    ----------
    data : xarray.DataArray
        A statistic, or the standard error of a requirement.
    reasons : mapping of str to str
        Sentences by the name of the output or requirement; ``*`` stands for every one.

    Returns
    -------
    xarray.DataArray
        With the attribute ``unknown``.

    Examples
    --------
    >>> import numpy as np
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> found = statistics_dataset(labels(["x"], [], [0.0]), mean=[[0.0]], std=[[0.0]], skewness=[[np.nan]])
    >>> with_reasons(found["skewness"], {"x": "all samples are equal"}).attrs["unknown"]
    '{"x": "all samples are equal"}'
    """
    whole = {**reasons_of(data), **reasons}
    return data.assign_attrs(unknown=json.dumps(whole)) if whole else data


def reasons_where_missing(statistics: xr.Dataset, reasons: Mapping[str, str]) -> xr.Dataset:
    """Return statistics in which variables that are NaN at some places of an output have its reason."""
    found = {}
    for name, data in statistics.data_vars.items():
        if "output" not in data.dims or data.dtype.kind != "f" or not np.isnan(data.values).any():
            continue
        missing, others = data.isnull(), [dim for dim in data.dims if dim != "output"]
        # what is NaN everywhere has another reason, as the circular mean of no angle
        partly = (missing.any(others) & ~missing.all(others)).values
        own = [str(x) for x, which in zip(data["output"].values, partly, strict=True) if which]
        found[name] = with_reasons(data, {x: reasons[x] for x in own if x in reasons})
    return statistics.assign(found) if found else statistics


def with_default_reasons(data: xr.Dataset, *, end: float = np.inf) -> tuple[xr.Dataset, dict[str, list[str]]]:
    """Give the default reason to shape statistics and standard errors that are NaN without a reason.

    `data`: statistics of outputs, or probabilities of requirements; `end`: time, s, after which there are no results.
    Return the same one where all reasons are stated. Return outputs or requirements without a reason, by the name of
    the variable.
    """
    found: dict[str, list[str]] = {}
    for name, dim in (*((name, "output") for name in _MAY_LACK_REASONS), ("std_error", "requirement")):
        if name not in data or dim not in data[name].dims or data[name].dtype.kind != "f":
            continue
        missing = data[name].copy(data=np.isnan(data[name].values))
        if not missing.any():
            continue
        missing &= ~_explained(data, name, end, (), dim)
        which = missing.any([d for d in missing.dims if d != dim]).values
        if which.any():
            found[name] = [x for x, one in zip(_names(data, dim, len(which)), which, strict=True) if one]
    stated = {name: with_reasons(data[name], dict.fromkeys(own, _NOT_STATED)) for name, own in found.items()}
    return (data.assign(stated) if stated else data), found


def check_values(
    statistics: xr.Dataset, path: str, *, end: float = np.inf, refused: Collection[str] = (), before: bool = False
) -> None:
    """Refuse values that no statistic has.

    `statistics`: of outputs over time, or of outputs without one; `path`: where it is, for messages; `end`: time, s,
    after which there are no results; `refused`: outputs without statistics; `before`: whether they are of a schema
    before version 2, in which no NaN had a reason. Raise StudyError at the first value: its variable, output and
    place, and what is expected.
    """
    held = [name for name in _KNOWN if name in statistics.data_vars and "output" in statistics[name].dims]
    for name in held:
        _check_real(statistics[name], f"{path}/{name}")
    explained = {name: _explained(statistics, name, end, refused) | before for name in held}
    # of what has no mean the error is not known either
    for name in INTEGRATION_ERRORS if "mean" in explained else ():
        if name in explained:
            explained[name] |= explained["mean"] & np.isnan(statistics["mean"].values)
    for name in held:
        data, where = statistics[name], f"{path}/{name}"
        if name in _INTERVALS:
            _check_order(data, where, data.copy(data=explained[name]))
        values = data.values
        missing, infinite = np.isnan(values), np.isinf(values)
        if name in _MAY_BE_INFINITE:
            infinite = infinite & (values < 0)
        if before and name not in _FINITE_BEFORE:
            infinite = np.zeros_like(infinite)
        bad = data.copy(data=infinite | (missing & ~explained[name]))
        if name == "quantile_error":
            _refuse(where, bad, data, "a finite bound, 0 or more")
        reason = "a number, or the reason of a NaN in the attribute 'unknown' of the variable: {output: reason}"
        _refuse(where, bad, "a value that is not finite", f"{reason}; failures must not enter")
        if name in _NOT_NEGATIVE or name in _SHARES:
            expected = "a share from 0 to 1" if name in _SHARES else "a number that is 0 or more"
            _refuse(where, data < 0, "a negative value", expected)
        if name in _SHARES:
            _refuse(where, data > 1, data, "a share from 0 to 1")
        if name == "kurtosis":
            expected = "the fourth standardised moment (3 for a normal), not the excess"
            _refuse(where, data < 1 - 1e-9, "a value below 1", expected)
    if {"variance", "std"} <= set(held):
        variance, std = statistics["variance"], statistics["std"]
        off = abs(variance - std**2) > 1e-6 * variance + np.finfo(float).tiny
        off |= np.isnan(variance) != np.isnan(std)
        _refuse(f"{path}/variance", off, "a value that differs from std**2", "the square of 'std'")
    if "quantile" in held:
        _check_quantiles(statistics, path)


def check_probabilities(data: xr.Dataset, path: str, *, before: bool = False) -> None:
    """Refuse values that probabilities of violation, their standard errors and intervals do not have.

    `data`: as of `uqmbd.extend.requirements_dataset`; `path`: where it is, for messages; `before`: whether they are
    of a schema before version 2, in which no NaN had a reason. Raise StudyError at the first value: its variable,
    requirement and place, and what is expected.
    """
    for name in (n for n in ("violation_probability", "std_error", "interval", "violated_by") if n in data):
        _check_real(data[name], f"{path}/{name}")
    ends, probability, error = data["interval"], data["violation_probability"], data["std_error"]
    lower, upper = _ends(ends, f"{path}/interval")
    _refuse(f"{path}/interval", ~((ends >= 0) & (ends <= 1)), ends, "a probability from 0 to 1")
    _check_order(ends, f"{path}/interval", ends.isnull())
    where = f"{path}/violation_probability"
    known = (lower > 0) | (upper < 1)
    if not before:
        _refuse(where, probability.isnull() & known, probability, "a probability, or the interval from 0 to 1")
    off = (probability < lower - 1e-9) | (probability > upper + 1e-9)
    _refuse(where, off, "a value outside of its interval", "a probability within it")
    unknown = np.isnan(error.values) & (_explained(data, "std_error", np.inf, (), "requirement") | before)
    bad = error.copy(data=~(np.isfinite(error.values) & (error.values >= 0)) & ~unknown)
    expected = "a standard error that is finite and 0 or more, or the reason of a NaN in the attribute 'unknown'"
    _refuse(f"{path}/std_error", bad, error, expected)
    if "violated_by" in data:
        by = data["violated_by"]
        bad = ~((by >= 0) & (by <= 1)) & ~(by.isnull() & (probability.isnull() | before))
        _refuse(f"{path}/violated_by", bad.transpose(*by.dims), by, "a probability from 0 to 1")


def _ends(data: xr.DataArray, where: str) -> tuple[xr.DataArray, xr.DataArray]:
    """Return the lower and the upper ends of intervals."""
    if data.sizes.get("bound") != 2:
        given = ", ".join(f"{dim}: {size}" for dim, size in data.sizes.items())
        raise StudyError(f"{where}: found the dimensions ({given}); expected one that is called 'bound', of size 2.")
    return data.isel(bound=0, drop=True), data.isel(bound=1, drop=True)


def _check_order(data: xr.DataArray, where: str, explained: xr.DataArray) -> None:
    """Refuse intervals whose ends are not in order; both may be NaN with a reason."""
    lower, upper = _ends(data, where)
    bad = ~(lower <= upper) & ~(explained.isel(bound=0, drop=True) & lower.isnull() & upper.isnull())
    if bool(bad.any()):
        at = tuple(np.argwhere(bad.values)[0])
        expected = f"numbers in order; the ends are {lower.values[at]:.6g} and {upper.values[at]:.6g}"
        _refuse(where, bad, "a lower end that is not below the upper one", expected)


def _check_real(data: xr.DataArray, where: str) -> None:
    """Refuse a variable that contains other values than real numbers; `where`: its place, for the message."""
    if data.dtype.kind == "c":
        bad = data.copy(data=np.imag(data.values) != 0)
        place = f" at {place_of(bad)}" if bool(bad.any()) else ""
        raise StudyError(f"{where}: found complex numbers{place}; expected real ones.")
    if data.dtype.kind not in "fiu":
        raise StudyError(f"{where}: found the type {data.dtype}; expected real numbers.")


def _check_quantiles(statistics: xr.Dataset, path: str) -> None:
    quantile = statistics["quantile"]
    if "probability" in quantile.dims:
        falls = quantile.diff("probability") < -1e-9 * abs(quantile).max("probability")
        _refuse(f"{path}/quantile", falls, "a quantile that falls with the probability", "rising ones")
    if {"smallest", "largest"} <= set(statistics.data_vars):
        off = ~((statistics["smallest"] <= quantile) & (quantile <= statistics["largest"]))
        known = quantile.notnull() & statistics["smallest"].notnull() & statistics["largest"].notnull()
        _refuse(f"{path}/quantile", off & known, "a quantile that is beyond the samples", "one between them")


def _names(data: xr.Dataset, dim: str, count: int) -> list[str]:
    """Return the names of outputs or requirements; their numbers where they have none."""
    return [str(x) for x in data[dim].values] if dim in data.coords else [str(k) for k in range(count)]


def _explained(statistics: xr.Dataset, name: str, end: float, refused: Collection[str], dim: str = "output") -> Mask:
    """Return where a NaN has a reason, in the shape of the variable."""
    data = statistics[name]
    reasons = reasons_of(data)
    outputs = _names(statistics, dim, data.sizes[dim])
    told = np.array([x in refused or x in reasons or EVERY in reasons for x in outputs], dtype=bool)
    if data.attrs.get("reason") and not data.notnull().any():
        told[:] = True
    if name in ("circular_mean", "circular_std") and "output_angle" in statistics.coords:
        told |= statistics["output_angle"].values == 0
    found: Mask = _along(told, dim, data)
    if "time" in data.dims and "time" in statistics.coords:
        found = found | _along(statistics["time"].values > end, "time", data)
    if name == "circular_mean" and "circular_std" in statistics:
        # directions cancel
        found = found | np.isposinf(statistics["circular_std"].values)
    return np.array(np.broadcast_to(found, data.shape))


def _along(values: Mask, dim: str, data: xr.DataArray) -> Mask:
    """Return values of a dimension so that they broadcast against those of a variable."""
    return values.reshape([-1 if d == dim else 1 for d in data.dims])


def place_of(bad: xr.DataArray) -> str:
    """Return the place of the first value that is bad, by the coordinates of its dimensions."""
    index = np.argwhere(bad.values)[0]
    parts = []
    for dim, k in zip(bad.dims, index, strict=True):
        value = bad.coords[dim].values[k] if dim in bad.coords else k
        parts.append(f"{dim} {value!s}")
    return ", ".join(parts)


def _refuse(where: str, bad: xr.DataArray, found: str | xr.DataArray, expected: str) -> None:
    """Raise at the first bad value; `found` describes it, or contains the values, with the dimensions of `bad`."""
    if bool(bad.any()):
        if isinstance(found, xr.DataArray):
            found = f"{found.values[tuple(np.argwhere(bad.values)[0])]:.6g}"
        raise StudyError(f"{where}: found {found} at {place_of(bad)}; expected {expected}.")
