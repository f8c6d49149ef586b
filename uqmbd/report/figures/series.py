"""Charts of series of scalar outputs, such as spectral densities over the frequency."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from uqmbd.report.charts import Axis, Band, Chart, Curve, Views
from uqmbd.results import output
from uqmbd.results.schema import output_places
from uqmbd.typing import Array
from uqmbd.wording import typeset_units

__all__ = ["in_series", "series_chart"]

WIDE = 30.0
"""Ratio of the largest to the smallest value above which an axis is logarithmic."""

LEVELS = (0.025, 0.975)
"""Probabilities of the ends of the band."""


def in_series(statistics: Mapping[str, xr.Dataset]) -> set[str]:
    """Return the names of outputs that belong to a series, for the statistics of scalar outputs by method."""
    return {
        str(name)
        for data in statistics.values()
        for name, place in zip(data["output"].values, output_places(data), strict=True)
        if place
    }


def series_chart(statistics: Mapping[str, xr.Dataset]) -> Views | None:
    """Chart the means and quantiles of each series over its axis; None without a series."""
    names = dict.fromkeys(p.series for data in statistics.values() for p in output_places(data) if p)
    charts = [_chart(name, {label: data for label, data in statistics.items() if _has(data, name)}) for name in names]
    return Views(charts, "Output") if charts else None


def _has(data: xr.Dataset, name: str) -> bool:
    return any(place is not None and place.series == name for place in output_places(data))


def _chart(name: str, statistics: Mapping[str, xr.Dataset]) -> Chart:
    curves, units, along = [], "1", Axis("")
    for label, data in statistics.items():
        one = output(data, name)
        axis = next(str(dim) for dim in one["mean"].dims)
        low, high = (one["quantile"].sel(probability=level, method="nearest").values for level in LEVELS)
        known = bool(np.isfinite([low, high]).all())
        bands = (Band("95 % of realisations", low, high),) if known else ()
        curves.append(Curve(label, one["mean"].values, bands, "mean", "dotted"))
        positions, units = one[axis].values, str(one["mean"].attrs.get("units", "1"))
        along = Axis(axis, typeset_units(str(one[axis].attrs.get("units", ""))), log=_wide(positions))
    lines = [line for curve in curves for line in (curve.values, *(x for b in curve.bands for x in (b.low, b.high)))]
    drawn = np.concatenate([np.ravel(line) for line in lines])
    drawn = drawn[np.isfinite(drawn)]
    ends_of_values = (float(drawn.min()) / 1.3, float(drawn.max()) * 1.3) if _wide(drawn) else None
    return Chart(name, positions, curves, name, units, along=along, ends=ends_of_values, log=_wide(drawn))


def _wide(values: Array) -> bool:
    """Return whether values are positive and cover decades."""
    return bool(values.size and values.min() > 0 and values.max() > WIDE * values.min())
