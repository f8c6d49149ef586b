"""What was asked: requirements with their probabilities; of other outputs the numbers that tell most."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from uqmbd.names import ANY
from uqmbd.report.figures import band_edges
from uqmbd.report.overview.influences import Influences, of_history, of_requirement, of_scalar
from uqmbd.report.sections import Content, ranked
from uqmbd.report.view import Method, StudyResult
from uqmbd.results import Answer, answers
from uqmbd.results.assessment import STILL, Reliability
from uqmbd.typing import Array
from uqmbd.wording import format_cells, format_interval_ends, format_probability

__all__ = ["answer_of", "asked", "in_view"]

ROWS = 5
"""Rows of the first screen."""

MET, UNMET, UNSURE = ("✓", "met", 2), ("✗", "not met", 0), ("!", "not certain", 1)


def asked(result: StudyResult) -> Content:
    """Return the table of what was asked.

    Returns
    -------
    dict
        ``kind``: ``requirements``, ``outputs`` or ``scalars``; ``rows``; ``more``: how many rows are elsewhere; and
        ``allowed``: with which probability a requirement may be violated, or empty.
    """
    allowed = result.tree.attrs.get("allowed_probability")
    if found := answers(result.nodes):
        rows = [_requirement(result, name) for name in found]
        # that any is violated is said last; most probable ones first
        rows.sort(key=lambda row: (row["name"] == ANY, -row["probability"]))
        more = len(rows) - ROWS
        shown = [*rows[: ROWS - 1], rows[-1]] if more > 0 else rows
        words = "" if allowed is None else format_probability(float(allowed))
        return {"kind": "requirements", "rows": shown, "more": max(more, 0), "allowed": words}
    if names := result.histories:
        every = [one for name in ranked(result, names) for one in result.assessment.of(name)]
        rows = [_history(result, one) for one in every[:ROWS]]
        return {"kind": "outputs", "rows": rows, "more": len(every) - len(rows), "allowed": ""}
    every = [one for name in result.scalar_names for one in result.assessment.of(name, "scalar")]
    rows = [_scalar(result, one) for one in every[:ROWS]]
    return {"kind": "scalars", "rows": rows, "more": len(every) - len(rows), "allowed": ""}


def in_view(result: StudyResult) -> str:
    """Return the output that the first screen draws: that of the most probable violation, else the most uncertain."""
    names, found = result.histories, answers(result.nodes)
    limited = [one for one in result.limits if one["output"] in names and one["requirement"] in found]
    if limited:
        worst = max(limited, key=lambda one: _probability(result, str(one["requirement"])))
        return str(worst["output"])
    return ranked(result, names)[0] if names else ""


def _probability(result: StudyResult, name: str) -> float:
    return answer_of(result, name).probability


def answer_of(result: StudyResult, name: str) -> Answer:
    """Return what is said of a requirement by the method whose numbers are shown."""
    return answers(result.nodes)[name][result.assessment.of(name, "requirement")[0].method]


def _requirement(result: StudyResult, name: str) -> Content:
    one, (found,) = answer_of(result, name), result.assessment.of(name, "requirement")
    sign, verdict, level = "", "", 3
    if "allowed_probability" in result.tree.attrs:
        sign, verdict, level = {True: MET, False: UNMET, None: UNSURE}[found.met]
    return {
        "name": name,
        "meaning": one.meaning,
        "probability": one.probability if math.isfinite(one.probability) else 1.0,
        "value": format_probability(one.probability),
        "interval": format_interval_ends(one.lower, one.upper),
        "sign": sign,
        "verdict": verdict,
        "sign_level": level,
        "because": _because(of_requirement(result, name)) if name != ANY else "",
        "method": one.method,
    }


def _because(found: Influences | None) -> str:
    return "" if found is None else found.words


def _history(result: StudyResult, one: Reliability) -> Content:
    name, method = one.quantity, result.methods[one.method]
    data, units = method.of(name), method.units(name)
    row = {"name": one.name, "meaning": "", "method": method.label, "extremes": _extremes(data, units)}
    if one.level == 3:
        return {**row, "spread": "none", "when": "", "note": STILL, "because": ""}
    std = np.nan_to_num(data["std"].values, nan=-1.0)
    at = int(std.argmax())
    return {
        **row,
        "spread": str(format_cells([float(std[at])], units)[0]),
        "when": f"{float(data['time'][at]):.4g} s",
        "note": "",
        "because": _because(of_history(result.alike(one.method), name)),
    }


def _extremes(data: xr.Dataset, units: str) -> Content:
    """Return the lowest and the highest end of the band of 95 % over time, and when."""
    (low, high), _, what = band_edges(data)
    times = np.asarray(data["time"].values, dtype=float)
    ends = [_at(low, times, np.nanargmin), _at(high, times, np.nanargmax)]
    shown = [value for value, _ in ends]
    return {
        "low": str(format_cells(shown)[0]),
        "high": str(format_cells(shown, units)[1]),
        "low_at": f"{ends[0][1]:.4g} s",
        "high_at": f"{ends[1][1]:.4g} s",
        "what": what,
    }


def _at(values: Array, times: Array, which: object) -> tuple[float, float]:
    if not np.isfinite(values).any():
        return math.nan, math.nan
    k = int(which(values))  # type: ignore[operator]
    return float(values[k]), float(times[k])


def _scalar(result: StudyResult, one: Reliability) -> Content:
    numbers = _of_scalar(result.scalars[one.method], one.quantity)
    because = _because(of_scalar(result.alike(one.method), one.quantity))
    return {"name": one.name, "meaning": "", "method": one.method, **numbers, "because": because}


def _of_scalar(method: Method, name: str) -> Content:
    data, units = method.of(name), method.units(name)
    levels = data["probability"].values
    ends = []
    for p in (0.025, 0.975):
        k = int(np.abs(levels - p).argmin()) if levels.size else -1
        known = k >= 0 and abs(levels[k] - p) < 1e-6
        ends.append(float(data["quantile"].values[k]) if known else math.nan)
    known = bool(np.isfinite(ends).all())
    std = float(data["std"])
    (mean,), (spread,) = format_cells([float(data["mean"])], units, scale=std), format_cells([std], units)
    return {
        "mean": str(mean),
        "spread": str(spread),
        "interval": f"{format_cells(ends)[0]} to {format_cells(ends, units)[1]}" if known else "unknown",
    }
