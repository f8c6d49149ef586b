"""Closest approach of an output to its limits, and charts of deviations for bands that are too narrow to be visible."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from uqmbd.report.charts import Band, Chart, Curve, Look
from uqmbd.typing import Array

__all__ = ["Approach", "OutputLimit", "closest_approach", "deviation_chart"]

NARROW = 0.05
"""Maximum ratio of the width of the outer band to the range of the chart at which the band is not visible."""

MARGIN = 1.6
"""Minimum ratio of the end of the axis of deviations to the largest deviation."""

FARTHEST = 8.0
"""Maximum ratio of the end of the axis of deviations to the largest deviation."""


@dataclass(frozen=True)
class OutputLimit:
    """Limit of an output that a requirement states."""

    requirement: str
    value: float
    end: str  # "highest" or "lowest" allowed value; empty: unknown


@dataclass(frozen=True)
class Approach:
    """Time at which the distance of the mean from a limit, in standard deviations, is smallest."""

    limit: OutputLimit
    place: int  # index of the time
    margin: float  # margin of the mean, in the units of the output; negative beyond the limit
    deviations: float  # margin of the mean, in standard deviations


def closest_approach(mean: Array, std: Array, limits: Sequence[OutputLimit]) -> Approach | None:
    """Return the closest approach of a mean (T,) to limits, in standard deviations (T,); None without spread."""
    found = None
    for limit in limits:
        away = limit.value - mean
        margin = away if limit.end == "highest" else -away if limit.end == "lowest" else np.abs(away)
        with np.errstate(divide="ignore", invalid="ignore"):
            scaled = np.where(std > 0, margin / std, np.nan)
        if np.isfinite(scaled).any():
            k = int(np.nanargmin(scaled))
            if found is None or scaled[k] < found.deviations:
                found = Approach(limit, k, float(margin[k]), float(scaled[k]))
    return found


def deviation_chart(chart: Chart, limits: Mapping[str, float]) -> Chart | None:
    """Return a chart of deviations from the mean of the first curve; None if the band is visible without it.

    `limits` contains values by name; each limit becomes a curve of its distance from this mean.
    """
    first = chart.curves[0]
    if not first.bands:
        return None
    base = np.asarray(first.values, dtype=float)
    low, high = (np.asarray(edge, dtype=float) for edge in (first.bands[0].low, first.bands[0].high))
    if not np.isfinite(base).any() or not np.isfinite(high - low).any():
        return None
    reach = float(np.nanmax(np.maximum(high - base, base - low)))
    whole = float(np.nanmax(high) - np.nanmin(low))
    if not 0 < float(np.nanmax(high - low)) < NARROW * whole:
        return None
    curves = [_less(curve, base) for curve in chart.curves]
    nearest = reach
    for name, value in limits.items():
        away = value - base
        look = Look(colour="limit", dash=(2.0, 2.0), width=1.4, quiet=True)
        curves.append(Curve(f"limit: {name}", away, quantity="distance of the limit from the mean", look=look))
        nearest = max(nearest, min(float(np.nanmin(np.abs(away))), FARTHEST * reach / MARGIN))
    end = MARGIN * nearest
    return replace(
        chart, curves=curves, limits={}, ends=(-end, end), follows=False, title="deviation",
        axis=f"deviation of {chart.name} from its mean",
    )  # fmt: skip


def _less(curve: Curve, base: Array) -> Curve:
    """Return a curve and its bands minus a base (T,)."""
    bands = tuple(Band(b.name, np.asarray(b.low) - base, np.asarray(b.high) - base, b.bars) for b in curve.bands)
    values = np.asarray(curve.values, dtype=float) - base
    return replace(curve, values=values, bands=bands, strands=None, quantity=f"deviation of the {curve.quantity}")
