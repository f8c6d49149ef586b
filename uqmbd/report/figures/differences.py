"""How far methods agree: their difference to a reference over time, and its fall with the order of a chaos."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.errors import StudyError
from uqmbd.report.drawing import (
    arrange,
    axes_grid,
    limit_times,
    line_width,
    log_axis,
    shortened,
    style,
    with_units,
    wrapped,
)
from uqmbd.report.figures.selection import Results, nodes_of, of_output, thinned
from uqmbd.report.figures.surrogates import chaos_nodes, finest, order_of, series, times_of
from uqmbd.results import choose_reference
from uqmbd.typing import Array
from uqmbd.wording import format_integer

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Convergence", "differences", "order_convergence", "orders_of", "sampling_errors"]


_MARKERS = "osD^vP"


def differences(results: Results, output: str, *, reference: str | None = None) -> Figure:
    """Draw by how much mean and standard deviation of methods differ, where their bands look the same.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of nodes
        At least two methods with the same times.
    output : str
        Name of the output.
    reference : str, optional
        Label of the method that is subtracted. Default: :func:`uqmbd.results.choose_reference`. Where it states
        standard errors, a band of two of them lies about zero.

    Returns
    -------
    matplotlib.figure.Figure
        Axes: difference of the mean, and of the standard deviation.

    Raises
    ------
    StudyError
        If there is one method only, the reference is unknown, or outputs or times differ.

    Examples
    --------
    >>> from uqmbd.results import labels, propagator_node, statistics_dataset
    >>> axes = labels([("x", "m")], [], [0.0, 1.0])
    >>> def node(label, mean):
    ...     statistics = statistics_dataset(axes, mean=[mean], std=[[0.1, 0.1]])
    ...     return propagator_node(label, statistics, propagator="p", realisations=1, wall_time=0.0)
    >>> figure = differences([node("a", [0.0, 1.0]), node("b", [0.0, 1.5])], "x")
    >>> figure.axes[0].lines[-1].get_ydata().tolist()
    [0.0, 0.5]
    """
    nodes = nodes_of(results)
    chosen = choose_reference(nodes) if reference is None else reference
    base = _statistics(nodes, chosen, output)
    if len(nodes) < 2:
        raise StudyError("A difference needs at least two methods; there is one.")
    times = times_of(base)
    figure, grid = axes_grid(2, 1.7, 1)
    units = str(base["output_units"].item())
    handles: dict[str, Any] = {}
    for axes, name, title in zip(grid, ("mean", "std"), ("difference of mean", "difference of std"), strict=True):
        centre = base[name].values
        handles[f"{chosen}, the reference"] = axes.axhline(0.0, color=style(list(nodes).index(chosen))[0], lw=1.4)
        reach = np.zeros(len(times))
        if f"std_error_{name}" in base:
            reach = 2 * np.nan_to_num(base[f"std_error_{name}"].values)
            where = thinned(-reach, reach)
            colour = style(list(nodes).index(chosen))[0]
            band = axes.fill_between(times[where], -reach[where], reach[where], color=colour, alpha=0.16, lw=0)
            handles["its ± 2 standard errors"] = band
        high = float(reach.max())
        for k, label in enumerate(nodes):
            if label == chosen:
                continue
            other = _statistics(nodes, label, output)
            if not np.array_equal(times_of(other), times):
                raise StudyError(f"Only methods with the same times can be subtracted; those of {label!r} differ.")
            off = other[name].values - centre
            where = thinned(off, off)
            colour, line = style(k)
            marker = "o" if len(times) == 1 else ""
            drawn = axes.plot(
                times[where], off[where], color=colour, ls=line, lw=line_width(k, len(nodes)), marker=marker
            )
            handles[label] = drawn[0]
            high = max(high, float(np.abs(off).max()))
        axes.set_ylim(*((-1.08 * high, 1.08 * high) if high > 0 else (-0.5, 0.5)))
        axes.set_ylabel(wrapped(with_units(title, units), 14))
        limit_times(axes, times)
        axes.grid(color="0.9", lw=0.7)
    grid[0].tick_params(labelbottom=False)
    grid[1].set_xlabel("time [s]")
    arrange(figure, grid, legend=handles, heights=(1.15, 1.15))
    return figure


def _statistics(nodes: Mapping[str, xr.DataTree], label: str, output: str) -> xr.Dataset:
    if label not in nodes:
        raise StudyError(f"The reference {label!r} is not among the methods {', '.join(map(repr, nodes))}.")
    return of_output(nodes[label].children["statistics"], output)


@dataclass(frozen=True, eq=False)
class Convergence:
    """Largest differences over time of one series of a chaos to a reference, over its largest standard deviation.

    Attributes
    ----------
    name : str
        Of the series.
    orders, realisations : array of int, shape (N,)
    mean, std : array, shape (N,)
    """

    name: str
    orders: NDArray[np.int64]
    realisations: NDArray[np.int64]
    mean: Array
    std: Array


def orders_of(results: Results, output: str, reference: str | None = None) -> tuple[str, list[Convergence]]:
    """Return the reference, and for each series of chaoses with several orders how far they are from it.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of nodes
    output : str
    reference : str, optional
        Default: the finest chaos. (A Monte Carlo reference would end the fall at its own standard error.)

    Raises
    ------
    StudyError
        If the reference is unknown, or no chaos is left to compare with it.
    """
    nodes = {label: node for label, node in nodes_of(results).items() if _has(node, output)}
    chosen = finest(nodes) if reference is None else reference
    base = _statistics(nodes, chosen, output)
    scale = float(base["std"].max()) or 1.0
    found = []
    for name, members in series(nodes).items():
        rows = [
            (order_of(nodes[m]), int(nodes[m].attrs.get("realisations", 0)), *_off(nodes[m], output, base, scale))
            for m in members
            if m != chosen
        ]
        if rows:
            orders, realisations, mean, std = (np.array(column) for column in zip(*rows, strict=True))
            found.append(Convergence(name, orders, realisations, mean, std))
    if not found:
        raise StudyError(
            f"There is no other chaos to compare {chosen!r} with; run the propagator at several orders, with labels "
            "as 'collocation-1', 'collocation-2'."
        )
    return chosen, found


def _has(node: xr.DataTree, output: str) -> bool:
    return output in [str(n) for n in node.children["statistics"].coords["output"].values]


def _off(node: xr.DataTree, output: str, base: xr.Dataset, scale: float) -> tuple[float, float]:
    other = of_output(node.children["statistics"], output)
    if not np.array_equal(times_of(other), times_of(base)):
        raise StudyError(f"Only methods with the same times can be compared; those of {node.name!r} differ.")
    mean, std = (float(np.abs(other[name].values - base[name].values).max()) / scale for name in ("mean", "std"))
    return mean, std


def order_convergence(results: Results, output: str, *, reference: str | None = None) -> Figure:
    """Draw how the error of a chaos falls with its order, and with the realisations that it took.

    The difference of mean (full lines) and standard deviation (dashed) to a reference, largest over time, relative to
    the largest standard deviation. Against the order the scale is logarithmic, so that exponential convergence is a
    straight line. Of a Monte Carlo the largest standard errors are drawn, as stars.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of nodes
        With several chaoses that differ in their order.
    output : str
        Name of the output.
    reference : str, optional
        Label; default: the chaos of the highest order.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    StudyError
        If no output or reference of these names exists, or there are fewer than two chaoses.

    Examples
    --------
    >>> order_convergence([], "x")
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: A figure needs the result of at least one propagator; there is none.
    """
    from matplotlib.lines import Line2D

    nodes = nodes_of(results)
    chosen, found = orders_of(nodes, output, reference)
    figure, grid = axes_grid(2, 2.2)
    handles: dict[str, Any] = {}
    seen: list[float] = []
    numbers: list[float] = []
    for k, row in enumerate(found):
        colour, _ = style(k)
        numbers += row.realisations[row.realisations > 0].tolist()
        for name, line, fill in (("mean", "-", colour), ("std", (0, (4, 2)), "white")):
            values = getattr(row, name)
            used = values > 1e-16
            seen += values[used].tolist()
            looks: dict[str, Any] = {"color": colour, "ls": line, "lw": 1.5, "marker": _MARKERS[k % 6], "ms": 5}
            for axes, x in zip(grid, (row.orders, row.realisations), strict=True):
                axes.plot(x[used], values[used], mfc=fill, clip_on=False, **looks)
            what = "mean" if name == "mean" else "standard deviation"
            handles[f"{row.name}: {what}"] = Line2D([], [], mfc=fill, **looks)
    for label, size, error in sampling_errors(nodes, chosen, output):
        (handles[f"{label}: standard error"],) = grid[1].plot([size], [error], "*", color="black", ms=8, ls="")
        numbers.append(float(size))
        seen.append(error)
    _scales(grid, found, numbers, seen)
    grid[0].set_title(shortened(f"reference: {chosen}").replace("$", r"\$"), fontsize=9, y=1.0, loc="left")
    grid[0].set_ylabel("difference / largest std")
    grid[0].set_xlabel("order")
    grid[1].set_xlabel("realisations")
    arrange(figure, grid, 2, legend=handles, heights=(1.85,))
    return figure


def sampling_errors(nodes: Mapping[str, xr.DataTree], chosen: str, output: str) -> list[tuple[str, int, float]]:
    """Return label, realisations, and the largest standard error of the std over the largest std, of each sampling."""
    scale = float(_statistics(nodes, chosen, output)["std"].max()) or 1.0
    found = []
    for label, node in nodes.items():
        if label in chaos_nodes(nodes) or not _has(node, output):
            continue
        data = _statistics(nodes, label, output)
        error = float(np.nanmax(data["std_error_std"].values, initial=0.0)) / scale if "std_error_std" in data else 0.0
        size = int(node.attrs.get("realisations", 0))
        if error > 0 and size > 0:
            found.append((label, size, error))
    return found


def _scales(grid: list[Any], found: list[Convergence], numbers: list[float], seen: list[float]) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter

    top = max(int(row.orders.max()) for row in found)
    least = min(int(row.orders.min()) for row in found)
    grid[0].set_xlim(least - 0.3, max(top, least + 1) + 0.3)
    grid[0].xaxis.set_major_locator(FixedLocator(list(range(least, top + 1, -(-(top - least + 1) // 8)))))
    first, last = 0.8 * min(numbers, default=1.0), 1.25 * max(numbers, default=10.0)
    log_axis(grid[1], "x", first, last)
    steps = [m * 10**k for k in range(12) for m in ((1, 2, 5) if last < 200 * first else (1,))]
    grid[1].xaxis.set_major_locator(FixedLocator([step for step in steps if first <= step <= last]))
    grid[1].xaxis.set_major_formatter(FuncFormatter(lambda value, _: format_integer(value)))
    grid[1].set_xlim(first, last)
    for axes in grid:
        log_axis(axes, "y", min(seen, default=1e-3), max(seen, default=1.0))
        axes.grid(color="0.9", lw=0.7)
