"""Data of charts of densities."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.report.drawing import COLOURS, ON_DARK, ROLES
from uqmbd.report.figures import (
    FAILED_INPUTS,
    Curve,
    Densities,
    DensityCurve,
    Results,
    Samples,
    densities,
    earliest_events,
    input_densities,
    output_densities,
    scalar_panels,
)
from uqmbd.report.live.chart_data import curve_data
from uqmbd.report.live.packing import packed
from uqmbd.typing import Array
from uqmbd.wording import reciprocal_units, typeset_units

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.randomness import GermSpace

__all__ = ["densities_data", "events_data", "inputs_data", "scalars_data"]

_INPUT = 2
"""Which colour inputs have."""
_PLACES = 160
"""Points along the axis of a chart, besides those at which something jumps: estimates are smooth."""


def densities_data(results: Results | Samples, output: str, times: Sequence[float] | None = None) -> dict[str, Any]:
    """Return the densities of an output by each method, a view for each of some times.

    The horizontal axis is the output. Curves are those that `uqmbd.report.histograms` draws, at points that they share;
    the steps of a histogram, and curves at their ends, have two values at one place.

    Parameters
    ----------
    results, output, times
        As of `uqmbd.report.histograms`.

    Raises
    ------
    StudyError
        If there is nothing to draw.
    """
    labels, units, panels = output_densities(results, output, times)
    spreads = [float(np.std(panel.curves[0].values)) for panel in panels]
    views = [
        _view(
            f"t = {one.time:.4g} s",
            output,
            units,
            densities(one.bars, one.curves),
            labels,
            one.span,
            f"histogram of {labels[0]}",
        )
        for one in panels
    ]
    return {"choose": "Time of the densities", "seen": int(np.argmax(spreads)), "views": views}


def inputs_data(node: Samples, space: GermSpace | None = None) -> dict[str, Any]:
    """Return histograms of sampled inputs with their densities, a view for each; dots are where samples failed.

    Parameters
    ----------
    node, space
        As of `uqmbd.report.inputs`.

    Raises
    ------
    StudyError
        If the node has no samples or no inputs.
    """
    views = []
    for one in input_densities(node, space):
        line = "smooth estimate" if one.curve.known is None else "distribution"
        shown = densities(one.values, [one.curve])
        view = _view(one.name, one.name, one.units, shown, [line], None, "histogram of the samples")
        for method in view["methods"]:
            method["colours"] = [COLOURS[_INPUT], ON_DARK[_INPUT]]
        if len(one.failed):
            nothing = Curve(FAILED_INPUTS, np.full(view["of"], np.nan), (), "density")
            marks = [[float(f"{value:.7g}"), 0.0] for value in np.unique(one.failed)]
            view["methods"].append(
                curve_data(0, 1, nothing, short=True) | {"colours": list(ROLES["limit"]), "marks": marks}
            )
        views.append(view)
    return {"choose": "Input", "seen": 0, "views": views}


def scalars_data(results: Results, first: str = "") -> dict[str, Any] | None:
    """Return the densities of outputs without a time by each method, a view for each output.

    Parameters
    ----------
    results
        As of `uqmbd.report.scalar_densities`.
    first : str
        The output that is seen first; default: the first one.

    Returns
    -------
    dict or None
        None if no method has samples of such outputs, or a surrogate.
    """
    found = scalar_panels(results)
    if found is None:
        return None
    labels, panels = found
    names = [one.name for one in panels]
    views = [
        _view(
            one.name, one.name, one.units, densities(one.bars, one.curves), labels, None, f"histogram of {one.barred}"
        )
        for one in panels
        if one.curves or one.bars is not None
    ]
    return {"choose": "Output", "seen": names.index(first) if first in names else 0, "views": views}


def events_data(node: xr.DataTree) -> dict[str, Any]:
    """Return the densities of the times of events, a view for each of the earliest."""
    views = []
    for event in earliest_events(node):
        shown = densities(event.times, [DensityCurve(event.times)])
        views.append(_view(event.title, "time", "s", shown, ["smooth estimate"], None, "histogram"))
    return {"choose": "Event", "seen": 0, "views": views}


def _view(
    title: str,
    name: str,
    units: str,
    shown: Densities,
    labels: Sequence[str],
    span: tuple[float, float] | None,
    barred: str,
) -> dict[str, Any]:
    places = _places(shown, span)
    methods = []
    if shown.bars is not None:
        bars = Curve(barred, _steps(places, *shown.bars), (), "density")
        methods.append(curve_data(0, 1, bars, short=True) | {"filled": True, "width": 0.8})
    for number, x, f in shown.curves:
        curve = Curve(labels[number], _at(places, x, f), (), "density")
        methods.append(curve_data(number, len(labels), curve, short=True))
    across = typeset_units(units)
    return {
        "title": title,
        "output": f"density of {name}",
        "axis": "density",
        "units": reciprocal_units(units),
        "time": packed(places),
        "of": len(places),
        "start": len(places) // 2,
        "across": {"name": name, "units": across, "told": across},
        "methods": methods,
        "up": {"low": 0.0, "high": 1.05 * shown.top} if shown.top else None,
    }


def _places(shown: Densities, span: tuple[float, float] | None) -> Array:
    """Return where the values of a chart are: increasing, twice where something jumps."""
    jumps = [x[[0, -1]] for _, x, _ in shown.curves]
    if shown.bars is not None:
        jumps.append(shown.bars[0])
    every = np.concatenate(jumps)
    low, high = (float(every.min()), float(every.max())) if span is None else span
    parts = [np.linspace(low, high, _PLACES), every, every]
    # a narrow one among wide ones
    parts += [np.linspace(x[0], x[-1], _PLACES // 2) for _, x, _ in shown.curves if 2 * (x[-1] - x[0]) < high - low]
    places = np.sort(np.concatenate(parts))
    return np.asarray(places[(places >= low) & (places <= high)])


def _at(places: Array, x: Array, f: Array) -> Array:
    """Return a curve at places; where it ends the outer of two values there is zero."""
    if x[0] > x[-1]:
        x, f = x[::-1], f[::-1]
    values = np.interp(places, x[1:-1], f[1:-1], left=np.nan, right=np.nan)
    for end, place in ((x[0], np.searchsorted(places, x[0])), (x[-1], np.searchsorted(places, x[-1], "right") - 1)):
        if 0 <= place < len(places) and places[place] == end:
            values[place] = 0.0
    return np.asarray(values)


def _steps(places: Array, edges: Array, heights: Array) -> Array:
    """Return the outline of bars at places, which have each edge twice."""
    values = heights[np.clip(np.searchsorted(edges, places, "right") - 1, 0, len(heights) - 1)]
    values[(places < edges[0]) | (places > edges[-1])] = np.nan
    values[np.searchsorted(places, edges)] = np.concatenate([[0.0], heights])
    values[np.searchsorted(places, edges, "right") - 1] = np.concatenate([heights, [0.0]])
    return np.asarray(values)
