"""Checks of statistics: values must be real, finite and in their range, and each NaN needs a reason.

The reason is in the attribute ``unknown`` of a variable: a JSON object from names of outputs (``*``: all outputs) to
sentences. A NaN needs no reason after the time ``ends_at`` of a node, or for outputs in its attribute ``refused``.
Results of schemas before version 2 state no reasons, so each NaN in them is valid.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Hashable, Mapping, Sequence
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
"""Key of all outputs in the attribute ``unknown``."""

INTEGRATION_ERRORS = ("integration_error", "integration_error_rms", "integration_error_factor")
"""Stated errors of the time integration."""

_NOT_NEGATIVE = (
    "std", "variance", "std_error_mean", "std_error_std", "variance_reduction", "variance_reduction_std",
    "quantile_error", *INTEGRATION_ERRORS, "circular_std", "verification_error", "verification_factor",
    "stated_error",
)  # fmt: skip
_SHARES = ("censored", "censored_bound")
_INTERVALS = ("sobol_first_interval", "sobol_total_interval", "quantile_interval")
_KNOWN = (
    "mean", *_NOT_NEGATIVE, *_SHARES, "skewness", "kurtosis", "quantile", "smallest", "largest", "circular_mean",
    "sobol_first", "sobol_total", *_INTERVALS,
)  # fmt: skip
_NOT_STATED = "not stated"
_MAY_LACK_REASONS = ("skewness", "kurtosis", "quantile", "std_error_mean", "std_error_std")
"""Statistics for which a run adds the default reason to NaN without a reason."""
_FINITE_BEFORE = ("mean", "std", "variance", "std_error_mean", "std_error_std", "variance_reduction",
                  "variance_reduction_std")  # fmt: skip
"""Variables that had to be finite before schema version 2."""
_MAY_BE_INFINITE = ("circular_std", "verification_factor")
"""Statistics that are infinite if directions cancel, or if the uncertainty of an error is unknown."""


REAL = "expected real numbers in an array or a sequence"


def real_numbers(name: str, value: Any, *, copy: bool = True, expected: str = REAL) -> Array:
    """Return real numbers as an array; without `copy`, an array of real numbers is returned unchanged.

    Raise StudyError for complex numbers, for other objects, and for masked arrays: masks would be lost, and masked
    entries would become values.

    >>> real_numbers("std", [1, 2]).tolist()
    [1.0, 2.0]
    """
    if type(value) is np.ndarray and value.dtype == float:
        return np.array(value) if copy else value
    if np.ma.is_masked(value):
        mask = np.asarray(np.ma.getmaskarray(value), dtype=bool)
        at = tuple(int(k) for k in np.argwhere(mask)[0])
        raise StudyError(
            f"{name!r} is a masked array with {np.count_nonzero(mask)} masked values, the first at index {at}; "
            "expected numbers, with NaN and a reason for unknown statistics."
        )
    number = fits(value, ArrayLike)  # NumPy reads numbers from texts, too
    if not number and isinstance(value, (np.ndarray, complex)) and np.iscomplexobj(value):
        array = np.asarray(value)
        at = tuple(int(k) for k in np.argwhere(array.imag != 0)[0]) if array.imag.any() else (0,) * array.ndim
        raise StudyError(f"{name!r} is complex, {array[at]} at index {at}; expected real numbers.")
    if not number:
        raise StudyError(f"{name!r} is {shown(value)}; {expected}.")
    return np.array(value, dtype=float, copy=copy or None)


def reasons_of(data: xr.DataArray | xr.Variable) -> dict[str, str]:
    """Return the reasons for unknown values of a statistic, by output."""
    try:
        found = json.loads(str(data.attrs.get("unknown", "{}")))
    except ValueError:
        return {}
    return {str(k): str(v) for k, v in found.items()} if isinstance(found, dict) else {}


@typechecked
def with_reasons(data: xr.DataArray, reasons: Mapping[str, str]) -> xr.DataArray:
    """Return a statistic with additional reasons for its NaN values.

    Parameters
    ----------
    data : xarray.DataArray
        Statistic, or standard error of a requirement.
    reasons : mapping of str to str
        Sentences by name of the output or requirement; ``*`` applies to all.

    Returns
    -------
    xarray.DataArray
        Copy with the attribute ``unknown``.

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
    """Add the reason of an output to each statistic that is NaN for this output at some times, but known at others."""
    found = {}
    for name, data in statistics.data_vars.items():
        if "output" not in data.dims or data.dtype.kind != "f" or not np.isnan(data.values).any():
            continue
        missing, others = data.isnull(), [dim for dim in data.dims if dim != "output"]
        # a variable that is NaN at all times has another reason: a circular mean needs an angle
        partly = (missing.any(others) & ~missing.all(others)).values
        own = [str(x) for x, which in zip(data["output"].values, partly, strict=True) if which]
        found[name] = with_reasons(data, {x: reasons[x] for x in own if x in reasons})
    return statistics.assign(found) if found else statistics


def with_default_reasons(data: xr.Dataset, *, end: float = np.inf) -> tuple[xr.Dataset, dict[str, list[str]]]:
    """Add the default reason to shape statistics, quantiles and standard errors that are NaN without a reason.

    `data`: statistics of outputs, or probabilities of requirements; `end`: time in s after which there are no results.
    Return the dataset, which is unchanged if it states all reasons. Also return the names of outputs or requirements
    to which a reason was added, by the name of the variable.
    """
    found: dict[str, list[str]] = {}
    for name, dim in (*((name, "output") for name in _MAY_LACK_REASONS), ("std_error", "requirement")):
        if name not in data.variables or dim not in data.variables[name].dims:
            continue
        if data.variables[name].dtype.kind != "f":
            continue
        variable = data.variables[name]
        missing = np.isnan(variable.values)
        if not missing.any():
            continue
        missing &= ~_explained(data, name, end, (), dim)
        which = missing.any(axis=tuple(k for k, d in enumerate(variable.dims) if d != dim))
        if which.any():
            found[name] = [x for x, one in zip(_names(data, dim, len(which)), which, strict=True) if one]
    stated = {name: with_reasons(data[name], dict.fromkeys(own, _NOT_STATED)) for name, own in found.items()}
    return (data.assign(stated) if stated else data), found


def check_values(
    statistics: xr.Dataset, path: str, *, end: float = np.inf, refused: Collection[str] = (), before: bool = False
) -> None:
    """Check values of statistics.

    `statistics`: dataset of outputs over time or of scalar outputs; `path`: its path, for messages; `end`: time, s,
    after which there are no results; `refused`: outputs without statistics; `before`: whether the schema is before
    version 2, in which NaN has no reason. Raise StudyError for the first invalid value; the message states the
    variable, output, place and expected value.
    """
    # use variables instead of data arrays, because each operation on a data array copies and aligns coordinates
    variables = statistics.variables
    names = [name for name in _KNOWN if name in statistics.data_vars and "output" in variables[name].dims]
    for name in names:
        _check_real(variables[name], f"{path}/{name}", statistics)
    # most statistics have only finite values in their range, which need no reasons
    unclear = [name for name in names if name in _INTERVALS or not _plain(name, variables[name].values)]
    explained = {name: _explained(statistics, name, end, refused) | before for name in unclear}
    # if the mean is unknown with a reason, its integration error may be unknown without a reason
    for name in INTEGRATION_ERRORS if "mean" in explained else ():
        if name in explained:
            explained[name] |= explained["mean"] & np.isnan(variables["mean"].values)
    for name in unclear:
        data, where, values = variables[name], f"{path}/{name}", variables[name].values
        if name in _INTERVALS:
            _check_order(data, where, explained[name], statistics)
        missing, infinite = np.isnan(values), np.isinf(values)
        if name in _MAY_BE_INFINITE:
            infinite = infinite & (values < 0)
        if name == "quantile_interval":
            infinite = np.zeros_like(infinite)
        if before and name not in _FINITE_BEFORE:
            infinite = np.zeros_like(infinite)

        def refuse(bad: Mask, found: str | Array, expected: str, where: str = where, data: xr.Variable = data) -> None:
            _refuse(where, bad, data.dims, statistics, found, expected)

        bad = infinite | (missing & ~explained[name])
        if name == "quantile_error":
            refuse(bad, values, "a finite bound, 0 or more")
        reason = "a number, or the reason of a NaN in the attribute 'unknown' of the variable: {output: reason}"
        refuse(bad, "a value that is not finite", f"{reason}. Omit failed realisations")
        if name in _NOT_NEGATIVE or name in _SHARES:
            expected = "a share from 0 to 1" if name in _SHARES else "a number that is 0 or more"
            refuse(values < 0, "a negative value", expected)
        if name in _SHARES:
            refuse(values > 1, values, "a share from 0 to 1")
        if name == "kurtosis":
            expected = "the fourth standardised moment (3 for a normal), not the excess"
            refuse(values < 1 - 1e-9, "a value below 1", expected)
    if {"variance", "std"} <= set(names):
        _check_variance(variables["variance"], variables["std"], f"{path}/variance", statistics)
    if "quantile" in names:
        _check_quantiles(statistics, path)


def _plain(name: str, values: Array) -> bool:
    """Return whether all values of a statistic are finite and in its range."""
    if not np.isfinite(values).all():
        return False
    if name == "kurtosis":
        return bool((values >= 1 - 1e-9).all())
    if name in _SHARES:
        return bool(((values >= 0) & (values <= 1)).all())
    return name not in _NOT_NEGATIVE or bool((values >= 0).all())


def _check_variance(variance: xr.Variable, std: xr.Variable, where: str, statistics: xr.Dataset) -> None:
    """Raise StudyError unless the variance is the square of the standard deviation."""
    if variance.dims == std.dims:
        square = variance.values
        if (np.abs(square - std.values**2) <= 1e-6 * square + np.finfo(float).tiny).all():
            return  # no NaN: no alignment is needed
    off = abs(variance - std**2) > 1e-6 * variance + np.finfo(float).tiny
    off |= variance.isnull() != std.isnull()
    _refuse(where, off.values, off.dims, statistics, "a value that differs from std**2", "the square of 'std'")


def check_probabilities(data: xr.Dataset, path: str, *, before: bool = False) -> None:
    """Check probabilities of violation, their standard errors and intervals.

    `data`: dataset from `uqmbd.extend.requirements_dataset`; `path`: its path, for messages; `before`: whether the
    schema is before version 2, in which NaN has no reason. Raise StudyError for the first invalid value; the message
    states the variable, requirement, place and expected value.
    """
    variables = data.variables

    def refuse(name: str, bad: xr.Variable, found: str | Array, expected: str) -> None:
        _refuse(f"{path}/{name}", bad.values, bad.dims, data, found, expected)

    for name in (
        n
        for n in ("violation_probability", "std_error", "interval", "violated_by", "violated_by_interval")
        if n in variables
    ):
        _check_real(variables[name], f"{path}/{name}", data)
    ends, probability, error = (variables[n] for n in ("interval", "violation_probability", "std_error"))
    lower, upper = _ends(ends, f"{path}/interval")
    refuse("interval", ~((ends >= 0) & (ends <= 1)), ends.values, "a probability from 0 to 1")
    _check_order(ends, f"{path}/interval", np.isnan(ends.values), data)
    name, known = "violation_probability", (lower > 0) | (upper < 1)
    if not before:
        refuse(name, probability.isnull() & known, probability.values, "a probability, or the interval from 0 to 1")
    off = (probability < lower - 1e-9) | (probability > upper + 1e-9)
    refuse(name, off, "a value outside of its interval", "a probability within it")
    unknown = np.isnan(error.values) & (_explained(data, "std_error", np.inf, (), "requirement") | before)
    bad = error.copy(data=~(np.isfinite(error.values) & (error.values >= 0)) & ~unknown)
    expected = "a standard error that is finite and 0 or more, or the reason of a NaN in the attribute 'unknown'"
    refuse("std_error", bad, error.values, expected)
    if "violated_by" in variables:
        by = variables["violated_by"]
        bad = ~((by >= 0) & (by <= 1)) & ~(by.isnull() & (probability.isnull() | before))
        refuse("violated_by", bad.transpose(*by.dims), by.values, "a probability from 0 to 1")
    if "violated_by" in variables and "violated_by_interval" in variables:
        low, high = _ends(variables["violated_by_interval"], f"{path}/violated_by_interval")
        off = ~((low >= 0) & (low <= by + 1e-9) & (by <= high + 1e-9) & (high <= 1)) & ~by.isnull()
        found = "a probability outside of its interval"
        refuse("violated_by_interval", off.transpose(*by.dims), found, "an interval within 0 to 1 around 'violated_by'")


def _ends(data: xr.Variable, where: str) -> tuple[xr.Variable, xr.Variable]:
    """Return the lower and the upper ends of intervals; raise StudyError without a dimension ``bound`` of size 2."""
    if data.sizes.get("bound") != 2:
        given = ", ".join(f"{dim}: {size}" for dim, size in data.sizes.items())
        raise StudyError(f"{where}: found the dimensions ({given}); expected a dimension 'bound' of size 2.")
    return data.isel(bound=0), data.isel(bound=1)


def _check_order(data: xr.Variable, where: str, explained: Mask, statistics: xr.Dataset) -> None:
    """Raise StudyError if a lower end exceeds its upper end; both may be NaN with a reason."""
    lower, upper = _ends(data, where)
    if (lower.values <= upper.values).all():
        return
    bad = ~(lower <= upper) & ~(data.copy(data=explained).isel(bound=0) & lower.isnull() & upper.isnull())
    if bad.values.any():
        at = tuple(np.argwhere(bad.values)[0])
        expected = f"numbers in order; the ends are {lower.values[at]:.6g} and {upper.values[at]:.6g}"
        _refuse(where, bad.values, bad.dims, statistics, "a lower end that is not below the upper one", expected)


def _check_real(data: xr.Variable, where: str, statistics: xr.Dataset) -> None:
    """Raise StudyError if a variable contains other values than real numbers; `where`: its path, for the message."""
    if data.dtype.kind == "c":
        bad = np.imag(data.values) != 0
        place = f" at {_place(bad, data.dims, statistics)}" if bad.any() else ""
        raise StudyError(f"{where}: found complex numbers{place}; expected real ones.")
    if data.dtype.kind not in "fiu":
        raise StudyError(f"{where}: found the type {data.dtype}; expected real numbers.")


def _check_quantiles(statistics: xr.Dataset, path: str) -> None:
    variables, where = statistics.variables, f"{path}/quantile"
    quantile = variables["quantile"]
    if "probability" in quantile.dims:
        falls = np.zeros(quantile.shape, dtype=bool)
        axis = quantile.dims.index("probability")
        largest = np.nan_to_num(np.abs(quantile.values)).max(axis=axis, keepdims=True, initial=0.0)
        later = tuple(slice(1, None) if k == axis else slice(None) for k in range(quantile.ndim))
        falls[later] = np.diff(quantile.values, axis=axis) < -1e-9 * largest
        found = "a quantile that falls with the probability"
        _refuse(where, falls, quantile.dims, statistics, found, "rising ones")
    if {"smallest", "largest"} <= set(statistics.data_vars):
        smallest, largest = variables["smallest"], variables["largest"]
        values = (smallest.values, quantile.values, largest.values)
        if smallest.dims == largest.dims == quantile.dims[1:] and (values[0] <= values[1]).all():
            if (values[1] <= values[2]).all():  # no NaN: no alignment is needed
                return
        off = ~((smallest <= quantile) & (quantile <= largest))
        off &= quantile.notnull() & smallest.notnull() & largest.notnull()
        _refuse(where, off.values, off.dims, statistics, "a quantile that is beyond the samples", "one between them")


def _names(data: xr.Dataset, dim: str, count: int) -> list[str]:
    """Return the names of outputs or requirements, or their indices if they have no names."""
    return [str(x) for x in data[dim].values] if dim in data.coords else [str(k) for k in range(count)]


def _explained(statistics: xr.Dataset, name: str, end: float, refused: Collection[str], dim: str = "output") -> Mask:
    """Return a mask of values that may be NaN, because there is a reason, in the shape of the variable."""
    data = statistics.variables[name]
    reasons = reasons_of(data)
    outputs = _names(statistics, dim, data.sizes[dim])
    explained = np.array([x in refused or x in reasons or EVERY in reasons for x in outputs], dtype=bool)
    if data.attrs.get("reason") and np.isnan(data.values).all():
        explained[:] = True
    if name in ("circular_mean", "circular_std") and "output_angle" in statistics.coords:
        explained |= statistics.variables["output_angle"].values == 0
    found: Mask = _along(explained, dim, data)
    if "time" in data.dims and "time" in statistics.coords:
        found = found | _along(statistics.variables["time"].values > end, "time", data)
    if name == "circular_mean" and "circular_std" in statistics:
        # directions cancel
        found = found | np.isposinf(statistics.variables["circular_std"].values)
    return np.array(np.broadcast_to(found, data.shape))


def _along(values: Mask, dim: str, data: xr.Variable) -> Mask:
    """Reshape values along a dimension so that they broadcast against a variable."""
    return values.reshape([-1 if d == dim else 1 for d in data.dims])


def place_of(bad: xr.DataArray) -> str:
    """Return the place of the first bad value of a mask as text, by the coordinates of its dimensions."""
    return _place(bad.values, bad.dims, bad)


def _place(bad: Mask, dims: Sequence[Hashable], data: xr.DataArray | xr.Dataset) -> str:
    """Return the place of the first bad value of a mask with dimensions `dims`, by the coordinates of `data`."""
    index = np.argwhere(bad)[0]
    parts = []
    for dim, k in zip(dims, index, strict=True):
        value = data.coords[dim].values[k] if dim in data.coords else k
        parts.append(f"{dim} {value!s}")
    return ", ".join(parts)


def _refuse(
    where: str, bad: Mask, dims: Sequence[Hashable], data: xr.Dataset, found: str | Array, expected: str
) -> None:
    """Raise StudyError at the first bad value; `found` describes it, or contains the values (dimensions of `bad`)."""
    if bad.any():
        if not isinstance(found, str):
            found = f"{found[tuple(np.argwhere(bad)[0])]:.6g}"
        raise StudyError(f"{where}: found {found} at {_place(bad, dims, data)}; expected {expected}.")
