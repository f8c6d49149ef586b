"""Data of charts in the plane of two quantities: points with shapes, and lines that may turn back.

A chart of this kind is one of curves (`chart_data`) whose methods have ``places`` along the horizontal axis, one for
each value; what is common to all methods and runs from value to value (``across``: a time, a level, a sample) is that
along which the cursor moves. ``plane`` says what the horizontal axis is. A method may have

- ``shape``: of its points, a key of `uqmbd.report.figures.MARKS` or ``cross``; none: no points;
- ``hollow``, ``size``: of points; the size in pixels;
- ``joined``: whether a line goes through the points, in their order;
- ``strands``: thin lines beneath, such as single realisations: what they are called, at which indices of the cursor
  they have points, and these, from ``origin`` on;
- ``texts``: words for each value, such as names of levels.
"""

from __future__ import annotations

import heapq
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.report.drawing import ROLES
from uqmbd.report.figures import (
    MARKS,
    Band,
    Curve,
    Paths,
    Reason,
    Samples,
    bands_over,
    errors_of,
    failed_inputs,
    own_error,
    paths_over,
)
from uqmbd.report.live.chart_data import MOST_TIMES, curve_data, curves_data
from uqmbd.report.live.convergence_charts import PALE, percent_axis
from uqmbd.report.live.packing import packed
from uqmbd.typing import Array
from uqmbd.wording import typeset_units

__all__ = ["error_cost_data", "failures_data", "over_data"]

BENDS = 200
"""Points of a single realisation at most: they are context, as bands are."""

STRAIGHT = 1 / 800
"""How far lines may be from what they stand for, of the height and width of a chart: half a pixel or so."""


def over_data(nodes: Mapping[str, xr.DataTree], output: str, over: str) -> dict[str, Any] | None:
    """Return an output over another one, as `uqmbd.report.over_output` draws it.

    Where bands are drawn, a chart of curves along the other output. Else one in the plane of both, with the time of the
    page: the means at each time, and single realisations of the first method. None if there are fewer than two times.

    Raises
    ------
    StudyError
        If no such output exists, or both are the same.
    """
    found = paths_over(nodes, output, over)
    if max(len(path.times) for path in found.paths.values()) < 2:
        return None
    if found.banded:
        return _banded(found.paths, output, over, found.units, found.over_units)
    means = {label: path.means for label, path in found.paths.items()}
    first = next(iter(found.paths.values()))
    known = np.unique(np.concatenate([path.times for path in found.paths.values()]))
    chosen = known
    if len(known) > MOST_TIMES:
        lines = [np.stack([np.interp(known, path.times, one) for one in means[k]]) for k, path in found.paths.items()]
        chosen = known[_bends(np.stack(lines), MOST_TIMES, 0.0)]
    methods = []
    for k, (label, path) in enumerate(found.paths.items()):
        x, y = (_placed(chosen, path.times, values) for values in means[label])
        one = curve_data(k, len(means), Curve(label, y, (), "mean at each time"))
        one |= {"places": packed(x), "joined": True}
        if k == 0 and len(path.single[0]):
            one["strands"] = _strands(path, chosen)
        methods.append(one)
    spread = np.ptp(first.y, axis=0)
    return {
        "output": output,
        "units": typeset_units(found.units),
        "time": packed(chosen),
        "of": len(known),
        "start": int(np.abs(chosen - first.times[spread.argmax()]).argmin()),
        "plane": {"name": over, "units": typeset_units(found.over_units)},
        "methods": methods,
    }


def _banded(paths: Mapping[str, Paths], output: str, over: str, units: str, over_units: str) -> dict[str, Any]:
    places = np.unique(np.concatenate([bands_over(path)[0] for path in paths.values()]))
    curves = []
    for label, path in paths.items():
        _, mean, (low, high, inner_low, inner_high) = bands_over(path, places)
        bands = (Band("95 % of realisations", low, high), Band("50 % of realisations", inner_low, inner_high))
        curves.append(Curve(label, mean, bands if path.sampled else (), "mean"))
    data, _ = curves_data(output, places, curves, units)
    shown = typeset_units(over_units)
    return data | {"across": {"name": over, "units": shown, "told": shown}}


def _strands(path: Paths, chosen: Array) -> dict[str, Any]:
    """Return single realisations at some of the chosen times, of which lines between do not depart visibly."""
    x, y = (values[:, np.isin(path.times, chosen)] for values in path.single)
    at = _bends(np.stack([x, y], axis=1), BENDS, STRAIGHT)
    origin = [float(x[0, 0]), float(y[0, 0])]
    own = np.flatnonzero(np.isin(chosen, path.times))
    return {
        "name": "single realisations",
        "at": own[at].tolist(),
        "origin": origin,
        "across": _short(x[:, at] - origin[0]),
        "up": _short(y[:, at] - origin[1]),
    }


def _short(values: Array) -> dict[str, Any]:
    """Pack distances with seven digits, or, where float32 has no such numbers, with all."""
    largest = float(np.abs(values).max(initial=0.0))
    return packed(values, "float32" if largest == 0 or 1e-30 < largest < 1e30 else "float64")


def _bends(lines: Array, most: int, tolerance: float) -> NDArray[np.intp]:
    """Choose points such that straight lines between them stand for lines, shape (R, 2, T).

    Points are added where a line departs most, until none departs by more than the tolerance, as a share of the extent
    of all lines along each axis, or there are ``most``: the rule of Ramer, Douglas and Peucker for many lines at once.
    """
    extent = np.ptp(lines, axis=(0, 2))
    scaled = lines / np.where(extent > 0, extent, 1.0)[:, None]
    last = scaled.shape[-1] - 1
    chosen = {0, last}
    waiting: list[tuple[float, int, int, int]] = []

    def look(low: int, high: int) -> None:
        if high - low < 2:
            return
        share = np.linspace(0, 1, high - low + 1)[1:-1]
        ends = scaled[..., low, None], scaled[..., high, None]
        away = np.abs(scaled[..., low + 1 : high] - (ends[0] + (ends[1] - ends[0]) * share)).max(axis=(0, 1))
        k = int(away.argmax())
        heapq.heappush(waiting, (-float(away[k]), low, low + 1 + k, high))

    look(0, last)
    while waiting and len(chosen) < most:
        away, low, k, high = heapq.heappop(waiting)
        if -away <= tolerance:
            break
        chosen.add(k)
        look(low, k)
        look(k, high)
    return np.array(sorted(chosen))


def _placed(chosen: Array, times: Array, values: Array) -> Array:
    """Return values at chosen times; NaN where there are none."""
    place = np.clip(np.searchsorted(times, chosen), 0, len(times) - 1)
    return np.where(times[place] == chosen, values[place], np.nan)


def error_cost_data(convergence: xr.Dataset, output: str) -> dict[str, Any]:
    """Return the errors of methods against realisations and against wall time, in per cent: a view of each.

    Filled points and full lines are errors of the mean, hollow ones and dashed lines those of the standard deviation;
    each method has a shape of its own. Pale lines are what the reference states of its own error.

    Raises
    ------
    StudyError
        If there is no such output, or no error above zero.
    """
    found = errors_of(convergence, output)
    shapes = list(MARKS)
    views = []
    for title, cost, place in (
        ("by realisations", "realisations", {"name": "realisations", "units": "", "log": True, "whole": True}),
        ("by wall time", "wall_time", {"name": "wall time", "units": "s", "log": True}),
    ):
        # in the order of levels, which every row of the table has: a line goes back where a finer level cost less
        rows = [(k, one, np.where(np.isfinite(one.errors), getattr(one, cost), np.nan)) for k, one in enumerate(found)]
        rows = [row for row in rows if np.isfinite(row[2]).any()]
        if not rows:
            continue
        errors = np.concatenate([one.errors[np.isfinite(costs)] for _, one, costs in rows])
        spent = np.concatenate([costs[np.isfinite(costs)] for *_, costs in rows])
        up = percent_axis((float(errors.min()), float(errors.max())))
        count = len(rows[0][2])
        known = np.sum([np.isfinite(one.errors) & np.isfinite(costs) for _, one, costs in rows], axis=0)
        methods = []
        for k, one, costs in rows:
            deviation = one.quantity == "std"
            name = f"{one.method}: {'standard deviation' if deviation else 'mean'}"
            methods.append(
                curve_data(k // 2, len(found) // 2, Curve(name, 100 * one.errors, (), ""))
                | {"dash": [4, 2] if deviation else [], "width": 1.6, "hollow": deviation}
                | {"places": packed(costs), "shape": shapes[k // 2 % len(shapes)], "joined": True}
                | {"texts": [{"name": "level", "values": list(one.levels)}]}
            )
        for quantity, name in (("mean", "mean"), ("std", "standard deviation")):
            own = 100 * own_error(convergence, output, quantity)
            if up["low"] < own < up["high"] and count > 1:
                curve = Curve(f"the reference itself: {name}", np.full(count, own), (), "")
                places = np.geomspace(spent.min(), spent.max(), count)
                looks = {"colours": list(PALE), "dash": [4, 2] if quantity == "std" else [], "width": 1.0}
                methods.append(
                    curve_data(0, 1, curve) | looks | {"places": packed(places), "joined": True, "quiet": True}
                )
        views.append(
            {
                "title": title,
                "output": f"error of {output}",
                "axis": "relative error",
                "units": "%",
                "time": packed(np.arange(1.0, count + 1)),
                "of": count,
                "digits": 2,
                # the finest of the levels that most methods have
                "start": count - 1 - int(known[::-1].argmax()),
                "across": {"name": "level", "units": "", "told": "", "before": "level ", "whole": True},
                "plane": place,
                "methods": methods,
                "up": up,
            }
        )
    return {"choose": "What it costs", "seen": 0, "views": views}


def failures_data(node: Samples, reason: Reason) -> dict[str, Any]:
    """Return samples that failed for one reason among those that succeeded, by the inputs that tell them apart best.

    Raises
    ------
    StudyError
        If there are no inputs.
    """
    found = failed_inputs(node, reason)
    single = len(found.names) == 1
    shown = np.sort(np.concatenate([found.fine, found.failed]))
    methods = []
    for which, name, count, looks in (
        (found.fine, "succeeded", found.count_fine, {"colours": list(PALE), "shape": "disc", "size": 4.5}),
        (found.failed, "failed", found.count_failed, {"colours": list(ROLES["limit"]), "shape": "cross", "size": 7}),
    ):
        if not len(which):
            continue
        at = np.searchsorted(shown, which)
        x, y = (_spread(values, at, len(shown)) for values in found.places(which))
        curve = Curve(f"{name} ({count})", y, (), "")
        methods.append(curve_data(0, 1, curve) | {"places": packed(x), "dash": []} | looks)
    return {
        "output": found.names[0] if single else found.names[1],
        "axis": "" if single else found.names[1],
        "units": "" if single else typeset_units(found.units[1]),
        "time": packed(shown.astype(float)),
        "of": found.count_fine + found.count_failed,
        "start": int(np.searchsorted(shown, found.failed[0])),
        "across": {"name": "sample", "units": "", "told": "", "before": "sample ", "whole": True},
        "plane": {"name": found.names[0], "units": typeset_units(found.units[0])},
        "methods": methods,
    } | ({"up": {"low": 0.0, "high": 1.0, "hidden": True}} if single else {})


def _spread(values: Array, at: NDArray[np.intp], count: int) -> Array:
    every = np.full(count, np.nan)
    every[at] = values
    return every
