"""How probably requirements have been violated, over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.report.drawing import arrange, axes_grid, few_ticks, style, wrapped
from uqmbd.report.figures.selection import Results, nodes_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["MOST_REQUIREMENTS", "changing_with_time", "violated_by"]

MOST_REQUIREMENTS = 12
"""Requirements that are drawn."""


def changing_with_time(data: xr.Dataset) -> list[str]:
    """Name the requirements whose probability of having been violated grows with time."""
    if "violated_by" not in data or data.sizes.get("time", 0) < 2:
        return []
    grows = (data["violated_by"].max("time") > data["violated_by"].min("time")).values
    return [str(name) for name in data["requirement"].values[grows]]


def violated_by(results: Results) -> Figure:
    """Draw the probability of having been violated by each time, of requirements that are not violated from the start.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of nodes
        A study's result, or nodes of methods.

    Returns
    -------
    matplotlib.figure.Figure
        Axes for each requirement, the first twelve; at the end the 95 % interval of the whole motion.

    Raises
    ------
    StudyError
        If there are no such requirements.

    Examples
    --------
    >>> import xarray as xr
    >>> from uqmbd.results import requirements_dataset
    >>> data = requirements_dataset(["overload"], violation_probability=[0.02], lower=[0.01], upper=[0.04],
    ...                             times=[0, 1], violated_by=[[0, 0.02]])
    >>> node = xr.DataTree.from_dict({"requirements": data}, name="mine")
    >>> violated_by({"mine": node}).axes[0].get_title("left")
    'overload'
    """
    from matplotlib.lines import Line2D

    nodes = nodes_of(results)
    found = {k: n.children["requirements"].to_dataset() for k, n in nodes.items() if "requirements" in n.children}
    names = list(dict.fromkeys(name for data in found.values() for name in changing_with_time(data)))[
        :MOST_REQUIREMENTS
    ]
    if not names:
        raise StudyError("There are no requirements whose probability of being violated grows with time.")
    figure, grid = axes_grid(len(names), 1.75)
    for axes, name in zip(grid, names, strict=True):
        highest = 0.0
        for number, data in enumerate(found.values()):
            if "violated_by" not in data or name not in data["requirement"].values:
                continue
            one, (colour, line) = data.sel(requirement=name), style(number)
            share, times = 100 * one["violated_by"].values, one["time"].values
            axes.plot(times, share, color=colour, ls=line, lw=1.5)
            low, high = (100 * one["interval"].values).tolist()
            shift = (0.015 + 0.015 * number) * float(times[-1] - times[0])
            axes.plot([times[-1] + shift] * 2, [low, high], color=colour, lw=3, solid_capstyle="butt")
            # an interval that says nothing leaves the curve readable
            highest = max(highest, float(np.nanmax(share, initial=0.0)), high if high < 100 else 0.0)
        axes.set_ylim(0, 1.08 * highest or 1)
        axes.set_title(wrapped(name, 32), fontsize="medium", fontweight="bold", loc="left")
        axes.set_ylabel("violated [%]")
        axes.set_xlabel("time [s]")
        few_ticks(axes)
    handles: dict[str, Any] = {}
    if len(found) > 1:
        styles = [style(k) for k in range(len(found))]
        handles = {name: Line2D([], [], color=c, ls=ls, lw=1.5) for name, (c, ls) in zip(found, styles, strict=True)}
    arrange(figure, grid, min(2, len(names)), legend=handles)
    return figure
