"""What a chart of the page is drawn from, as data for JSON: `charts.js` reads it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.report.drawing import ON_DARK, line_width, style
from uqmbd.report.figures import Band, Curve, band_edges, of_output, thinned
from uqmbd.report.live.packing import packed
from uqmbd.wording import typeset_units

__all__ = ["MOST_TIMES", "at_times", "bands_data", "curve_data", "curves_data"]

MOST_TIMES = 1000
"""Times of a chart: more than a screen has pixels for lines of two; a peak between them is kept."""

_Array = NDArray[np.float64]


def bands_data(
    nodes: Mapping[str, xr.DataTree], output: str, most: int = MOST_TIMES, *, limits: Mapping[str, float] | None = None
) -> dict[str, Any] | None:
    """Return the mean, bands and standard deviation of an output over time, by each method.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree
        Results of methods by label; each has the output.
    output : str
    most : int
        How many times at most; of more those are taken that have the peaks, as figures do.
    limits : mapping of str to float, optional
        Values that the output has to stay within, by what they are called.

    Returns
    -------
    dict or None
        ``output``, ``units`` (as they are shown), ``time`` (seconds), ``of`` (how many times there are), ``follows``
        (that the page's surrogate may be of this output), ``start`` (the
        index of the largest standard deviation of the first method), and ``methods``: for each its ``label``,
        ``colours`` (on a light and on a dark page), ``dash`` and ``width``, ``lines`` (the mean first; values of others
        are stored as the distance from it), ``bands`` (names, and which lines are their edges) and ``columns``, which
        are told and not drawn; ``limits``: name and value of each. None if there are fewer than two times.
    """
    statistics = {label: of_output(node.children["statistics"], output) for label, node in nodes.items()}
    first = next(iter(statistics.values()))
    edges, _, _ = band_edges(first)
    times = first["time"].values[thinned(edges[0], edges[1], most)]
    # a method that ends later than the first one has further times
    known = np.unique(np.concatenate([data["time"].values for data in statistics.values()]))
    times = np.union1d(times, known[known > times[-1]][: max(most - len(times), 0)])
    if len(times) < 2:
        return None
    spread = at_times(first, times, first["std"].values)
    return {
        "output": output,
        "units": typeset_units(str(first["output_units"].item())),
        "time": packed(times),
        "of": len(known),
        "follows": True,
        "start": int(np.nan_to_num(spread, nan=-1.0).argmax()),
        "limits": [{"name": name, "value": float(value)} for name, value in (limits or {}).items()],
        "methods": [_method(k, len(nodes), label, data, times) for k, (label, data) in enumerate(statistics.items())],
    }


def curves_data(
    name: str,
    times: _Array,
    curves: Sequence[Curve],
    units: str,
    most: int = MOST_TIMES,
    *,
    told: Sequence[Mapping[str, _Array]] | None = None,
) -> tuple[dict[str, Any], NDArray[np.intp]]:
    """Return the data of a chart of curves, in the form of `bands_data`, and which times are in it.

    Parameters
    ----------
    name : str
        What is drawn: that of the vertical axis.
    times : array, shape (T,)
        Increasing, s.
    curves : sequence of Curve
        As `checked` returns them.
    units : str
    most : int
        About how many times at most; the peaks of each curve are among them.
    told : sequence of mapping of str to array, shape (T,), optional
        What is told of each curve besides, and not drawn.
    """
    besides = [{}] * len(curves) if told is None else told
    share = max(most // len(curves), 100)
    chosen = np.unique(np.concatenate([_with_peaks(curve, share) for curve in curves]))
    first = curves[0]
    spread = [np.asarray(band.high, dtype=float) - np.asarray(band.low, dtype=float) for band in first.bands[:1]]
    return {
        "output": name,
        "units": typeset_units(units),
        "time": packed(times[chosen]),
        "of": len(times),
        "start": int(np.nan_to_num(spread[0][chosen], nan=-1.0).argmax()) if spread else 0,
        "methods": [
            curve_data(k, len(curves), curve.at(chosen), {what: values[chosen] for what, values in besides[k].items()})
            for k, curve in enumerate(curves)
        ],
    }, chosen


def _with_peaks(curve: Curve, most: int) -> NDArray[np.intp]:
    edges = (curve.bands[0].low, curve.bands[0].high) if curve.bands else (curve.values, curve.values)
    low, high = (
        np.nan_to_num(np.asarray(edge, dtype=float), nan=fill)
        for edge, fill in zip(edges, (np.inf, -np.inf), strict=True)
    )
    return thinned(low, high, most)


def _method(k: int, count: int, label: str, data: xr.Dataset, times: _Array) -> dict[str, Any]:
    wide, narrow, wide_name = band_edges(data)
    bands = [
        Band(name, at_times(data, times, edges[0]), at_times(data, times, edges[1]))
        for name, edges in ((wide_name, wide), ("50 % of realisations", narrow))
        if edges is not None
    ]
    mean, std = (at_times(data, times, data[key].values) for key in ("mean", "std"))
    return curve_data(k, count, Curve(label, mean, tuple(bands), "mean"), {"standard deviation": std})


def curve_data(
    k: int, count: int, curve: Curve, told: Mapping[str, _Array] | None = None, *, short: bool = False
) -> dict[str, Any]:
    """Return the data of the k-th of some curves, with what is told of it and not drawn; ``short``: to seven digits."""
    colour, line = style(k)
    values = np.asarray(curve.values, dtype=float)
    lines = [{"name": curve.quantity, "values": _distance(values, 0.0) if short else packed(values)}]
    bands = []
    for band in curve.bands:
        ends = {"name": band.name, "low": len(lines), "high": len(lines) + 1}
        bands.append(ends | {"bars": True} if band.bars else ends)
        for end, edge in (("lower", band.low), ("upper", band.high)):
            # where only the band is known, its ends stand themselves
            away = _distance(np.asarray(edge, dtype=float), np.nan_to_num(values))
            lines.append({"name": f"{end} end of {band.name}", "values": away})
    drawn: dict[str, bool] = {"points": {"dots": True}, "bars": {"bars": True}}.get(curve.drawn, {})
    return {
        "label": curve.name,
        "colours": [colour, ON_DARK[k % len(ON_DARK)]],
        "dash": [] if line == "-" else list(line[1]),
        "width": line_width(k, count),
        "lines": lines,
        "bands": bands,
        "columns": [{"name": name, "values": _distance(column, 0.0)} for name, column in (told or {}).items()],
    } | drawn


def at_times(data: xr.Dataset, times: _Array, values: _Array) -> _Array:
    """Return values at some of their own times; NaN where there are none."""
    own = data["time"].values
    place = np.clip(np.searchsorted(own, times), 0, len(own) - 1)
    return np.where(own[place] == times, np.asarray(values, dtype=float)[place], np.nan)


def _distance(values: _Array, origin: _Array | float) -> dict[str, Any]:
    """Pack what is as small as a spread with seven digits, or, where float32 has no such numbers, with all."""
    distance = values - origin
    largest = float(np.nan_to_num(np.abs(distance)).max())
    return packed(distance, "float32" if largest == 0 or 1e-30 < largest < 1e30 else "float64")
