"""Charts of one output over another, such as camber over wheel travel."""

from __future__ import annotations

import contextlib
import heapq
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.report.charts import MOST_TIMES, Axis, Band, Chart, Curve, Look, Strands, draw_on_paper
from uqmbd.report.figures.distributions import of_surrogate
from uqmbd.report.figures.selection import Results, nodes_of, of_output, samples_of
from uqmbd.report.figures.surrogates import drawable_nodes
from uqmbd.status import Status
from uqmbd.wording import typeset_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Over", "OutputPaths", "bands_over", "is_function", "over_chart", "over_output", "paths_over"]

Array = NDArray[np.float64]

PLACES = 200
"""Number of values of the other output at which bands are computed."""

MOST = 4096
"""Maximum number of realisations for bands; the first realisations are used."""

BENDS = 200
"""Maximum number of points of a single realisation."""

STRAIGHT = 1 / 800
"""Allowed deviation of lines from the data, relative to the height and width of a chart: about half a pixel."""

CURVES = 60
"""Maximum number of realisations that are drawn as lines if there are no bands."""


class OutputPaths(NamedTuple):
    """Realisations of two outputs of a method: the output on the horizontal axis (x), and on the vertical axis (y).

    Both have the shape (realisation, time). A method without realisations has one row with the means. The times are all
    times at which both outputs are known.
    """

    x: Array
    y: Array
    sampled: bool
    times: Array

    @property
    def means(self) -> tuple[Array, Array]:
        """Return the means of both outputs at each time."""
        return self.x.mean(axis=0), self.y.mean(axis=0)

    @property
    def single(self) -> tuple[Array, Array]:
        """Return the realisations that are drawn as single lines."""
        shown = CURVES if self.sampled else 0
        return self.x[:shown], self.y[:shown]


@dataclass(frozen=True, eq=False)
class Over:
    """Data of an output over another: units of both, realisations of each method, and whether bands are drawn."""

    units: str
    over_units: str
    paths: dict[str, OutputPaths]
    banded: bool


def paths_over(results: Results, output: str, over: str) -> Over:
    """Return the data of `over_output`.

    Raise StudyError if no such output exists, or both are the same.
    """
    if output == over:
        raise StudyError(f"Output {output!r} cannot be drawn over itself; give another output as over=.")
    nodes = nodes_of(results)
    paths = {label: _paths(node, output, over) for label, node in nodes.items()}
    first = next(iter(nodes.values())).children["statistics"]
    units, over_units = (str(of_output(first, name)["output_units"].item()) for name in (output, over))
    return Over(units, over_units, paths, all(_is_function(path) for path in paths.values()))


def bands_over(path: OutputPaths, places: Array | None = None) -> tuple[Array, Array, Array]:
    """Return P values of the other output, and mean (P,) and ends of bands (4, P) of the output at these values.

    The ends are the lower and upper end of the 95 % band, then of the 50 % band. By default, there are 200 values
    within the range that all realisations cover. Beyond this range, results are NaN at given values `places`.
    """
    x, y = (path.x, path.y) if path.x[0, -1] > path.x[0, 0] else (path.x[:, ::-1], path.y[:, ::-1])
    low, high = float(x[:, 0].max()), float(x[:, -1].min())
    at = np.linspace(low, high, PLACES) if places is None else places
    values = np.array([np.interp(at, *one) for one in zip(x, y, strict=True)])
    values[:, (at < low) | (at > high)] = np.nan
    return at, values.mean(axis=0), np.quantile(values, [0.025, 0.975, 0.25, 0.75], axis=0)


def over_chart(results: Results, output: str, over: str) -> Chart:
    """Chart an output over another output, with the content of `over_output`.

    If bands are drawn, the chart contains curves along the other output. Otherwise it is in the plane of both outputs:
    it contains the means at each time, and single realisations of the first method; its cursor follows the time of the
    page.

    Raise StudyError if no such output exists, or both are the same.
    """
    found = paths_over(results, output, over)
    plane = Axis(over, typeset_units(found.over_units))
    if found.banded:
        return _banded(found.paths, output, found.units, plane)
    first = next(iter(found.paths.values()))
    known = np.unique(np.concatenate([path.times for path in found.paths.values()]))
    chosen = known
    if len(known) > MOST_TIMES:
        lines = [np.stack([np.interp(known, path.times, one) for one in path.means]) for path in found.paths.values()]
        chosen = known[_bends(np.stack(lines), MOST_TIMES, 0.0)]
    curves = []
    for k, (label, path) in enumerate(found.paths.items()):
        x, y = (_placed(chosen, path.times, values) for values in path.means)
        strands = _strands(path, chosen) if k == 0 and len(path.single[0]) else None
        curves.append(Curve(label, y, (), "mean at each time", look=Look(joined=True), places=x, strands=strands))
    start = int(np.abs(chosen - first.times[np.ptp(first.y, axis=0).argmax()]).argmin())
    return Chart(output, chosen, curves, units=found.units, plane=plane, count=len(known), start=start)


def _banded(paths: Mapping[str, OutputPaths], output: str, units: str, axis: Axis) -> Chart:
    places = np.unique(np.concatenate([bands_over(path)[0] for path in paths.values()]))
    curves = []
    for label, path in paths.items():
        _, mean, (low, high, inner_low, inner_high) = bands_over(path, places)
        bands = (Band("95 % of realisations", low, high), Band("50 % of realisations", inner_low, inner_high))
        curves.append(Curve(label, mean, bands if path.sampled else (), "mean"))
    return Chart(output, places, curves, units=units, along=axis)


def _strands(path: OutputPaths, chosen: Array) -> Strands:
    """Return single realisations at a selection of the chosen times; straight lines join their points."""
    x, y = (values[:, np.isin(path.times, chosen)] for values in path.single)
    at = _bends(np.stack([x, y], axis=1), BENDS, STRAIGHT)
    own = np.flatnonzero(np.isin(chosen, path.times))
    return Strands("single realisations", x[:, at], y[:, at], own[at])


def _bends(lines: Array, most: int, tolerance: float) -> NDArray[np.intp]:
    """Choose indices (of T) such that straight lines between their points approximate lines (R, 2, T).

    Each step adds the point with the largest deviation. The search ends at ``most`` points, or if no deviation exceeds
    the tolerance, relative to the extent of all lines along each axis. The method is the algorithm of Ramer, Douglas
    and Peucker for many lines at once.
    """
    extent = np.ptp(lines, axis=(0, 2))
    scaled = lines / np.where(extent > 0, extent, 1.0)[:, None]
    last = scaled.shape[-1] - 1
    chosen = {0, last}
    waiting: list[tuple[float, int, int, int]] = []

    def look(low: int, high: int) -> None:
        if high - low < 2:
            return
        share = np.linspace(0, 1, high - low + 1)[1:-1]
        ends = scaled[..., low, None], scaled[..., high, None]
        away = np.abs(scaled[..., low + 1 : high] - (ends[0] + (ends[1] - ends[0]) * share)).max(axis=(0, 1))
        k = int(away.argmax())
        heapq.heappush(waiting, (-float(away[k]), low, low + 1 + k, high))

    look(0, last)
    while waiting and len(chosen) < most:
        away, low, k, high = heapq.heappop(waiting)
        if -away <= tolerance:
            break
        chosen.add(k)
        look(low, k)
        look(k, high)
    return np.array(sorted(chosen))


def _placed(chosen: Array, times: Array, values: Array) -> Array:
    """Return values at chosen times; NaN where they are unknown."""
    place = np.clip(np.searchsorted(times, chosen), 0, len(times) - 1)
    return np.where(times[place] == chosen, values[place], np.nan)


@typechecked
def over_output(results: Results, output: str, over: str, *, ax: Axes | None = None) -> Figure:
    """Draw an output over another output: each realisation is a curve in their plane, with time as parameter.

    If the other output is monotonic in every realisation, the curves are functions of it. The figure then shows their
    mean, and the bands that contain 50 % and 95 % of the curves, over the range that all curves cover. Otherwise (a
    wheel that goes up and down) lines show single realisations, and the means of both outputs at each time. Curves of a
    polynomial chaos are drawn from its samples. With several methods, the first has filled bands, or lines; the others
    have the mean and the edges of the 95 % band.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of these
        Result of a study, node of one propagator, or several such nodes.
    output : str
        Name of the output on the vertical axis.
    over : str
        Name of the output on the horizontal axis.
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
    >>> from uqmbd.extend import labels, sample_dataset
    >>> from uqmbd.extend import statistics_of_samples
    >>> axes = labels([("x", "m"), ("y", "m")], ["k"], [0.0, 1.0, 2.0])
    >>> samples = sample_dataset([[[0, 1, 2], [0, 1, 4]], [[0, 1, 2], [0, 2, 5]]], [[1.0], [2.0]], axes)
    >>> node = propagator_node("mine", statistics_of_samples(samples), samples=samples,
    ...                        propagator="p", realisations=2, wall_time=0.0)
    >>> figure = over_output(node, "y", over="x")
    >>> figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()
    ('x [m]', 'y [m]')
    """
    return draw_on_paper(over_chart(results, output, over), ax=ax, height=3.6)


def is_function(node: xr.DataTree, output: str, over: str) -> bool:
    """Return whether an output is a function of another output in every realisation, as required for bands."""
    return _is_function(_paths(node, output, over))


def _paths(node: xr.DataTree, output: str, over: str) -> OutputPaths:
    """Return the curves of a method from its samples, from samples of its surrogate, or from its means."""
    statistics = node.children["statistics"]
    means = [of_output(statistics, name)["mean"].values[None, :] for name in (over, output)]
    found, sampled = means, False
    if "samples" in node.children:
        samples = samples_of(node)
        fine = np.flatnonzero(samples["status"].values == Status.OK)[:MOST]
        if len(fine):
            found = [of_output(samples, name)["response"].values[fine] for name in (over, output)]
            sampled = True
    elif drawable_nodes({"": node}):
        # StudyError: sampling a general joint distribution requires its mechanism
        with contextlib.suppress(StudyError):
            found = [of_surrogate(node, name).values for name in (over, output)]
            sampled = True
    x, y = (np.asarray(values, dtype=float) for values in found)
    known = np.isfinite(x).all(axis=0) & np.isfinite(y).all(axis=0)
    if not known.any():
        raise StudyError(f"Outputs {output!r} and {over!r} have no values at the same time; there is nothing to draw.")
    times = np.asarray(statistics["time"].values, dtype=float)
    return OutputPaths(x[:, known], y[:, known], sampled, times[known])


def _is_function(path: OutputPaths) -> bool:
    """Return whether the other output is monotonic in all realisations, with a common range of values."""
    steps = np.diff(path.x, axis=1)
    one_way = bool((steps > 0).all() or (steps < 0).all())
    return one_way and steps.shape[1] > 0 and bool(path.x.min(axis=1).max() < path.x.max(axis=1).min())
