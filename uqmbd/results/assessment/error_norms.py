"""Compute errors of a result relative to another result, with one number for each output."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.results.assessment.own_errors import own_error, root_mean_square
from uqmbd.results.statistics import relative

__all__ = ["relative_errors"]


@typechecked
def relative_errors(found: xr.DataTree, reference: xr.DataTree) -> dict[str, NDArray[np.float64]]:
    """Return the differences between two results, as norms over time.

    Parameters
    ----------
    found, reference : xarray.DataTree
        Nodes of propagators with the same outputs and times. Times after the end of either result are excluded.

    Returns
    -------
    dict of str to array, each of shape (O,)
        ``mean_error_l2`` and ``std_error_l2``: norms of the differences, relative to the norms of the reference.
        ``mean_error_max`` and ``std_error_max``: largest differences, relative to the largest standard deviation.
        ``stated_error``: error that `found` states for its standard deviation, relative to it. ``own_mean_error`` and
        ``own_std_error``: errors that `reference` states for itself, as norms over time. NaN if no error is stated.

    Raises
    ------
    StudyError
        If outputs or times differ.

    Examples
    --------
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels(["x"], [], [0.0, 1.0])
    >>> def node(mean, std):
    ...     statistics = statistics_dataset(axes, mean=[mean], std=[std])
    ...     return propagator_node("a", statistics, propagator="p", realisations=1, wall_time=0.0)
    >>> errors = relative_errors(node([2.0, 2.2], [1.0, 1.0]), node([2.0, 2.0], [2.0, 2.0]))
    >>> errors["std_error_l2"].tolist(), errors["mean_error_max"].round(6).tolist()
    ([0.5], [0.1])
    """
    data = [node.children["statistics"].to_dataset() for node in (found, reference)]
    if any(not data[0][n].equals(data[1][n]) for n in ("output", *(("time",) if "time" in data[1].dims else ()))):
        raise StudyError(
            "A comparison needs results with the same outputs and times; the outputs or times of these results differ."
        )
    one, other = own_error(found), own_error(reference)
    known = np.asarray(np.isfinite(one.std).all(axis=0) & np.isfinite(other.std).all(axis=0))
    times = data[1]["time"].values[known] if "time" in data[1].dims else np.zeros(1)
    one, other = one.isel(known), other.isel(known)
    errors = {}
    for name in ("mean", "std"):
        off, whole = getattr(one, name) - getattr(other, name), getattr(other, name)
        errors[f"{name}_error_l2"] = relative(root_mean_square(off, times), root_mean_square(whole, times), np.nan)
        errors[f"{name}_error_max"] = relative(_largest(off), _largest(other.std), np.nan)
        noise = other.noise_mean if name == "mean" else other.noise_std
        own = root_mean_square(1.96 * noise + other.bias, times)
        states = other.samples > 0 or bool(np.isfinite(other.stated).all())
        errors[f"own_{name}_error"] = (
            relative(own, root_mean_square(whole, times), np.nan) if states else np.full(len(own), np.nan)
        )
    stated = one.relative(times)
    return errors | {"stated_error": np.where(np.isfinite(stated), stated, np.nan)}


def _largest(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.abs(values).max(axis=1, initial=0.0), dtype=float)
