"""Figures with time on the x axis: bands, standard deviation, and the time-history histogram."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.report.drawing import (
    FAILED,
    WIDTH,
    arrange,
    axes_grid,
    constant,
    finish_single,
    limit_times,
    line_width,
    single_axes,
    style,
    surroundings,
    widen_if_constant,
    with_units,
    wrapped,
)
from uqmbd.report.figures.curves import Band, Curve, draw_curve
from uqmbd.report.figures.selection import Results, Samples, nodes_of, of_output, samples_of, succeeded, thinned
from uqmbd.status import Status

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["band_edges", "bands", "occurrences", "std_over_time", "time_history_histogram"]

_MOST_TIMES, _MOST_VALUES = 200, 100


def bands(
    results: Results,
    output: str,
    *,
    samples: int = 0,
    limits: Mapping[str, float] | None = None,
    ax: Axes | None = None,
) -> Figure:
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
    limits : mapping of str to float, optional
        Values that the output has to stay within, in its units, by what they are called: drawn as dotted lines.
    ax : matplotlib.axes.Axes, optional
        Axes of a figure of one's own, to draw on; they get the legend. Default: a new figure.

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
    nodes = nodes_of(results)
    figure, axes = single_axes(3.3, ax)
    handles: dict[str, Any] = {}
    low, high = np.inf, -np.inf
    for k, (label, node) in enumerate(nodes.items()):
        statistics = of_output(node.children["statistics"], output)
        edges, _, _ = band_edges(statistics)
        chosen = thinned(edges[0], edges[1])
        statistics = statistics.isel(time=chosen)
        times, mean = statistics["time"].values, statistics["mean"].values
        wide, narrow, wide_name = band_edges(statistics)
        if k == 0 and samples:
            single = _curves(node, output, samples)[:, chosen]
            thin = axes.plot(times, single.T, color="0.45", lw=0.5, alpha=0.45, zorder=1.5)
            if thin:
                handles["single realisations"] = thin[0]
        curve = Curve(
            label,
            mean,
            tuple(Band(name, edge[0], edge[1]) for name, edge in ((wide_name, wide), ("50 %", narrow)) if edge),
        )
        drawn, areas = draw_curve(axes, times, curve, k, len(nodes))
        if k == 0:
            name = "" if len(nodes) == 1 else f"{label}: "
            handles[f"{name}mean"] = drawn
            if len(areas) > 1:
                handles["50 %" if name else "50 % of realisations"] = areas[1]
            handles[wide_name.split(" of")[0] if name else wide_name] = areas[0]
        else:
            handles[f"{label}: mean, {wide_name.split(' of')[0]}"] = drawn
        low, high = min(low, float(wide[0].min()), mean.min()), max(high, float(wide[1].max()), mean.max())
        axes.set_ylabel(wrapped(with_units(output, str(statistics["output_units"].item())), 34))
        if len(times) == 1:
            _show_single_time(axes, times[0], mean, wide, style(k)[0])
    for name, value in (limits or {}).items():
        handles[f"limit: {name}"] = axes.axhline(value, color=FAILED, ls=":", lw=1.6)
        low, high = min(low, value), max(high, value)
    axes.set_xlabel("time [s]")
    limit_times(axes, times)
    widen_if_constant(axes, "y", low, high)
    finish_single(figure, axes, ax, handles)
    return figure


def std_over_time(results: Results, output: str, *, ax: Axes | None = None) -> Figure:
    """Draw the standard deviation over time, with a band of two standard errors where a method states them.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of these
        A study's result, the node of one propagator, or several such nodes.
    output : str
        Name of the output.
    ax : matplotlib.axes.Axes, optional
        Axes of a figure of one's own, to draw on; they get the legend. Default: a new figure.

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
    nodes = nodes_of(results)
    figure, axes = single_axes(2.8, ax)
    handles: dict[str, Any] = {}
    uncertain: dict[str, Any] = {}
    high = 0.0
    for k, (label, node) in enumerate(nodes.items()):
        statistics = of_output(node.children["statistics"], output)
        statistics = statistics.isel(time=thinned(statistics["std"].values, statistics["std"].values))
        times, std = statistics["time"].values, statistics["std"].values
        colour, line = style(k)
        if "std_error_std" in statistics:
            error = 2 * np.nan_to_num(statistics["std_error_std"].values)
            band = axes.fill_between(times, np.maximum(std - error, 0), std + error, color=colour, alpha=0.2, lw=0)
            uncertain = uncertain or {"± 2 standard errors": band}
            high = max(high, float((std + error).max()))
        name = label if len(nodes) > 1 else "standard deviation"
        marker, width = "o" if len(times) == 1 else "", line_width(k, len(nodes))
        (handles[name],) = axes.plot(times, std, color=colour, ls=line, lw=width, marker=marker)
        high = max(high, float(std.max()))
        axes.set_ylabel(wrapped(with_units("standard deviation", str(statistics["output_units"].item())), 30))
    # Without any spread the line lies on the axis: lift it, so that it is seen.
    axes.set_ylim(*((0, high * 1.06) if high > 0 else (-0.5, 0.5)))
    axes.set_xlabel("time [s]")
    limit_times(axes, times)
    finish_single(figure, axes, ax, handles | uncertain)
    return figure


def time_history_histogram(node: Samples, output: str, *, mean: bool = False) -> Figure:
    """Draw how often an output has which value when: time, value, and the number of occurrences as a colour.

    Parameters
    ----------
    node : xarray.DataTree or xarray.Dataset
        The node of a propagator that has ``samples``, or its samples.
    output : str
        Name of the output.
    mean : bool
        Draw the mean of the samples on top.

    Returns
    -------
    matplotlib.figure.Figure
        Its first axes hold the image of the counts, (value, time), and the second ones its colour bar.

    Raises
    ------
    StudyError
        If the node has no samples, none succeeded, or no such output exists.

    Examples
    --------
    >>> from uqmbd.results import labels, sample_dataset
    >>> samples = sample_dataset([[[0.0, 0.0]], [[0.0, 1.0]]], [[1.0], [2.0]], labels(["x"], ["k"], [0.0, 0.5]))
    >>> counts = time_history_histogram(samples, "x").axes[0].images[0].get_array()
    >>> counts.sum(axis=0).tolist()
    [2.0, 2.0]
    """
    from matplotlib.colors import LogNorm

    response = succeeded(node, output)
    times = response["time"].values
    counts, columns, span = occurrences(response.values, times)
    figure, (axes, bar) = axes_grid(2, 3.3, 1)
    figure.set_figheight(3.3)
    most = int(counts.max())
    # A logarithmic scale: at one time all samples may share a bin, at another each has its own.
    image = axes.imshow(
        np.ma.masked_equal(counts, 0),
        norm=LogNorm(1, max(most, 2)),
        cmap="viridis_r",
        extent=(columns[0], columns[-1], *span),
        origin="lower",
        aspect="auto",
        interpolation="none",
    )
    if mean:
        average = response.values.mean(axis=0)
        chosen = thinned(average, average)
        marker = "o" if len(times) == 1 else ""
        (line,) = axes.plot(times[chosen], average[chosen], color="#D55E00", lw=1.1, marker=marker)
    axes.set_xlabel("time [s]")
    axes.set_ylabel(wrapped(with_units(output, str(response["output_units"].item())), 34))
    axes.set_xlim(columns[0], columns[-1])
    margin = 0.03 * (span[1] - span[0])
    axes.set_ylim(span[0] - margin, span[1] + margin)
    arrange(figure, [axes], right=0.95, legend={"mean": line} if mean else None)
    _stand_beside(bar, axes)
    _colour_bar(bar, image, most)
    return figure


def _stand_beside(bar: Axes, axes: Axes) -> None:
    """Let a bar stand at the right of axes, wherever these are put."""
    from matplotlib.transforms import Bbox

    def place(*_: Any) -> Bbox:
        beside = axes.get_position()
        return Bbox.from_bounds(beside.x1 + 0.02, beside.y0, 0.025, beside.height)

    bar.set_position(place())
    bar.set_axes_locator(place)


def _colour_bar(bar: Axes, image: Any, most: int) -> None:
    """Draw a colour bar for counts on a logarithmic scale; Matplotlib's own takes as long as the rest of the figure."""
    from matplotlib.ticker import FixedFormatter, FixedLocator

    bar.imshow(np.linspace(0, 1, 128)[:, None], cmap=image.cmap, extent=(0, 1, 0, 1), origin="lower", aspect="auto")
    steps = [m * 10**k for k in range(9) for m in (1, 2, 5) if m * 10**k <= most]
    bar.yaxis.set_major_locator(FixedLocator([float(image.norm(step)) for step in steps]))
    bar.yaxis.set_major_formatter(FixedFormatter([str(step) for step in steps]))
    bar.yaxis.tick_right()
    bar.yaxis.set_label_position("right")
    bar.set_ylabel("number of samples", fontsize=9)
    # Beside the longest number, as `arrange` would put it.
    bar.yaxis.set_label_coords(1 + (0.14 + 0.07 * len(str(most))) / (0.025 * WIDTH), 0.5)
    bar.tick_params(labelsize=8)
    bar.set_xticks([])
    bar.spines[["top", "right"]].set_visible(True)


def occurrences(
    response: NDArray[np.float64], times: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[float, float]]:
    """Count how many samples lie in which of a bounded number of bins at which time.

    Parameters
    ----------
    response : array, shape (S, T)
        Of samples that succeeded.
    times : array, shape (T,)
        Increasing.

    Returns
    -------
    counts : array, shape (V, C)
        At most 100 equal bins of the value, rows upwards, and at most 200 columns of time; each column counts every
        sample once, at the time nearest to the column's middle.
    columns : array, shape (C + 1,)
        Equally spaced edges of the columns.
    span : tuple of float
        Ends of the bins of the value.

    Examples
    --------
    >>> import numpy as np
    >>> counts, columns, span = occurrences(np.array([[0.0, 1.0], [0.0, 3.0]]), np.array([0.0, 0.1]))
    >>> counts.shape[1], counts.sum(axis=0).tolist(), span
    (2, [2.0, 2.0], (0.0, 3.0))
    """
    samples, count = response.shape
    columns = min(count, _MOST_TIMES)
    if columns == 1:
        chosen, edges = np.zeros(1, dtype=int), times[0] + np.array([-0.5, 0.5])
    else:
        # As many equal columns as times: with equal steps of time the first and the last lie on the edges.
        edges = np.linspace(times[0], times[-1], columns + 1)
        middles = (edges[:-1] + edges[1:]) / 2
        after = np.clip(np.searchsorted(times, middles), 1, count - 1)
        chosen = np.where(middles - times[after - 1] <= times[after] - middles, after - 1, after)
        chosen[[0, -1]] = 0, count - 1
    values = response[:, chosen]
    low, high = float(values.min()), float(values.max())
    if constant(low, high):
        low, high = surroundings(low, high, 0.5)
    # Half the width of Freedman and Diaconis, from the spread at a typical time: not finer than the samples allow.
    typical = float(np.median(np.subtract(*np.percentile(values, [75, 25], axis=0)))) * samples ** (-1 / 3)
    rows = int(np.clip((high - low) / typical, 40, _MOST_VALUES)) if typical > 0 else _MOST_VALUES
    bins = np.clip(((values - low) / (high - low) * rows).astype(int), 0, rows - 1) * columns + np.arange(columns)
    counts = np.bincount(bins.ravel(), minlength=rows * columns).reshape(rows, columns).astype(float)
    return counts, edges, (low, high)


def band_edges(
    statistics: xr.Dataset,
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]] | None, str]:
    """Return the ends of the band of 95 % and, where it is known, that of 50 %, and what the first one is."""
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
    samples = samples_of(node)
    ok = np.flatnonzero(samples["status"].values == Status.OK)[:count]
    return np.asarray(of_output(samples, output)["response"].values[ok], dtype=float)


def _show_single_time(
    axes: Axes, time: float, mean: NDArray[np.float64], wide: list[NDArray[np.float64]], colour: str
) -> None:
    axes.plot([time], mean, "o", color=colour)
    axes.vlines([time], wide[0], wide[1], color=colour, lw=1.2)
