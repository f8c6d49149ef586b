"""Charts over time: means with bands, standard deviations, differences, and time-history histograms."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.arguments import Bounds, typechecked
from uqmbd.errors import StudyError
from uqmbd.report.charts import Axis, Band, Boxes, Chart, Column, Curve, Look, Strands, Views, draw_on_paper
from uqmbd.report.drawing import constant, surroundings
from uqmbd.report.figures.selection import Results, Samples, nodes_of, of_output, samples_of, succeeded
from uqmbd.results import choose_reference
from uqmbd.status import Status
from uqmbd.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "at_times",
    "band_edges",
    "bands",
    "bands_chart",
    "difference_chart",
    "differences",
    "occurrences",
    "std_chart",
    "std_over_time",
    "time_history_histogram",
]

ERRORS = "± 2 standard errors"

_MOST_TIMES, _MOST_VALUES = 200, 100


def bands_chart(
    nodes: Mapping[str, xr.DataTree], output: str, *, limits: Mapping[str, float] | None = None, samples: int = 0
) -> Chart:
    """Chart the mean, bands and standard deviation of an output over time for each method.

    ``limits`` are the limits of the output by name. ``samples`` is the number of realisations of the first method that
    are drawn as thin lines (on paper).
    """
    times, statistics = _of_methods(nodes, output)
    curves = []
    for k, (label, data) in enumerate(statistics.items()):
        wide, narrow, wide_name = band_edges(data)
        some = ((wide_name, wide), ("50 % of realisations", narrow))
        mean, std = (at_times(data, times, data[key].values) for key in ("mean", "std"))
        curves.append(
            Curve(
                label,
                mean,
                tuple(
                    Band(name, at_times(data, times, edges[0]), at_times(data, times, edges[1]))
                    for name, edges in some
                    if edges is not None
                ),
                "mean",
                columns=(Column("standard deviation", std),),
                strands=_single(nodes[label], output, samples) if k == 0 and samples else None,
            )
        )
    spread = at_times(next(iter(statistics.values())), times, next(iter(statistics.values()))["std"].values)
    start = int(np.nan_to_num(spread, nan=-1.0).argmax())
    units = _units(statistics)
    return Chart(output, times, curves, units=units, limits=limits or {}, start=start, follows=True)


@typechecked
def bands(
    results: Results,
    output: str,
    *,
    samples: Annotated[int, Bounds(0, 10**6)] = 0,
    limits: Mapping[str, float] | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Draw the mean over time with the bands that contain 50 % and 95 % of the realisations.

    With several methods, the first has filled bands; the others have the mean and the edges of the 95 % band. For a
    method without quantiles, the band is the mean plus and minus 1.96 standard deviations.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of these
        Result of a study, node of one propagator, or several such nodes.
    output : str
        Name of the output.
    samples : int
        Number of stored realisations of the first method to draw as thin lines.
    limits : mapping of str to float, optional
        Limits of the output, in its units, by name, for dotted lines.
    ax : matplotlib.axes.Axes, optional
        Axes of an existing figure for the drawing and the legend. Default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    StudyError
        If no such output exists.

    Examples
    --------
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels([("x", "m")], [], [0.0, 1.0])
    >>> node = propagator_node("mine", statistics_dataset(axes, mean=[[0.0, 1.0]], std=[[0.1, 0.1]]),
    ...                        propagator="p", realisations=1, wall_time=0.0)
    >>> bands(node, "x").axes[0].get_ylabel()
    'x [m]'
    """
    return draw_on_paper(bands_chart(nodes_of(results), output, limits=limits, samples=samples), ax=ax)


def std_chart(nodes: Mapping[str, xr.DataTree], output: str) -> Chart:
    """Chart the standard deviation of an output over time for each method, with its standard errors."""
    times, statistics = _of_methods(nodes, output)
    curves = []
    for label, data in statistics.items():
        std = at_times(data, times, data["std"].values)
        bands: tuple[Band, ...] = ()
        if "std_error_std" in data:
            error = 2 * np.nan_to_num(at_times(data, times, data["std_error_std"].values))
            bands = (Band(ERRORS, np.maximum(std - error, 0.0), std + error),)
        curves.append(Curve(label, std, bands, "standard deviation"))
    start = int(np.nan_to_num(np.asarray(curves[0].values), nan=-1.0).argmax())
    return Chart(f"standard deviation of {output}", times, curves, units=_units(statistics), start=start)


@typechecked
def std_over_time(results: Results, output: str, *, ax: Axes | None = None) -> Figure:
    """Draw the standard deviation over time, with a band of two standard errors if a method states them.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of these
        Result of a study, node of one propagator, or several such nodes.
    output : str
        Name of the output.
    ax : matplotlib.axes.Axes, optional
        Axes of an existing figure for the drawing and the legend. Default: a new figure.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    StudyError
        If no such output exists.

    Examples
    --------
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels([("x", "m")], [], [0.0, 1.0])
    >>> node = propagator_node("mine", statistics_dataset(axes, mean=[[0.0, 1.0]], std=[[0.1, 0.1]]),
    ...                        propagator="p", realisations=1, wall_time=0.0)
    >>> len(std_over_time(node, "x").axes)
    1
    """
    return draw_on_paper(std_chart(nodes_of(results), output), ax=ax, height=2.8)


def difference_chart(nodes: Mapping[str, xr.DataTree], output: str, reference: str, statistic: str) -> Chart:
    """Chart the difference in mean or standard deviation between methods and a reference.

    The first curve is the reference: zero, with the standard errors of the reference.
    """
    times, statistics = _of_methods(nodes, output)
    values = {label: at_times(data, times, data[statistic].values) for label, data in statistics.items()}
    base = statistics[reference]
    bands: tuple[Band, ...] = ()
    if f"std_error_{statistic}" in base:
        error = 2 * np.nan_to_num(at_times(base, times, base[f"std_error_{statistic}"].values))
        bands = (Band(ERRORS, -error, error),)
    zero = np.where(np.isfinite(values[reference]), 0.0, np.nan)
    curves = [Curve(f"{reference}, the reference", zero, bands, "difference")]
    others = {label: one - values[reference] for label, one in values.items() if label != reference}
    curves += [Curve(label, off, (), "difference") for label, off in others.items()]
    largest = max((np.nan_to_num(np.abs(off)) for off in others.values()), key=lambda off: off.max())
    words = {"mean": "mean", "std": "standard deviation"}[statistic]
    name, axis = f"{output}: difference of the {words}", f"difference of the {words}"
    return Chart(name, times, curves, units=_units(statistics), axis=axis, start=int(largest.argmax()))


@typechecked
def differences(results: Results, output: str, *, reference: str | None = None) -> Figure:
    """Draw the differences in mean and standard deviation between methods and a reference.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of nodes
        At least two methods with the same times.
    output : str
        Name of the output.
    reference : str, optional
        Label of the method that is subtracted. Default: :func:`uqmbd.results.choose_reference`. If the reference states
        standard errors, a band about zero shows two of them.

    Returns
    -------
    matplotlib.figure.Figure
        Figure with axes for the differences of the mean, and of the standard deviation.

    Raises
    ------
    StudyError
        If there is only one method, if the reference is unknown, or if outputs or times differ.

    Examples
    --------
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
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
    if chosen not in nodes:
        known = ", ".join(map(repr, nodes))
        raise StudyError(f"differences: reference is {chosen!r}; expected one of the methods {known}.")
    if len(nodes) < 2:
        raise StudyError(f"differences: only {chosen!r} has results; expected the results of two or more methods.")
    charts = [difference_chart(nodes, output, chosen, statistic) for statistic in ("mean", "std")]
    return draw_on_paper(Views(charts, columns=1, shared=True, heights=(1.15, 1.15)))


@typechecked
def time_history_histogram(node: Samples, output: str, *, mean: bool = False) -> Figure:
    """Draw a two-dimensional histogram of an output over time and value, with the count as colour.

    Parameters
    ----------
    node : xarray.DataTree or xarray.Dataset
        Node of a propagator that has ``samples``, or its samples.
    output : str
        Name of the output.
    mean : bool
        Whether to draw the mean of the samples on top.

    Returns
    -------
    matplotlib.figure.Figure
        Figure whose first axes contain the image of the counts, (value, time), and whose second axes are the colour
        bar.

    Raises
    ------
    StudyError
        If the node has no samples, none succeeded, or no such output exists.

    Examples
    --------
    >>> from uqmbd.extend import labels, sample_dataset
    >>> samples = sample_dataset([[[0.0, 0.0]], [[0.0, 1.0]]], [[1.0], [2.0]], labels(["x"], ["k"], [0.0, 0.5]))
    >>> counts = time_history_histogram(samples, "x").axes[0].images[0].get_array()
    >>> counts.sum(axis=0).tolist()
    [2.0, 2.0]
    """
    response = succeeded(node, output)
    times, units = response["time"].values, str(response["output_units"].item())
    counts, columns, (low, high) = occurrences(response.values, times)
    # a logarithmic scale, because the samples may share one bin at one time and have separate bins at another
    across, up = np.array([columns[0], columns[-1]]), np.array([low, high])
    boxes = Boxes(
        "number of samples", "", across, up, counts, (1.0, max(float(counts.max()), 2.0)), log=True, grid=True
    )
    average = response.values.mean(axis=0) if mean else np.full(len(times), np.nan)
    curve = Curve("mean", average, (), "mean" if mean else "", look=Look(1, (), 1.1))
    ends = (low - 0.03 * (high - low), high + 0.03 * (high - low))
    along = Axis("time", "s", (float(columns[0]), float(columns[-1])))
    return draw_on_paper(Chart(output, times, [curve], units=units, ends=ends, along=along, boxes=boxes))


def occurrences(
    response: NDArray[np.float64], times: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[float, float]]:
    """Count the samples in each of a limited number of bins at each time.

    `response` (S, T) contains successful samples; `times` (T,) increase. Return the counts (V, C) in at most 100 equal
    bins of the value, with rows upwards, and at most 200 columns of time. Each column counts every sample once, at the
    time nearest to the middle of the column. Also return the equally spaced edges (C + 1,) of the columns, and the ends
    of the bins of the value.

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
        # as many equal columns as times: for equal time steps, the first and the last time are on the edges
        edges = np.linspace(times[0], times[-1], columns + 1)
        middles = (edges[:-1] + edges[1:]) / 2
        after = np.clip(np.searchsorted(times, middles), 1, count - 1)
        chosen = np.where(middles - times[after - 1] <= times[after] - middles, after - 1, after)
        chosen[[0, -1]] = 0, count - 1
    values = response[:, chosen]
    low, high = float(values.min()), float(values.max())
    if constant(low, high):
        low, high = surroundings(low, high, 0.5)
    # half the bin width of Freedman and Diaconis, for the spread at a typical time
    typical = float(np.median(np.subtract(*np.percentile(values, [75, 25], axis=0)))) * samples ** (-1 / 3)
    rows = int(np.clip((high - low) / typical, 40, _MOST_VALUES)) if typical > 0 else _MOST_VALUES
    bins = np.clip(((values - low) / (high - low) * rows).astype(int), 0, rows - 1) * columns + np.arange(columns)
    counts = np.bincount(bins.ravel(), minlength=rows * columns).reshape(rows, columns).astype(float)
    return counts, edges, (low, high)


def band_edges(
    statistics: xr.Dataset,
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]] | None, str]:
    """Return the ends of the 95 % band, the ends of the 50 % band if known, and the name of the 95 % band."""
    quantile = statistics["quantile"]
    levels = quantile["probability"].values

    def pair(*ends: float) -> list[NDArray[np.float64]] | None:
        places = [int(np.abs(levels - p).argmin()) for p in ends] if levels.size else []
        if not places or np.any(np.abs(levels[places] - ends) > 1e-6):
            return None
        edges = [quantile.isel(probability=k).values for k in places]
        return edges if all(np.all(np.isfinite(edge)) for edge in edges) else None

    wide = pair(0.025, 0.975)
    if wide is None:
        mean, reach = statistics["mean"].values, 1.96 * statistics["std"].values
        return [mean - reach, mean + reach], pair(0.25, 0.75), "mean ± 1.96 standard deviations"
    return wide, pair(0.25, 0.75), "95 % of realisations"


def _of_methods(nodes: Mapping[str, xr.DataTree], output: str) -> tuple[Array, dict[str, xr.Dataset]]:
    """Return the union of the times of some methods, and the statistics of an output for each."""
    statistics = {label: of_output(node.children["statistics"], output) for label, node in nodes.items()}
    times = [np.asarray(data["time"].values, dtype=float) for data in statistics.values()]
    return np.unique(np.concatenate(times)), statistics


def _units(statistics: Mapping[str, xr.Dataset]) -> str:
    return str(next(iter(statistics.values()))["output_units"].item())


def at_times(data: xr.Dataset, times: Array, values: Array) -> Array:
    """Return values of `data` at given times; NaN at times that `data` does not contain."""
    own = data["time"].values
    place = np.clip(np.searchsorted(own, times), 0, len(own) - 1)
    return np.where(own[place] == times, np.asarray(values, dtype=float)[place], np.nan)


def _single(node: xr.DataTree, output: str, count: int) -> Strands | None:
    if "samples" not in node.children:
        return None
    samples = samples_of(node)
    ok = np.flatnonzero(samples["status"].values == Status.OK)[:count]
    values = np.asarray(of_output(samples, output)["response"].values[ok], dtype=float)
    return Strands("single realisations", np.broadcast_to(samples["time"].values, values.shape), values)
