"""Data of a chart for the page: thinned to the resolution of the screen, and packed as JSON."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.report.charts.arrays import Kind, packed, packed_relative, packed_selection, packed_within, unpacked
from uqmbd.report.charts.model import TIME, Boxes, Chart, Column, Curve, Views, axis_of, painted, several
from uqmbd.typing import Array
from uqmbd.wording import typeset_units

__all__ = [
    "MOST_TIMES",
    "chart_script",
    "json_script",
    "page_data",
    "thinned",
    "thinned_chart",
]


_ESCAPES = str.maketrans({c: f"\\u{ord(c):04x}" for c in "<>&\u2028\u2029"})


EXACT = 200
"""Maximum number of places of a curve with exact numbers in a page; numbers of longer curves have fewer digits."""

DIGITS = 2.5e-4
"""Allowed error of a number, relative to the half-width of a band; a page shows at best a thousandth of this width."""

SHORT = 1e-5
"""Allowed relative error of a number over time without a band; the page shows four digits."""

FINE = 4e-7
"""Allowed relative error of a number along other axes, because densities are integrated."""

RELATIVE = 1e-13
"""Minimum allowed error relative to the largest value, for places at which the band has no width."""


def json_script(data: Any) -> str:
    r"""Return JSON that is safe within `<script type="application/json">`: no text ends or opens an element.

    Lone surrogates and other characters outside ASCII are escaped.

    Raise ValueError for infinite numbers and NaN, which JSON does not support; use None, or `packed` arrays.

    >>> json_script({"name": "</script>"})
    '{"name":"\\u003c/script\\u003e"}'
    """
    return json.dumps(data, allow_nan=False, separators=(",", ":")).translate(_ESCAPES)


MOST_POINTS = 600


def thinned(low: NDArray[np.float64], high: NDArray[np.float64], most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Choose at most ``most`` of the times, and preserve every peak of a lower and an upper curve.

    `low` and `high` (T,) are the lower and upper edge of the drawn area; `most` is four or more. Return increasing
    indices, including the first and the last one.

    >>> import numpy as np
    >>> curve = np.zeros(5000)
    >>> curve[1234] = 1.0
    >>> chosen = thinned(curve, curve)
    >>> len(chosen) <= 600, 1234 in chosen, chosen[[0, -1]].tolist()
    (True, True, [0, 4999])
    """
    count = len(low)
    if count <= most:
        return np.arange(count)
    edges = np.linspace(0, count, (most - 2) // 2 + 1).astype(int)
    chosen = {0, count - 1}
    for first, last in zip(edges[:-1], edges[1:], strict=True):
        chosen.add(first + int(low[first:last].argmin()))
        chosen.add(first + int(high[first:last].argmax()))
    return np.array(sorted(chosen))


def thinned_chart(chart: Chart, most: int) -> tuple[Chart, NDArray[np.intp]]:
    """Reduce a chart to about ``most`` places, including the peaks of each curve; also return their indices."""
    places = np.asarray(chart.places)
    every = np.arange(len(places))
    if len(places) <= most or chart.plane is not None or chart.boxes is not None:
        return chart, every
    share = max(most // len(chart.curves), 100)
    chosen = np.unique(np.concatenate([_with_peaks(curve, share) for curve in chart.curves]))
    return replace(chart, places=places[chosen], curves=[curve.at(chosen) for curve in chart.curves]), chosen


def _with_peaks(curve: Curve, most: int) -> NDArray[np.intp]:
    values = np.asarray(curve.values, dtype=float)
    low = np.fmin.reduce([values, *(np.asarray(band.low, dtype=float) for band in curve.bands)])
    high = np.fmax.reduce([values, *(np.asarray(band.high, dtype=float) for band in curve.bands)])
    low, high = np.nan_to_num(low, nan=np.inf), np.nan_to_num(high, nan=-np.inf)
    return thinned(low, high, most)


MOST_TIMES = 1000
"""Maximum number of times of a chart, sufficient for lines of two pixels on a screen; peaks are preserved."""


def chart_script(shown: Chart | Views | None) -> str | None:
    """Return the data of a chart as JSON; None if it has too few points for a line."""
    charts = shown.charts if isinstance(shown, Views) else [shown] if shown is not None else []
    if not charts or not all(map(several, charts)):
        return None
    assert shown is not None
    return json_script(page_data(shown))


def page_data(shown: Chart | Views) -> dict[str, Any]:
    """Return one chart, or several charts with one visible at a time, as data for JSON."""
    if isinstance(shown, Views):
        return {"choose": shown.choose, "seen": shown.seen, "views": [page_data(chart) for chart in shown.charts]}
    chart, chosen = thinned_chart(shown, MOST_TIMES)
    count = len(chart.curves)
    data: dict[str, Any] = {
        "output": chart.name,
        "units": typeset_units(chart.units),
        "time": packed_selection(np.asarray(shown.places), chosen),
        "of": len(np.asarray(shown.places)) if chart.count is None else chart.count,
        "start": _start(shown, chosen),
        "methods": [_method(curve, k, count, chart) for k, curve in enumerate(chart.curves)],
    }
    levels = [{"name": name, "value": float(value)} for name, value in chart.limits.items()]
    levels += [{"name": n, "value": float(value), "reference": True} for n, value in chart.references.items()]
    given: dict[str, Any] = {
        "title": chart.title,
        "axis": chart.axis,
        "digits": 2 if chart.digits else 0,
        "follows": chart.follows,
    }
    given["limits"] = levels
    data |= {key: value for key, value in given.items() if value}
    if chart.decimals is not None:
        data["decimals"] = chart.decimals
    if chart.ends is not None:
        flags = {"log": chart.log, "hidden": chart.hidden}
        data["up"] = {"low": float(chart.ends[0]), "high": float(chart.ends[1])} | _only(flags)
    if chart.along is not None or chart.across:
        axis = axis_of(chart)
        data["across"] = {
            "name": axis.name,
            "units": axis.units,
            "place_units": axis.place_units if axis.place_units is not None else axis.units,
        }
        data["across"] |= _only(
            {"before": axis.before, "log": axis.log, "whole": axis.whole, "texts": list(axis.texts)}
        )
        data["across"] |= _only({"categories": axis.categories, "ends": axis.ends and list(map(float, axis.ends))})
    if chart.plane is not None:
        plane = chart.plane
        data["plane"] = {"name": plane.name, "units": plane.units} | _only({"log": plane.log, "whole": plane.whole})
    if chart.boxes is not None:
        data["boxes"] = _boxes(chart.boxes)
    return data


def _only(flags: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in flags.items() if value}


def _start(chart: Chart, chosen: NDArray[np.intp]) -> int:
    """Return the index of the initial place of the cursor among the drawn places."""
    first = chart.curves[0].bands[:1]
    if chart.start is not None:
        return int(np.abs(chosen - chart.start).argmin())
    if not first:
        return 0
    width = np.asarray(first[0].high, dtype=float)[chosen] - np.asarray(first[0].low, dtype=float)[chosen]
    return int(np.nan_to_num(width, nan=-1.0).argmax())


def _method(curve: Curve, k: int, count: int, chart: Chart) -> dict[str, Any]:
    """Return the data of a curve: its values, and the ends of its bands as distances from the values."""
    colours, dash, width = painted(curve, k, count)
    values = np.asarray(curve.values, dtype=float)
    exact = len(values) <= EXACT or chart.plane is not None
    allowed = None if exact else _allowed(curve, values)
    # numbers without a band need at most seven digits
    short = chart.short or not (exact or curve.bands)
    part = SHORT if axis_of(chart) is TIME else FINE
    if short:
        first = _distance(values, 0.0) if exact else packed_relative(values, part)
    else:
        first = packed(values) if allowed is None else packed_within(values, allowed)
    lines = [{"name": curve.quantity, "values": first}]
    stored = values if short or allowed is None else unpacked(first).astype(float)
    bands = []
    for band in curve.bands:
        ends = {"name": band.name, "low": len(lines), "high": len(lines) + 1}
        bands.append(ends | {"bars": True} if band.bars else ends)
        for end, edge in (("lower", band.low), ("upper", band.high)):
            # where the value is NaN, the end itself is stored instead of the distance
            away = _distance(np.asarray(edge, dtype=float), np.nan_to_num(stored), allowed)
            lines.append({"name": f"{end} end of {band.name}", "values": away})
    data: dict[str, Any] = {
        "label": curve.name,
        "colours": list(colours),
        "dash": list(dash),
        "width": width,
        "lines": lines,
        "bands": bands,
        "columns": [_column(column) for column in curve.columns if not _named(column)],
    }
    texts = [{"name": one.name, "values": np.asarray(one.values).tolist()} for one in curve.columns if _named(one)]
    how = {"points": "dots", "bars": "bars", "dotted": "points", "filled": "filled"}.get(curve.drawn)
    data |= ({how: True} if how else {}) | _only(
        {"texts": texts, "marks": [list(map(float, one)) for one in curve.marks]}
    )
    if curve.places is not None:
        data["places"] = packed(np.asarray(curve.places, dtype=float))
    if curve.strands is not None and curve.strands.at is not None:
        across, up = curve.strands.across, curve.strands.up
        origin = [float(across[0, 0]), float(up[0, 0])]
        data["strands"] = {"name": curve.strands.name, "at": curve.strands.at.tolist(), "origin": origin}
        data["strands"] |= {"across": _distance(across, origin[0]), "up": _distance(up, origin[1])}
    if look := curve.look:
        data |= _only({key: getattr(look, key) for key in ("shape", "size", "hollow", "joined", "quiet")})
    return data


def _named(column: Column) -> bool:
    return np.asarray(column.values).dtype.kind in "UO"


def _column(column: Column) -> dict[str, Any]:
    values = np.asarray(column.values, dtype=float)
    if column.units is None:
        few = len(values) <= EXACT
        return {"name": column.name, "values": _distance(values, 0.0) if few else packed_relative(values, SHORT)}
    return {"name": column.name, "values": packed(values), "units": column.units, "digits": column.digits}


def _boxes(boxes: Boxes) -> dict[str, Any]:
    sides = {"left": packed(boxes.left), "right": packed(boxes.right), "shade": packed(boxes.shade)}
    return {"name": boxes.name, "units": boxes.units, **sides, "ends": list(boxes.ends), "log": boxes.log}


def _allowed(curve: Curve, values: Array) -> Array | None:
    """Return the allowed errors (T,) of the numbers of a line with bands in a page; None for other curves."""
    if curve.drawn not in ("line", "dotted") or not curve.bands or not np.isfinite(values).any():
        return None
    ends = [np.asarray(edge, dtype=float) for band in curve.bands for edge in (band.low, band.high)]
    widest = np.nan_to_num(np.abs(np.stack(ends) - values)).max(axis=0)
    least = RELATIVE * np.nanmax(np.abs(values), initial=0.0, where=np.isfinite(values))
    return np.asarray(np.maximum(DIGITS * widest, least or np.finfo(float).tiny))


def _distance(values: Array, origin: Array | float, allowed: Array | None = None) -> dict[str, Any]:
    """Pack distances with seven digits, or with all digits if float32 cannot represent them."""
    distance = values - origin
    largest = float(np.nan_to_num(np.abs(distance)).max(initial=0.0))
    kind: Kind = "float32" if largest == 0 or 1e-30 < largest < 1e30 else "float64"
    return packed(distance, kind) if allowed is None else packed_within(distance, allowed, kind)
