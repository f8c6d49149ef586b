"""Spread of outputs: statistics as rows over time, scales to divide by, and whether an output varies.

It varies by more than the error of the integration, or than rounding where that is not known.
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.arguments import Bounds, typechecked
from uqmbd.errors import StudyError
from uqmbd.names import did_you_mean
from uqmbd.typing import Array

__all__ = ["divisor", "integration_error", "over_time", "relative", "rtol_of", "settled", "varies", "varying"]


FACTOR = 3.0
"""Standard deviations up to so many integration errors count as none: the error is measured at few realisations."""

LONG = 0.1
"""Part of the times at which an output varies that has a spread, however large the error becomes at others."""

ROUNDING, ALIKE, ANY = 1e-12, 1e-13, 1e-15
"""Rounding relative to the largest mean of an output, of outputs in the same units, and of any (for zero values)."""

OF_TOLERANCE = 0.1
"""Error of the integration over its tolerance and the largest mean, where it has not been measured."""

SETTLED = {"skewness": 0.0, "kurtosis": 3.0, "verification_error": 0.0, "verification_factor": 1.0}
"""Statistics of an output without variation, except Sobol' indices, which are 0."""


def divisor(scale: Array) -> Array:
    """Return a scale, or 1 where it is not positive, to divide by; an unknown one stays unknown.

    >>> divisor(np.array([2.0, 0.0, np.nan])).tolist()
    [2.0, 1.0, nan]
    """
    return np.where(scale <= 0, 1.0, scale)


def over_time(values: Any) -> Array:
    """Return values (O, T) of a statistic (output, time), or (O, 1) of one without time."""
    array = np.asarray(values, dtype=float)
    return array if array.ndim == 2 else array.reshape(len(array), 1)


def relative(values: Array, scale: Array, unknown: float) -> Array:
    """Return values over a scale: NaN for an unknown scale, `unknown` for a zero scale, and 0 for zero values."""
    return np.where(~(scale <= 0), values / divisor(scale), np.where(values > 0, unknown, values))


@typechecked
def varying(statistics: xr.Dataset, rtol: Annotated[float, Bounds(0)] = 0.0) -> NDArray[np.bool_]:
    """Return which outputs vary.

    An output varies if its standard deviation exceeds three times the integration error. This must hold for the root
    mean square over time, or at more than a tenth of the times. The error is ``integration_error_rms``, the root mean
    square over realisations, or ``integration_error`` in results without it. Where neither is known, a tenth of the
    tolerance, relative to the largest mean, stands in for it.

    Parameters
    ----------
    statistics : xarray.Dataset
        Of a method: ``mean``, ``std`` and, where it is known, ``integration_error``, over time or not.
    rtol : float
        Tolerance of the integration; 0: not known.

    Returns
    -------
    array of bool, shape (O,)

    Examples
    --------
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels(["driven", "free"], [], [0.0, 1.0])
    >>> varying(statistics_dataset(axes, mean=np.ones((2, 2)), std=[[1e-14, 3e-14], [0.0, 0.1]])).tolist()
    [False, True]
    """
    mean, std = (over_time(statistics[name].values) for name in ("mean", "std"))
    if not std.size:
        return np.zeros(len(std), dtype=bool)
    known = np.isfinite(mean) & np.isfinite(std)
    error, rounding = _errors(statistics, rtol)
    limit = np.maximum(FACTOR * error, rounding)
    std, limit = np.where(known, std, 0.0), np.where(known, limit, 0.0)
    count = np.maximum(known.sum(axis=1), 1)
    scale = np.maximum(np.maximum(std, limit).max(axis=1, keepdims=True), np.finfo(float).tiny)
    whole = ((std / scale) ** 2).sum(axis=1) > ((limit / scale) ** 2).sum(axis=1)
    often = ((std > limit) & known).sum(axis=1) > LONG * count
    return np.asarray(whole | often)


@typechecked
def varies(node: xr.DataTree, output: str) -> bool:
    """Return whether an output of a method varies; see :func:`varying`.

    Parameters
    ----------
    node : xarray.DataTree
        A propagator's node.
    output : str
        Its name.

    Raises
    ------
    StudyError
        If there is no such output.

    Examples
    --------
    >>> import numpy as np
    >>> from uqmbd.results import propagator_node, varies
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> def node(outputs, times, values):
    ...     axes = labels(outputs, [], times)
    ...     statistics = statistics_dataset(axes, mean=values, std=np.zeros_like(values))
    ...     return propagator_node("mine", statistics, propagator="perturbation", realisations=1, wall_time=0.1)
    >>> varies(node(["height"], [0.0, 1.0], [[0.0, 3.0]]), "height")  # its standard deviation is zero
    False
    """
    statistics = node.children["statistics"].to_dataset()
    names = [str(n) for n in statistics["output"].values]
    if output not in names:
        near = did_you_mean(output, names) or "."
        raise StudyError(f"varies: there is no output {output!r}{near} There are: {', '.join(names)}.")
    return bool(varying(statistics, rtol_of(node))[names.index(output)])


def settled(statistics: xr.Dataset, rtol: float = 0.0, verified: Array | None = None) -> xr.Dataset:
    """Return statistics in which outputs without variation have no shares, no shape and no error of a spread.

    Sobol' indices and the stated error of a surrogate are 0 there, and so is the skewness; the kurtosis is 3, and the
    factor by which the stated error may be off 1.  Mean and standard deviation stay.

    `statistics`: of a method; `rtol`: tolerance of the integration; 0: not known; `verified` (O, T): standard
    deviation of the verification realisations of a surrogate: what varies there varies, whatever the surrogate makes
    of it.
    """
    moves = varying(statistics, rtol)
    if verified is not None:
        moves = moves | varying(statistics.assign(std=statistics["std"].copy(data=verified)), rtol)
    if moves.all():
        return statistics
    mask = xr.DataArray(moves, dims="output")
    found = {}
    for name, values in statistics.data_vars.items():
        settles = str(name).startswith("sobol_") or name in SETTLED
        if settles and "output" in values.dims:
            still = values.where(mask | values.isnull(), SETTLED.get(str(name), 0.0)).transpose(*values.dims)
            found[name] = still.assign_attrs(values.attrs)
    return statistics.assign(found)


def rtol_of(node: xr.DataTree) -> float:
    """Return the tolerance of the integration, which the study of a node holds; 0 where it is not known."""
    return float(node.attrs.get("rtol", node.root.attrs.get("rtol", 0.0)))


def integration_error(statistics: xr.Dataset, rtol: float = 0.0) -> Array:
    """Return the error (O, T) of the integration, as stated or guessed from its tolerance, or rounding if that is more.

    `statistics`: of a method; `rtol`: tolerance of the integration; 0: not known.
    """
    return np.maximum(*_errors(statistics, rtol))


def _errors(statistics: xr.Dataset, rtol: float) -> tuple[Array, Array]:
    """Return the errors (O, T) of the integration and of rounding."""
    mean = over_time(statistics["mean"].values)
    if not mean.size:
        return np.zeros(mean.shape), np.zeros(mean.shape)
    size = np.where(np.isfinite(mean), np.abs(mean), 0.0).max(axis=1)
    units = statistics["output_units"].values if "output_units" in statistics.coords else np.full(len(size), "")
    kinds, kind = np.unique(units.astype(str), return_inverse=True)
    of_kind = np.zeros(len(kinds))
    np.maximum.at(of_kind, kind, size)
    alike = of_kind[kind]
    largest = size.max()
    rounding = np.maximum(ROUNDING * size, ALIKE * alike)
    stated = np.full(mean.shape, np.nan)
    # the root mean square where it is known: limits of the largest errors are beyond it
    named = next((name for name in ("integration_error_rms", "integration_error") if name in statistics), "")
    if named:
        stated = over_time(statistics[named].values)
    # of other units, where nothing is known of the error
    unknown = ~np.isfinite(stated).any(axis=1) & (size <= ANY * largest)
    rounding = np.where(unknown, np.maximum(rounding, ANY * largest), rounding)
    error = np.where(np.isfinite(stated), stated, (OF_TOLERANCE * rtol * size)[:, None])
    return error, np.broadcast_to(rounding[:, None], mean.shape)
