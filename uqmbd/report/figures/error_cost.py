"""Error against cost: how the errors of methods fall with what they cost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.report.drawing import arrange, axes_grid, log_axis, shortened, style
from uqmbd.typing import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["MARKS", "Spent", "error_cost", "errors_of", "own_error"]

MARKS = {"disc": "o", "square": "s", "diamond": "D", "up": "^", "down": "v", "plus": "P"}
"""Shapes of points, one a method, by the letters that Matplotlib has for them: no two look alike without colour."""

SMALLEST = 1e-16
"""Errors that are rounding, and have no place on a logarithmic axis."""


@dataclass(frozen=True, eq=False)
class Spent:
    """Errors of a method at its levels, and what these cost.

    Attributes
    ----------
    method : str
    quantity : {"mean", "std"}
    errors : array, shape (L,)
        Relative; NaN: not known, or too small to be drawn.
    realisations, wall_time : array, shape (L,)
        NaN where they are not known, or zero.
    levels : tuple of str
        What the levels are called.
    """

    method: str
    quantity: str
    errors: Array
    realisations: Array
    wall_time: Array
    levels: tuple[str, ...]

    def along(self, cost: str) -> tuple[Array, Array, tuple[str, ...]]:
        """Return costs that are known, increasing, with their errors and levels; ``cost``: the name of an attribute."""
        spent: Array = getattr(self, cost)
        used = np.flatnonzero(np.isfinite(self.errors) & np.isfinite(spent))
        order = used[np.argsort(spent[used], kind="stable")]
        return spent[order], self.errors[order], tuple(self.levels[k] for k in order)


def errors_of(convergence: xr.Dataset, output: str) -> list[Spent]:
    """Return the errors of mean and standard deviation of each method, and what they cost.

    Raises
    ------
    StudyError
        If there is no such output, or no error above zero.
    """
    names = [str(name) for name in convergence["output"].values]
    if output not in names:
        raise StudyError(f"There is no output {output!r}; there are {', '.join(map(repr, names))}.")
    data = convergence.isel(output=names.index(output))
    found = []
    for m, label in enumerate(str(v) for v in data["method"].values):
        costs = {cost: np.asarray(data[cost].values[m], dtype=float) for cost in ("realisations", "wall_time")}
        runs, seconds = (np.where(one > 0, one, np.nan) for one in costs.values())
        told = data["level_name"].values[m] if "level_name" in data else range(1, len(runs) + 1)
        levels = tuple(str(text) for text in told)
        for name in ("mean", "std"):
            errors = np.asarray(data[f"{name}_error_l2"].values[m], dtype=float)
            shown = np.where(errors > SMALLEST, errors, np.nan)
            found.append(Spent(label, name, shown, runs, seconds, levels))
    if not any(len(one.along(cost)[0]) for one in found for cost in ("realisations", "wall_time")):
        raise StudyError(f"There is no error of {output!r} above zero to draw.")
    return found


_LOOKS: dict[str, tuple[Any, str]] = {"mean": ("-", ""), "std": ((0, (4, 2)), "white")}
"""How lines of a quantity are drawn, and what points are filled with: nothing is their own colour."""


def own_error(convergence: xr.Dataset, output: str, quantity: str) -> float:
    """Return the error that the reference states of itself; 0 where it states none."""
    place = [str(name) for name in convergence["output"].values].index(output)
    return float(np.nan_to_num(convergence[f"reference_{quantity}_error"].values[place]))


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

    found = errors_of(convergence, output)
    figure, grid = axes_grid(2, 2.2)
    handles: dict[str, Any] = {}
    known: Any = None
    seen: list[float] = []
    ranges: list[list[float]] = [[], []]
    letters = list(MARKS.values())
    for m, one in enumerate(found):
        colour, _ = style(m // 2)
        line, fill = _LOOKS[one.quantity]
        looks: dict[str, Any] = {"color": colour, "ls": line, "lw": 1.5, "marker": letters[m // 2 % 6], "ms": 5}
        for axes, cost, reach in zip(grid, ("realisations", "wall_time"), ranges, strict=True):
            spent, errors, _ = one.along(cost)
            (drawn,) = axes.plot(spent, errors, mfc=fill or colour, clip_on=False, **looks)
            reach += spent.tolist()
            seen += errors.tolist()
        if one.quantity == "mean":
            handles[one.method] = drawn
    for axes, reach, label in zip(grid, ranges, ("realisations", "wall time [s]"), strict=True):
        log_axis(axes, "x", min(reach), max(reach))
        log_axis(axes, "y", min(seen), max(seen))
        axes.set_xlim(*_beyond(*axes.get_xlim()))
        axes.set_ylim(*_beyond(*axes.get_ylim()))
        low, high = axes.get_ylim()
        for name, (line, _) in _LOOKS.items():
            own = own_error(convergence, output, name)
            if low < own < high:
                known = axes.axhline(own, color="0.55", ls=line, lw=1.0)
        axes.set_xlabel(label)
        axes.grid(color="0.9", lw=0.7)
    for what, (line, fill) in zip(("mean", "standard deviation"), _LOOKS.values(), strict=True):
        handles[what] = Line2D([], [], color="0.3", ls=line, lw=1.5, marker="o", ms=5, mfc=fill or "0.3")
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
