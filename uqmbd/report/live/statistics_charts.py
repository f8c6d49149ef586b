"""Data of further charts over time: standard deviations, differences between methods, and what inputs take part in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.report.figures import Band, Curve, Indices, of_output, shown_inputs
from uqmbd.report.live.chart_data import at_times, curves_data
from uqmbd.typing import Array

__all__ = ["difference_data", "indices_data", "std_data"]

ERRORS = "± 2 standard errors"


def std_data(nodes: Mapping[str, xr.DataTree], output: str) -> dict[str, Any] | None:
    """Return the standard deviation of an output over time by each method, with its standard errors.

    None if there are fewer than two times.
    """
    found = _of_methods(nodes, output)
    if found is None:
        return None
    times, statistics = found
    curves = []
    for label, data in statistics.items():
        std = data["std"]
        bands: tuple[Band, ...] = ()
        if "std_error_std" in data:
            error = 2 * np.nan_to_num(data["std_error_std"])
            bands = (Band(ERRORS, np.maximum(std - error, 0.0), std + error),)
        curves.append(Curve(label, std, bands, "standard deviation"))
    first = np.nan_to_num(np.asarray(curves[0].values), nan=-1.0)
    return _chart(f"standard deviation of {output}", times, curves, _units(nodes, output), int(first.argmax()))


def difference_data(
    nodes: Mapping[str, xr.DataTree], output: str, reference: str, statistic: str
) -> dict[str, Any] | None:
    """Return by how much the mean or the standard deviation of methods differs from that of a reference.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree
    output, reference : str
    statistic : {"mean", "std"}

    Returns
    -------
    dict or None
        As `bands_data` returns it: the reference first, zero with its own standard errors. None if there are fewer
        than two times.
    """
    found = _of_methods(nodes, output)
    if found is None:
        return None
    times, statistics = found
    base = statistics[reference]
    zero = np.where(np.isfinite(base[statistic]), 0.0, np.nan)
    bands: tuple[Band, ...] = ()
    if f"std_error_{statistic}" in base:
        error = 2 * np.nan_to_num(base[f"std_error_{statistic}"])
        bands = (Band(ERRORS, -error, error),)
    curves = [Curve(f"{reference}, the reference", zero, bands, "difference")]
    for label, data in statistics.items():
        if label != reference:
            curves.append(Curve(label, data[statistic] - base[statistic], (), "difference"))
    largest = max((np.nan_to_num(np.abs(np.asarray(c.values))) for c in curves[1:]), key=lambda off: off.max())
    what = {"mean": "mean", "std": "standard deviation"}[statistic]
    name, axis = f"{output}: difference of the {what}", f"difference of the {what}"
    return _chart(name, times, curves, _units(nodes, output), int(largest.argmax())) | {"axis": axis}


def indices_data(found: Indices, output: str, most: int = 5) -> dict[str, Any] | None:
    """Return the share of the variance of an output in which each input takes part, over time, and explains alone.

    None if there are fewer than two times.
    """
    if len(found.times) < 2:
        return None
    named = shown_inputs(found, most)
    quiet = np.where(found.meaningful, 0.0, np.nan)
    curves = [Curve(found.names[k], found.total[k] + quiet, (), "takes part in") for k in named]
    data, chosen = curves_data(f"share of the variance of {output}", found.times, curves, "1", told=[
        {"explains alone": found.first[k] + quiet} for k in named
    ])  # fmt: skip
    data["decimals"] = 3
    data["start"] = int(np.nan_to_num(np.where(found.meaningful, found.std, -1.0)[chosen], nan=-1.0).argmax())
    return data


def _of_methods(nodes: Mapping[str, xr.DataTree], output: str) -> tuple[Array, dict[str, dict[str, Array]]] | None:
    """Return all times, and the statistics of each method at them: NaN where a method has none."""
    statistics = {label: of_output(node.children["statistics"], output) for label, node in nodes.items()}
    times = np.unique(np.concatenate([data["time"].values for data in statistics.values()]).astype(float))
    if len(times) < 2:
        return None
    wanted = ("mean", "std", "std_error_mean", "std_error_std")
    return times, {
        label: {key: at_times(data, times, data[key].values) for key in wanted if key in data}
        for label, data in statistics.items()
    }


def _units(nodes: Mapping[str, xr.DataTree], output: str) -> str:
    first = next(iter(nodes.values()))
    return str(of_output(first.children["statistics"], output)["output_units"].item())


def _chart(name: str, times: Array, curves: Sequence[Curve], units: str, start: int) -> dict[str, Any]:
    data, chosen = curves_data(name, times, curves, units)
    data["start"] = int(np.abs(chosen - start).argmin())
    return data
