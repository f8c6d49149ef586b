"""A chart as data for the page: thinned to what can be seen, and packed as JSON."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uqmbd.report.charts.model import Boxes, Chart, Column, Curve, Views, axis_of, painted, several
from uqmbd.typing import Array
from uqmbd.wording import typeset_units

__all__ = [
    "Kind",
    "MOST_TIMES",
    "chart_script",
    "json_script",
    "packed",
    "page_data",
    "thinned",
    "thinned_chart",
    "unpacked",
]


Kind = Literal["float32", "float64", "int32"]

_ESCAPES = str.maketrans({c: f"\\u{ord(c):04x}" for c in "<>&\u2028\u2029"})


def packed(values: ArrayLike, kind: Kind = "float64") -> dict[str, Any]:
    """Pack an array as data for JSON; NaN and infinities are kept.

    Raise ValueError if numbers do not fit in the kind: they are too large for it, or not whole.
    """
    given = np.asarray(values)
    with np.errstate(over="ignore", invalid="ignore"):
        made = given.astype(np.dtype(kind).newbyteorder("<"))
    fits = np.array_equal(made, given) if kind == "int32" else np.array_equal(np.isfinite(made), np.isfinite(given))
    if not fits:
        raise ValueError(f"The array has numbers that {kind} does not hold; use float64.")
    return {"kind": kind, "shape": list(made.shape), "base64": base64.b64encode(made.tobytes()).decode("ascii")}


def unpacked(data: Mapping[str, Any]) -> NDArray[Any]:
    """Return the array of `packed` data."""
    read = np.frombuffer(base64.b64decode(data["base64"]), dtype=np.dtype(data["kind"]).newbyteorder("<"))
    return read.reshape(data["shape"]).astype(data["kind"])


def json_script(data: Any) -> str:
    r"""Return JSON for `<script type="application/json">`: no text in it ends the element, or begins another one.

    Lone surrogates stay escaped, as all that is not ASCII.

    Raise ValueError if a number is not finite, which JSON does not hold: use None, or `packed` arrays.

    >>> json_script({"name": "</script>"})
    '{"name":"\\u003c/script\\u003e"}'
    """
    return json.dumps(data, allow_nan=False, separators=(",", ":")).translate(_ESCAPES)


MOST_POINTS = 600


def thinned(low: NDArray[np.float64], high: NDArray[np.float64], most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Choose at most ``most`` of many times, such that no peak between a lower and an upper curve is lost.

    `low`, `high` (T,): lower and upper edge of what is drawn; `most`: four or more. Return increasing, with the first
    and the last.

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
    """Return a chart of about ``most`` places with the peaks of each curve among them, and which places these are."""
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
"""Times of a chart: more than a screen has pixels for lines of two; a peak between them is kept."""


def chart_script(shown: Chart | Views | None) -> str | None:
    """Return what a page draws as JSON; None if there is nothing that lines could join."""
    charts = shown.charts if isinstance(shown, Views) else [shown] if shown is not None else []
    if not charts or not all(map(several, charts)):
        return None
    assert shown is not None
    return json_script(page_data(shown))


def page_data(shown: Chart | Views) -> dict[str, Any]:
    """Return a chart, or several of which one is seen at a time, as data for JSON."""
    if isinstance(shown, Views):
        return {"choose": shown.choose, "seen": shown.seen, "views": [page_data(chart) for chart in shown.charts]}
    chart, chosen = thinned_chart(shown, MOST_TIMES)
    count = len(chart.curves)
    data: dict[str, Any] = {
        "output": chart.name,
        "units": typeset_units(chart.units),
        "time": packed(np.asarray(chart.places)),
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
            "told": axis.told if axis.told is not None else axis.units,
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
    """Return the index, among those that are drawn, at which the cursor begins."""
    first = chart.curves[0].bands[:1]
    if chart.start is not None:
        return int(np.abs(chosen - chart.start).argmin())
    if not first:
        return 0
    width = np.asarray(first[0].high, dtype=float)[chosen] - np.asarray(first[0].low, dtype=float)[chosen]
    return int(np.nan_to_num(width, nan=-1.0).argmax())


def _method(curve: Curve, k: int, count: int, chart: Chart) -> dict[str, Any]:
    """Return a curve: its first line are its values, the ends of bands are stored as the distance from them."""
    colours, dash, width = painted(curve, k, count)
    values = np.asarray(curve.values, dtype=float)
    lines = [{"name": curve.quantity, "values": _distance(values, 0.0) if chart.short else packed(values)}]
    bands = []
    for band in curve.bands:
        ends = {"name": band.name, "low": len(lines), "high": len(lines) + 1}
        bands.append(ends | {"bars": True} if band.bars else ends)
        for end, edge in (("lower", band.low), ("upper", band.high)):
            # where only the band is known, its ends stand themselves
            away = _distance(np.asarray(edge, dtype=float), np.nan_to_num(values))
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
        return {"name": column.name, "values": _distance(values, 0.0)}
    return {"name": column.name, "values": packed(values), "units": column.units, "digits": column.digits}


def _boxes(boxes: Boxes) -> dict[str, Any]:
    sides = {"left": packed(boxes.left), "right": packed(boxes.right), "shade": packed(boxes.shade)}
    return {"name": boxes.name, "units": boxes.units, **sides, "ends": list(boxes.ends), "log": boxes.log}


def _distance(values: Array, origin: Array | float) -> dict[str, Any]:
    """Pack what is as small as a spread with seven digits, or, where float32 has no such numbers, with all."""
    distance = values - origin
    largest = float(np.nan_to_num(np.abs(distance)).max(initial=0.0))
    return packed(distance, "float32" if largest == 0 or 1e-30 < largest < 1e30 else "float64")
