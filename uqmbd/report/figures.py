"""Figures of results, each a function from xarray data to a :class:`matplotlib.figure.Figure` of its own.

Nothing here touches pyplot or its global state, so figures can be made anywhere, in any number, in any thread.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias, cast

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.errors import StudyError
from uqmbd.report.drawing import (
    COLOURS,
    axes_grid,
    draw_histogram,
    legend_above,
    limit_times,
    single_axes,
    style,
    widen_if_constant,
    wrapped,
)
from uqmbd.results import propagator_nodes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Results", "bands", "histograms", "inputs", "std_over_time"]

Results: TypeAlias = xr.DataTree | Mapping[str, xr.DataTree] | Iterable[xr.DataTree]
"""A study's result, the node of one propagator, or several such nodes."""

_FAILED = "#B00020"


def bands(results: Results, output: str, *, samples: int = 0) -> Figure:
    """Draw the mean over time with the bands that hold 50 % and 95 % of the realisations.

    With several methods the first has filled bands; of the others the mean and the edges of the 95 % band are drawn.
    A method that cannot tell quantiles shows its mean plus and minus 1.96 standard deviations instead.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of these
        A study's result, the node of one propagator, or several such nodes.
    output : str
        Name of the output.
    samples : int
        How many single realisations of the first method to draw as thin lines, if it has any.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    StudyError
        If no such output exists.

    Examples
    --------
    >>> from uqmbd.results import labels, propagator_node, statistics_dataset
    >>> axes = labels([("x", "m")], [], [0.0, 1.0])
    >>> node = propagator_node("mine", statistics_dataset(axes, mean=[[0.0, 1.0]], std=[[0.1, 0.1]]),
    ...                        propagator="p", realisations=1, wall_time=0.0)
    >>> bands(node, "x").axes[0].get_ylabel()
    'x [m]'
    """
    nodes = _nodes(results)
    figure, axes = single_axes(3.3)
    handles: dict[str, Any] = {}
    low, high = np.inf, -np.inf
    for k, (label, node) in enumerate(nodes.items()):
        statistics = _of_output(node.children["statistics"], output)
        times, mean = statistics["time"].values, statistics["mean"].values
        wide, narrow, wide_name = _band_edges(statistics)
        colour, line = style(k)
        if k == 0:
            if samples:
                curves = _curves(node, output, samples)
                thin = axes.plot(times, curves.T, color="0.45", lw=0.5, alpha=0.45, zorder=1.5)
                if thin:
                    handles["single realisations"] = thin[0]
            name = "" if len(nodes) == 1 else f"{label}: "
            outer = axes.fill_between(times, wide[0], wide[1], color=colour, alpha=0.16, lw=0)
            inner = (
                None
                if narrow is None
                else axes.fill_between(times, narrow[0], narrow[1], color=colour, alpha=0.30, lw=0)
            )
            (drawn,) = axes.plot(times, mean, color=colour, ls=line, lw=1.6)
            handles[f"{name}mean"] = drawn
            if inner is not None:
                handles["50 %" if name else "50 % of realisations"] = inner
            handles[wide_name.split(" of")[0] if name else wide_name] = outer
        else:
            for edge in wide:
                axes.plot(times, edge, color=colour, ls=line, lw=0.9)
            (drawn,) = axes.plot(times, mean, color=colour, ls=line, lw=1.6)
            handles[f"{label}: mean, {wide_name.split(' of')[0]}"] = drawn
        low, high = min(low, float(wide[0].min()), mean.min()), max(high, float(wide[1].max()), mean.max())
        axes.set_ylabel(_label(statistics, output, 34))
        if len(times) == 1:
            _show_single_time(axes, times[0], mean, wide, colour)
    axes.set_xlabel("time [s]")
    limit_times(axes, times)
    widen_if_constant(axes, "y", low, high)
    legend_above(figure, handles)
    return figure


def std_over_time(results: Results, output: str) -> Figure:
    """Draw the standard deviation over time, with a band of two standard errors where a method states them.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of these
        A study's result, the node of one propagator, or several such nodes.
    output : str
        Name of the output.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    StudyError
        If no such output exists.

    Examples
    --------
    >>> from uqmbd.results import labels, propagator_node, statistics_dataset
    >>> axes = labels([("x", "m")], [], [0.0, 1.0])
    >>> node = propagator_node("mine", statistics_dataset(axes, mean=[[0.0, 1.0]], std=[[0.1, 0.1]]),
    ...                        propagator="p", realisations=1, wall_time=0.0)
    >>> len(std_over_time(node, "x").axes)
    1
    """
    nodes = _nodes(results)
    figure, axes = single_axes(2.8)
    handles: dict[str, Any] = {}
    high = 0.0
    for k, (label, node) in enumerate(nodes.items()):
        statistics = _of_output(node.children["statistics"], output)
        times, std = statistics["time"].values, statistics["std"].values
        colour, line = style(k)
        if "std_error_std" in statistics:
            error = 2 * statistics["std_error_std"].values
            band = axes.fill_between(times, np.maximum(std - error, 0), std + error, color=colour, alpha=0.2, lw=0)
            handles.setdefault("± 2 standard errors", band)
            high = max(high, float((std + error).max()))
        (handles[label],) = axes.plot(times, std, color=colour, ls=line, lw=1.6, marker="o" if len(times) == 1 else "")
        high = max(high, float(std.max()))
        units = str(statistics["output_units"].item())
        axes.set_ylabel(wrapped("standard deviation" + (f" [{units}]" if units else ""), 30))
    # Without any spread the line lies on the axis: lift it, so that it is seen.
    axes.set_ylim(*((0, high * 1.06) if high > 0 else (-0.5, 0.5)))
    axes.set_xlabel("time [s]")
    limit_times(axes, times)
    legend_above(figure, handles)
    return figure


def histograms(node: xr.DataTree, output: str, times: Sequence[float] | None = None) -> Figure:
    """Draw histograms of an output's samples at some times.

    Parameters
    ----------
    node : xarray.DataTree
        The node of a propagator that has ``samples``.
    output : str
        Name of the output.
    times : sequence of float, optional
        In seconds; the nearest stored times are taken. Default: up to four, the end, the time of the largest standard
        deviation, and times between.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    StudyError
        If the node has no samples, none succeeded, or no such output exists.

    Examples
    --------
    >>> from uqmbd.results import labels, propagator_node, sample_dataset, statistics_of_samples
    >>> samples = sample_dataset([[[0.0]], [[1.0]]], [[1.0], [2.0]], labels(["x"], ["k"], [0.5]))
    >>> node = propagator_node("mine", statistics_of_samples(samples), samples,
    ...                        propagator="p", realisations=2, wall_time=0.0)
    >>> histograms(node, "x").axes[0].get_title()
    't = 0.5 s'
    """
    samples = _samples(node)
    response = _of_output(samples, output)["response"].isel(sample=np.flatnonzero(samples["status"].values == 0))
    if response.sizes["sample"] == 0:
        raise StudyError(f"All samples of {node.name!r} failed: there is nothing to draw.")
    if times is None:
        chosen = automatic_times(response["time"].values, response.values.std(axis=0))
    else:
        chosen = sorted({int(np.abs(response["time"].values - t).argmin()) for t in times})
    figure, grid = axes_grid(len(chosen), 1.75)
    for place, (axes, k) in enumerate(zip(grid, chosen, strict=True)):
        values = response.isel(time=k).values
        axes.set_title(f"t = {float(response['time'][k]):.4g} s", fontsize=9.5)
        draw_histogram(axes, values, COLOURS[0])
        axes.axvline(values.mean(), color="black", lw=1.0, ls=(0, (4, 2)))
        axes.set_ylabel("samples" if place % 2 == 0 else "")
        if place >= len(chosen) - 2:
            axes.set_xlabel(_label(response, output, 20))
    return figure


def inputs(node: xr.DataTree) -> Figure:
    """Draw histograms of the sampled inputs: what was uncertain, and (red ticks) where samples failed.

    Parameters
    ----------
    node : xarray.DataTree
        The node of a propagator that has ``samples``.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    StudyError
        If the node has no samples or no inputs.

    Examples
    --------
    >>> from uqmbd.results import labels, propagator_node, sample_dataset, statistics_of_samples
    >>> samples = sample_dataset([[[0.0]], [[1.0]]], [[1.0], [2.0]], labels(["x"], [("k", "N/m")], [0.5]))
    >>> node = propagator_node("mine", statistics_of_samples(samples), samples,
    ...                        propagator="p", realisations=2, wall_time=0.0)
    >>> inputs(node).axes[0].get_xlabel()
    'k [N/m]'
    """
    samples = _samples(node)
    names = [str(name) for name in samples["input"].values]
    if not names:
        raise StudyError(f"The study of {node.name!r} has no random inputs.")
    failed = samples["status"].values != 0
    figure, grid = axes_grid(len(names), 1.85)
    for place, (axes, name) in enumerate(zip(grid, names, strict=True)):
        chosen = samples.sel(input=name)
        values = chosen["inputs"].values
        draw_histogram(axes, values, COLOURS[2])
        if failed.any():
            # Ticks at the foot of the axes, whatever the counts are.
            foot = axes.get_xaxis_transform()
            axes.vlines(values[failed], 0, 0.12, transform=foot, color=_FAILED, lw=1.3, label="failed")
        units = str(chosen["input_units"].item())
        axes.set_xlabel(wrapped(name + (f" [{units}]" if units else ""), 20))
        axes.set_ylabel("samples" if place % 2 == 0 else "")
    if failed.any():
        legend_above(figure, {"inputs of failed samples": grid[0].collections[-1]})
    return figure


def automatic_times(times: NDArray[np.float64], std: NDArray[np.float64]) -> list[int]:
    """Choose up to four indices: a third, two thirds, the largest standard deviation, and the end."""
    last = len(times) - 1
    wanted = {last, int(np.argmax(std))}
    for share in (1 / 3, 2 / 3, 1 / 2):
        candidate = int(np.abs(times - (times[0] + share * (times[-1] - times[0]))).argmin())
        # Two panels a few steps apart would show the same thing twice.
        if len(wanted) < 4 and all(abs(candidate - k) > last / 12 for k in wanted):
            wanted.add(candidate)
    return sorted(wanted)


def _nodes(results: Results) -> dict[str, xr.DataTree]:
    if isinstance(results, xr.DataTree):
        nodes = propagator_nodes(results)
    elif isinstance(results, Mapping):
        nodes = dict(cast(Mapping[str, xr.DataTree], results))
    else:
        nodes = {str(node.attrs.get("label", node.name)): node for node in results}
    if not nodes:
        raise StudyError("A figure needs the result of at least one propagator; there is none.")
    return nodes


def _samples(node: xr.DataTree) -> xr.Dataset:
    if "samples" not in node.children:
        raise StudyError(f"The propagator {node.name!r} kept no samples; this figure is drawn from samples.")
    return node.children["samples"].to_dataset()


def _of_output(source: xr.DataTree | xr.Dataset, output: str) -> xr.Dataset:
    data = source.to_dataset() if isinstance(source, xr.DataTree) else source
    known = [str(name) for name in data["output"].values]
    if output not in known:
        raise StudyError(f"There is no output {output!r}; there are {', '.join(map(repr, known))}.")
    return data.isel(output=known.index(output))


def _band_edges(
    statistics: xr.Dataset,
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]] | None, str]:
    quantile = statistics["quantile"]
    levels = quantile["probability"].values

    def pair(*wanted: float) -> list[NDArray[np.float64]] | None:
        places = [int(np.abs(levels - p).argmin()) for p in wanted] if levels.size else []
        if not places or np.any(np.abs(levels[places] - wanted) > 1e-6):
            return None
        edges = [quantile.isel(probability=k).values for k in places]
        return edges if all(np.all(np.isfinite(edge)) for edge in edges) else None

    wide = pair(0.025, 0.975)
    if wide is None:
        mean, reach = statistics["mean"].values, 1.96 * statistics["std"].values
        return [mean - reach, mean + reach], pair(0.25, 0.75), "mean ± 1.96 standard deviations"
    return wide, pair(0.25, 0.75), "95 % of realisations"


def _curves(node: xr.DataTree, output: str, count: int) -> NDArray[np.float64]:
    if "samples" not in node.children:
        return np.zeros((0, node.children["statistics"].sizes["time"]))
    samples = _samples(node)
    ok = np.flatnonzero(samples["status"].values == 0)[:count]
    return np.asarray(_of_output(samples, output)["response"].values[ok], dtype=float)


def _show_single_time(
    axes: Axes, time: float, mean: NDArray[np.float64], wide: list[NDArray[np.float64]], colour: str
) -> None:
    axes.plot([time], mean, "o", color=colour)
    axes.vlines([time], wide[0], wide[1], color=colour, lw=1.2)


def _label(data: xr.Dataset | xr.DataArray, name: str, width: int) -> str:
    units = str(data["output_units"].item())
    return wrapped(name + (f" [{units}]" if units else ""), width)
