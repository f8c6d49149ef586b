"""Data of charts of what methods know of their own errors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.report.drawing import decades
from uqmbd.report.figures import (
    ESTIMATED,
    LARGEST,
    LIMIT,
    Band,
    Curve,
    Results,
    Samples,
    coefficient_parts,
    orders_of,
    sampling_errors,
    settling,
    stated_errors,
)
from uqmbd.report.live.chart_data import curve_data, curves_data
from uqmbd.report.live.packing import packed
from uqmbd.typing import Array

__all__ = ["decay_data", "errors_data", "orders_data", "percent_axis", "settling_data"]

INK = ("#1b1f24", "#e6e9ed")
PALE = ("#8a8f96", "#7d868f")
"""Colours, on a light and on a dark page, of the one that matters most, and of what stands for several things."""

SMALLEST = 1e-16
"""Differences that are rounding, and have no place on a logarithmic axis."""


_LIMIT = {"name": "stated error", "value": 100 * LIMIT}


def percent_axis(ends: tuple[float, float]) -> dict[str, Any]:
    """Return the vertical axis, in per cent, that shows two values and the full decades about them."""
    first, last = decades(*(100 * end for end in ends))
    return {"log": True, "low": float(f"1e{first}"), "high": float(f"1e{last}")}


def errors_data(results: Results) -> dict[str, Any] | None:
    """Return the stated errors of a surrogate over time, in per cent of the standard deviation, of each output.

    Of many outputs the worst have a line of their own, and the largest error of the others is one more. Dots mark where
    the limit is passed for the first time. None if there are fewer than two times.

    Raises
    ------
    StudyError
        If the propagator states no error.
    """
    found = stated_errors(results)
    if len(found.times) < 2:
        return None
    quantity = "stated error"
    curves = [Curve(found.names[k], 100 * found.errors[k], (), quantity) for k in found.named]
    if found.others:
        largest = np.fmax.reduce(found.errors[found.others])
        curves.append(Curve(f"largest of {len(found.others)} others", 100 * largest, (), quantity))
    data, chosen = curves_data(quantity, found.times, curves, "% of std")
    for k, method in zip(found.named, data["methods"], strict=False):
        first = found.horizons[k]
        method["marks"] = [] if first is None else [[first, 100 * LIMIT]]
    if found.others:
        data["methods"][-1] |= {"colours": list(PALE), "dash": [], "width": 1.0}
    worst = np.fmax.reduce([np.asarray(curve.values)[chosen] for curve in curves])
    return data | {
        "digits": 2,
        "up": percent_axis(found.ends),
        "limits": [_LIMIT],
        "start": int(np.nan_to_num(worst, nan=-1.0).argmax()),
    }


def settling_data(node: Samples, output: str) -> dict[str, Any] | None:
    """Return how the mean and the standard deviation of an output settle as samples are added: a view of each.

    The horizontal axis is the number of samples, or of replicates of a design. None if there is one number only.

    Raises
    ------
    StudyError
        If there are fewer than two samples to estimate from.
    """
    found = settling(node, output)
    if len(found.counts) < 2:
        return None
    across = {
        "name": found.counted,
        "units": "",
        "told": "samples" if found.independent else "replicates",
        "log": found.independent,
        "whole": True,
    }
    views = []
    for name, title in ESTIMATED.items():
        centre, low, high = found.band(name)
        curve = Curve("estimate so far", centre, (Band("95 % band", low, high),), title)
        data, _ = curves_data(f"{title} of {output}", found.counts, [curve], found.units)
        data["methods"][0]["points"] = not found.independent
        ends = found.ends(name)
        views.append(
            data
            | {
                "title": f"{title} at {found.time:.4g} s",
                "axis": title,
                "across": across,
                "limits": [{"name": "final value", "value": float(centre[-1]), "reference": True}],
                "start": len(found.counts) - 1,
            }
            | ({} if ends is None else {"up": {"low": ends[0], "high": ends[1]}})
        )
    return {"choose": "What is estimated", "seen": 0, "views": views}


def decay_data(results: Results, output: str) -> dict[str, Any] | None:
    """Return the part of the standard deviation that polynomials of each order carry, in per cent of its maximum.

    A view by the total order, at some times and at most, and one by the degree in each input. Of many inputs those have
    a line of their own that fall least; the largest of the others is one more. None if the output has no spread, or
    there is one order only.

    Raises
    ------
    StudyError
        If there is no chaos.
    """
    found = coefficient_parts(results, output)
    if found is None:
        return None
    orders = [Curve(LARGEST, found.largest), *(Curve(name, values) for name, values in found.at_times.items())]
    degrees = [Curve(found.inputs[k], found.of_inputs[k]) for k in found.named]
    if found.others:
        largest = np.fmax.reduce(found.of_inputs[found.others])
        degrees.append(Curve(f"largest of {len(found.others)} others", largest))
    views = []
    for word, across, curves in (("order", "total order", orders), ("degree", "degree in one input", degrees)):
        count = len(np.asarray(curves[0].values))
        if count < 2:
            return None
        methods = [
            curve_data(k, len(curves), Curve(one.name, 100 * np.asarray(one.values), (), "part")) | {"points": True}
            for k, one in enumerate(curves)
        ]
        if curves is orders:
            methods[0] |= {"colours": list(INK), "width": 2.2}
        elif found.others:
            methods[-1] |= {"colours": list(PALE), "dash": [], "width": 1.0}
        views.append(
            {
                "title": f"by {across}",
                "output": f"part of the largest standard deviation of {output}",
                "axis": "part of the largest std",
                "units": "%",
                "time": packed(np.arange(1.0, count + 1)),
                "of": count,
                "digits": 2,
                "start": count - 1,
                "across": {"name": across, "units": "", "told": "", "before": f"{word} ", "whole": True},
                "methods": methods,
                "up": percent_axis(found.ends),
                "limits": [_LIMIT],
            }
        )
    return {"choose": "Orders or degrees", "seen": 0, "views": views}


def orders_data(nodes: Mapping[str, xr.DataTree], output: str) -> dict[str, Any] | None:
    """Return how far surrogates of several orders are from the finest, in per cent of its largest standard deviation.

    A view by the order and one by the realisations, which has the standard errors of samplings, too. None if there are
    fewer than two orders besides the finest, or realisations are not known.

    Raises
    ------
    StudyError
        If no surrogate is left to compare with the finest, or times differ.
    """
    reference, found = orders_of(nodes, output)
    sampled = sampling_errors(nodes, reference, output)
    errors = [row.realisations for row in found] + [np.array([size]) for _, size, _ in sampled]
    sizes = np.unique(np.concatenate(errors))
    orders = np.unique(np.concatenate([row.orders for row in found]))
    if len(orders) < 2 or len(sizes) < 2 or sizes[0] < 1:
        return None
    known = [values for row in found for values in (row.mean, row.std)] + [np.array([error]) for *_, error in sampled]
    seen = np.concatenate(known)
    seen = seen[seen > SMALLEST]
    ends = (float(seen.min()), float(seen.max())) if len(seen) else (1e-3, 1.0)
    views = []
    for word, counts, places in (("order", "orders", orders), ("realisations", "realisations", sizes)):
        methods = []
        for k, row in enumerate(found):
            at = np.searchsorted(places, getattr(row, counts))
            for name, values, dash in (("mean", row.mean, []), ("standard deviation", row.std, [4, 2])):
                curve = Curve(f"{row.name}: {name}", _placed(places, at, values), (), "difference")
                methods.append(curve_data(k, len(found), curve) | {"points": True, "dash": dash, "width": 1.6})
        if counts == "realisations":
            for k, (label, size, error) in enumerate(sampled, len(found)):
                at = np.searchsorted(places, [size])
                curve = Curve(f"{label}: standard error", _placed(places, at, np.array([error])), (), "difference")
                methods.append(curve_data(k, len(found), curve) | {"points": True, "dash": []})
        views.append(
            {
                "title": f"by {word}",
                "output": f"difference of {output} to {reference}",
                "axis": "difference / largest std",
                "units": "%",
                "time": packed(places.astype(float)),
                "of": len(places),
                "start": len(places) - 1,
                "across": {"name": word, "units": "", "whole": True}
                | ({"told": word, "log": True} if counts == "realisations" else {"told": "", "before": f"{word} "}),
                "methods": methods,
                "up": percent_axis(ends),
            }
        )
    return {"choose": "Orders or realisations", "seen": 0, "views": views}


def _placed(places: NDArray[np.int64], at: NDArray[np.intp], values: Array) -> Array:
    """Return values in per cent at some of the places; NaN elsewhere, and where a logarithm shows nothing."""
    shown = np.full(len(places), np.nan)
    shown[at] = np.where(values > SMALLEST, 100 * values, np.nan)
    return shown
