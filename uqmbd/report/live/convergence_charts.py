"""Data of charts of what methods know of their own errors."""

from __future__ import annotations

from typing import Any

import numpy as np

from uqmbd.report.drawing import decades
from uqmbd.report.figures import ESTIMATED, LIMIT, Band, Curve, Results, Samples, settling, stated_errors
from uqmbd.report.live.chart_data import curves_data

__all__ = ["errors_data", "settling_data"]

PALE = ("#8a8f96", "#7d868f")
"""Colours, on a light and on a dark page, of what stands for several things."""


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
    first_decade, last_decade = decades(*(100 * end for end in found.ends))
    worst = np.fmax.reduce([np.asarray(curve.values)[chosen] for curve in curves])
    return data | {
        "up": {"log": True, "low": 10.0**first_decade, "high": 10.0**last_decade},
        "limits": [{"name": f"limit {100 * LIMIT:g} %", "value": 100 * LIMIT}],
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
                "across": across,
                "limits": [{"name": "final value", "value": float(centre[-1]), "reference": True}],
                "start": len(found.counts) - 1,
            }
            | ({} if ends is None else {"up": {"low": ends[0], "high": ends[1]}})
        )
    return {"choose": "What is estimated", "seen": 0, "views": views}
