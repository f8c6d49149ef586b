"""Fewer places of curves than there are, such that no peak is lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from uqmbd.report.charts.model import Chart, Curve

__all__ = ["thinned", "thinned_chart"]

MOST_POINTS = 600


def thinned(low: NDArray[np.float64], high: NDArray[np.float64], most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Choose at most ``most`` of many times, such that no peak between a lower and an upper curve is lost.

    Parameters
    ----------
    low, high : array, shape (T,)
        Lower and upper edge of what is drawn.
    most : int
        Four or more.

    Returns
    -------
    array of int
        Increasing, with the first and the last.

    Examples
    --------
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
