"""Charts of the probability of violation of requirements over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.report.charts import Band, Chart, Curve, Views, draw_on_paper
from uqmbd.report.drawing import decades
from uqmbd.report.figures.over_time import at_times
from uqmbd.report.figures.selection import Results, nodes_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["MOST_REQUIREMENTS", "changing_with_time", "violated_by", "violations_chart", "worst_violations_chart"]

MOST_REQUIREMENTS = 12
"""Maximum number of requirements in a figure."""

RARE = 1.0
"""Probability of violation, per cent, below which the axis is logarithmic."""

DECADES = 4
"""Maximum number of powers of ten below the smallest final probability on a logarithmic axis."""


def changing_with_time(data: xr.Dataset) -> list[str]:
    """Return the names of requirements with a probability of violation that grows with time."""
    if "violated_by" not in data or data.sizes.get("time", 0) < 2:
        return []
    grows = (data["violated_by"].max("time") > data["violated_by"].min("time")).values
    return [str(name) for name in data["requirement"].values[grows]]


@typechecked
def violated_by(results: Results) -> Figure:
    """Draw the probability of violation until each time, for requirements that are not violated from the start.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of nodes
        Result of a study, or nodes of methods.

    Returns
    -------
    matplotlib.figure.Figure
        Figure with axes for each of the first twelve requirements, with 95 % intervals.

    Raises
    ------
    StudyError
        If there are no such requirements.

    Examples
    --------
    >>> import xarray as xr
    >>> from uqmbd.extend import requirements_dataset
    >>> data = requirements_dataset(["overload"], violation_probability=[0.02], lower=[0.01], upper=[0.04],
    ...                             times=[0, 1], violated_by=[[0, 0.02]])
    >>> node = xr.DataTree.from_dict({"requirements": data}, name="mine")
    >>> violated_by({"mine": node}).axes[0].get_title("right")
    'overload'
    """
    found = violations_chart(nodes_of(results))
    if found is None:
        raise StudyError("There are no requirements whose probability of violation grows with time.")
    return draw_on_paper(found)


def violations_chart(nodes: Mapping[str, xr.DataTree]) -> Views | None:
    """Chart the probability of violation until each time by each method, with one chart for each requirement.

    Bands are 95 % intervals at each time; a bar at the end is the interval of the whole motion. Return None if no
    probability grows.
    """
    found = _requirements_chart(nodes)
    names = _growing(found)
    if not names:
        return None
    charts = []
    for name in names:
        curves = {label: data.sel(requirement=name) for label, data in found.items() if _is_stated(data, name)}
        charts.append(replace(_violation(name, curves), title=name, heading=name))
    worst = [
        float(max(d.sel(requirement=n)["violated_by"].max() for d in found.values() if _is_stated(d, n))) for n in names
    ]
    return Views(charts, "Requirement", int(np.argmax(worst)))


def worst_violations_chart(nodes: Mapping[str, xr.DataTree], most: int = 6) -> Chart | None:
    """Chart the probability of violation until each time for the most probable violations.

    A single requirement has a curve for each method. For several requirements, each has a curve of the first method
    whose probabilities grow. Return None if no probability grows.
    """
    found = _requirements_chart(nodes)
    names = _growing(found)
    if len(names) == 1:
        name = names[0]
        return _violation(name, {k: d.sel(requirement=name) for k, d in found.items() if _is_stated(d, name)})
    data = next((one for one in found.values() if changing_with_time(one)), None)
    if data is None:
        return None
    last = {name: float(data["violated_by"].sel(requirement=name).max()) for name in names if _is_stated(data, name)}
    chosen = sorted(last, key=lambda name: -last[name])[:most]
    return _violation("requirements", {name: data.sel(requirement=name) for name in last if name in chosen})


def _requirements_chart(nodes: Mapping[str, xr.DataTree]) -> dict[str, xr.Dataset]:
    return {k: n.children["requirements"].to_dataset() for k, n in nodes.items() if "requirements" in n.children}


def _growing(found: Mapping[str, xr.Dataset]) -> list[str]:
    return list(dict.fromkeys(name for data in found.values() for name in changing_with_time(data)))[:MOST_REQUIREMENTS]


def _is_stated(data: xr.Dataset, name: str) -> bool:
    """Return whether a method states the probability of violation until each time, even if it is constant."""
    return "violated_by" in data and data.sizes.get("time", 0) > 1 and name in data["requirement"].values


def _violation(name: str, found: Mapping[str, xr.Dataset]) -> Chart:
    times = np.unique(np.concatenate([np.asarray(data["time"].values, dtype=float) for data in found.values()]))
    curves, tops, last_values = [], [0.0], []
    for label, data in found.items():
        values = 100 * at_times(data, times, data["violated_by"].values)
        last = len(times) - 1 - int(np.isfinite(values)[::-1].argmax())
        interval = 100 * np.asarray(data["interval"].values, dtype=float)
        low, high = (np.where(np.arange(len(times)) == last, end, np.nan) for end in interval)
        bands = [Band("95 % interval of the whole motion", low, high, True)]
        if name != "requirements" and "violated_by_interval" in data:
            by = data["violated_by_interval"]
            low, high = (100 * at_times(data, times, by.sel(bound=end).values) for end in ("lower", "upper"))
            bands.insert(0, Band("95 % interval at each time", low, high))
        curves.append(Curve(label, values, tuple(bands), "violated"))
        # the height of the axes ignores an interval up to 100 %, beside which the curve would not be visible
        tops += [float(np.nanmax(values, initial=0.0)), float(interval[1]) if interval[1] < 100 else 0.0]
        last_values.append(float(np.nanmax(values, initial=0.0)))
    top = max(tops)
    has = "have" if name == "requirements" else "has"
    positive = [value for value in last_values if value > 0]
    rare = bool(positive) and top < RARE
    ends = (0.0, min(1.08 * top, 100.0) or 1.0)
    if rare:
        every = np.concatenate([np.asarray(curve.values) for curve in curves])
        least = max(float(every[every > 0].min()), min(positive) / 10**DECADES)
        first, final = decades(least, top)
        ends = float(f"1e{first}"), float(f"1e{final}")
    name = f"probability that {name} {has} been violated"
    looks: dict[str, Any] = {"axis": "violated", "digits": True, "start": len(times) - 1}
    return Chart(name, times, curves, units="%", ends=ends, log=rare, **looks)
