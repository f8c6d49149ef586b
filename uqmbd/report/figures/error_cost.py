"""Error against cost: how the errors of methods fall with what they cost."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.report.drawing import arrange, axes_grid, log_axis, shortened, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["error_cost"]

_MARKERS = "osD^vP"


def error_cost(convergence: xr.Dataset, output: str) -> Figure:
    """Draw the errors of mean (full lines) and standard deviation (dashed) against realisations and wall time.

    Parameters
    ----------
    convergence : xarray.Dataset
        From `uqmbd.Study.converge`.
    output : str
        Name of the output.

    Returns
    -------
    matplotlib.figure.Figure
        Axes: against realisations, and against wall time, both logarithmic. Grey lines are the errors that the
        reference states of itself, where it does: below them nothing can be told.

    Raises
    ------
    StudyError
        If there is no such output, or no error above zero.

    Examples
    --------
    >>> dims = ("method", "level", "output")
    >>> found = xr.Dataset(
    ...     {"mean_error_l2": (dims, [[[1e-2], [1e-3]]]), "std_error_l2": (dims, [[[1e-1], [1e-2]]]),
    ...      "realisations": (dims[:2], [[4, 9]]), "wall_time": (dims[:2], [[0.1, 0.2]]),
    ...      "reference_mean_error": ("output", [1e-5]), "reference_std_error": ("output", [1e-4])},
    ...     coords={"method": ["collocation"], "output": ["x"]}, attrs={"reference": "finest"})
    >>> figure = error_cost(found, "x")
    >>> figure.axes[0].get_xlabel(), figure.axes[0].lines[0].get_ydata().tolist()
    ('realisations', [0.01, 0.001])
    """
    from matplotlib.lines import Line2D

    names = [str(name) for name in convergence["output"].values]
    if output not in names:
        raise StudyError(f"There is no output {output!r}; there are {', '.join(map(repr, names))}.")
    data = convergence.isel(output=names.index(output))
    figure, grid = axes_grid(2, 2.2)
    handles: dict[str, Any] = {}
    known: Any = None
    seen: list[float] = []
    ranges: list[list[float]] = [[], []]
    for m, label in enumerate(str(v) for v in data["method"].values):
        colour, _ = style(m)
        for name, line, fill in (("mean", "-", colour), ("std", (0, (4, 2)), "white")):
            errors = data[f"{name}_error_l2"].values[m]
            looks: dict[str, Any] = {"color": colour, "ls": line, "lw": 1.5, "marker": _MARKERS[m % 6], "ms": 5}
            for axes, cost, reach in zip(grid, ("realisations", "wall_time"), ranges, strict=True):
                spent = np.asarray(data[cost].values[m], dtype=float)
                used = np.isfinite(errors) & (errors > 1e-16) & np.isfinite(spent) & (spent > 0)
                order = np.argsort(spent[used], kind="stable")
                (drawn,) = axes.plot(spent[used][order], errors[used][order], mfc=fill, clip_on=False, **looks)
                reach += spent[used].tolist()
                seen += errors[used].tolist()
            if name == "mean":
                handles[label] = drawn
    if not seen or not ranges[1]:
        raise StudyError(f"There is no error of {output!r} above zero to draw.")
    for axes, reach, label in zip(grid, ranges, ("realisations", "wall time [s]"), strict=True):
        log_axis(axes, "x", min(reach), max(reach))
        log_axis(axes, "y", min(seen), max(seen))
        axes.set_xlim(*_beyond(*axes.get_xlim()))
        axes.set_ylim(*_beyond(*axes.get_ylim()))
        low, high = axes.get_ylim()
        for name, line in (("mean", "-"), ("std", (0, (4, 2)))):
            own = float(np.nan_to_num(data[f"reference_{name}_error"]))
            if low < own < high:
                known = axes.axhline(own, color="0.55", ls=line, lw=1.0)
        axes.set_xlabel(label)
        axes.grid(color="0.9", lw=0.7)
    for what, line, fill in (("mean", "-", "0.3"), ("standard deviation", (0, (4, 2)), "white")):
        handles[what] = Line2D([], [], color="0.3", ls=line, lw=1.5, marker="o", ms=5, mfc=fill)
    if known is not None:
        handles["error of the reference"] = known
    reference = shortened(f"reference: {convergence.attrs.get('reference', '')}").replace("$", r"\$")
    grid[0].set_title(reference, fontsize=9, y=1.0, loc="left")
    grid[0].set_ylabel("relative error")
    arrange(figure, grid, 2, legend=handles, heights=(1.85,))
    return figure


def _beyond(low: float, high: float) -> tuple[float, float]:
    """Return ends a little apart on a logarithmic scale: no point lies on an axis."""
    share = float((high / low) ** 0.04)
    return low / share, high * share
