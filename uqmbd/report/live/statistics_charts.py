"""Data of further charts over time: standard deviations, differences between methods, shares of inputs, violations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.report.drawing import decades
from uqmbd.report.figures import MOST_REQUIREMENTS, Band, Curve, Indices, changing_with_time, of_output, shown_inputs
from uqmbd.report.live.chart_data import at_times, curves_data
from uqmbd.typing import Array

__all__ = ["difference_data", "indices_data", "std_data", "violation_data", "violations_data"]

ERRORS = "± 2 standard errors"

RARE = 1.0
"""Per cent: where nothing is violated more probably, the axis is logarithmic."""

DECADES = 4
"""Powers of ten beneath the smallest final probability that a logarithmic axis shows at most."""


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


def violations_data(nodes: Mapping[str, xr.DataTree]) -> dict[str, Any] | None:
    """Return how probably each requirement has been violated by a time, by each method: a view for each requirement.

    At the end stands the 95 % interval of the probability of the whole motion. None if no such probability grows.
    """
    found = _requirements(nodes)
    names = _growing(found)
    views = []
    for name in names:
        curves = {label: data.sel(requirement=name) for label, data in found.items() if _told(data, name)}
        views.append(_violation(name, curves) | {"title": name, "axis": "violated"})
    worst = [
        float(max(d.sel(requirement=n)["violated_by"].max() for d in found.values() if _told(d, n))) for n in names
    ]
    return {"choose": "Requirement", "seen": int(np.argmax(worst)), "views": views} if views else None


def violation_data(nodes: Mapping[str, xr.DataTree], most: int = 6) -> dict[str, Any] | None:
    """Return how probably the most probable violations have happened by a time, in one chart.

    Of one requirement by each method; of several by the first method. None if no such probability grows.
    """
    found = _requirements(nodes)
    names = _growing(found)
    if len(names) == 1:
        return _violation(names[0], {k: d.sel(requirement=names[0]) for k, d in found.items() if _told(d, names[0])})
    data = next((one for one in found.values() if changing_with_time(one)), None)
    if data is None:
        return None
    last = {name: float(data["violated_by"].sel(requirement=name).max()) for name in names if _told(data, name)}
    chosen = sorted(last, key=lambda name: -last[name])[:most]
    return _violation("requirements", {name: data.sel(requirement=name) for name in last if name in chosen})


def _requirements(nodes: Mapping[str, xr.DataTree]) -> dict[str, xr.Dataset]:
    return {k: n.children["requirements"].to_dataset() for k, n in nodes.items() if "requirements" in n.children}


def _growing(found: Mapping[str, xr.Dataset]) -> list[str]:
    return list(dict.fromkeys(name for data in found.values() for name in changing_with_time(data)))[:MOST_REQUIREMENTS]


def _told(data: xr.Dataset, name: str) -> bool:
    """Tell whether a method says how probably a requirement has been violated by each time, constant or not."""
    return "violated_by" in data and data.sizes.get("time", 0) > 1 and name in data["requirement"].values


def _violation(name: str, found: Mapping[str, xr.Dataset]) -> dict[str, Any]:
    times = np.unique(np.concatenate([np.asarray(data["time"].values, dtype=float) for data in found.values()]))
    curves, tops, ends = [], [0.0], []
    for label, data in found.items():
        values = 100 * at_times(data, times, data["violated_by"].values)
        last = len(times) - 1 - int(np.isfinite(values)[::-1].argmax())
        interval = 100 * np.asarray(data["interval"].values, dtype=float)
        low, high = (np.where(np.arange(len(times)) == last, end, np.nan) for end in interval)
        curves.append(Curve(label, values, (Band("95 % interval of the whole motion", low, high, True),), "violated"))
        # an interval that says nothing leaves the curve readable
        tops += [float(np.nanmax(values, initial=0.0)), float(interval[1]) if interval[1] < 100 else 0.0]
        ends.append(float(np.nanmax(values, initial=0.0)))
    top = max(tops)
    has = "have" if name == "requirements" else "has"
    chart, chosen = curves_data(f"probability that {name} {has} been violated", times, curves, "%")
    positive = [value for value in ends if value > 0]
    if positive and top < RARE:
        every = np.concatenate([np.asarray(curve.values) for curve in curves])
        least = max(float(every[every > 0].min()), min(positive) / 10**DECADES)
        first, final = decades(least, top)
        up: dict[str, Any] = {"log": True, "low": float(f"1e{first}"), "high": float(f"1e{final}")}
    else:
        up = {"low": 0.0, "high": min(1.08 * top, 100.0) or 1.0}
    return chart | {"axis": "violated", "up": up, "digits": 2, "start": len(chosen) - 1}
