"""One output drawn over another one, as the camber of a wheel over its travel."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.errors import StudyError
from uqmbd.report.drawing import (
    constant,
    finish_single,
    line_width,
    single_axes,
    style,
    surroundings,
    widen_if_constant,
    with_units,
    wrapped,
)
from uqmbd.report.figures.distributions import of_surrogate
from uqmbd.report.figures.selection import Results, nodes_of, of_output, samples_of
from uqmbd.report.figures.surrogates import surrogate_nodes
from uqmbd.status import Status

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Over", "Paths", "bands_over", "is_function", "over_output", "paths_over"]

Array = NDArray[np.float64]

PLACES = 200
"""Values of the other output at which bands are computed."""

MOST = 4096
"""Realisations from which bands are computed, the first ones."""

CURVES = 60
"""Realisations that are drawn as lines where there are no bands."""


class Paths(NamedTuple):
    """Realisations of two outputs along one another: of the other one (x) and of the one that is drawn (y).

    Both have the shape (realisation, time); where a method has none, those of the means, of one row. Times are those at
    which both outputs are known.
    """

    x: Array
    y: Array
    sampled: bool
    times: Array

    @property
    def means(self) -> tuple[Array, Array]:
        """Means of both outputs at each time."""
        return self.x.mean(axis=0), self.y.mean(axis=0)

    @property
    def single(self) -> tuple[Array, Array]:
        """Realisations that are drawn as lines."""
        shown = CURVES if self.sampled else 0
        return self.x[:shown], self.y[:shown]


@dataclass(frozen=True, eq=False)
class Over:
    """An output over another one: units of both, realisations of each method, and whether bands are drawn of these."""

    units: str
    over_units: str
    paths: dict[str, Paths]
    banded: bool


def paths_over(results: Results, output: str, over: str) -> Over:
    """Return what `over_output` draws.

    Raises
    ------
    StudyError
        If no such output exists, or both are the same.
    """
    if output == over:
        raise StudyError(f"Output {output!r} is to be drawn over itself; give another output as over=.")
    nodes = nodes_of(results)
    paths = {label: _paths(node, output, over) for label, node in nodes.items()}
    first = next(iter(nodes.values())).children["statistics"]
    units, over_units = (str(of_output(first, name)["output_units"].item()) for name in (output, over))
    return Over(units, over_units, paths, all(_is_function(path) for path in paths.values()))


def bands_over(path: Paths, places: Array | None = None) -> tuple[Array, Array, Array]:
    """Return values of the other output, the mean there, and the ends of the bands of 95 % and 50 %, shape (4, P).

    The ends are the lower and the upper one of the wide band, then of the narrow one. Where no place is given, there
    are 200 of those that all realisations pass; elsewhere values are NaN.
    """
    x, y = (path.x, path.y) if path.x[0, -1] > path.x[0, 0] else (path.x[:, ::-1], path.y[:, ::-1])
    low, high = float(x[:, 0].max()), float(x[:, -1].min())
    at = np.linspace(low, high, PLACES) if places is None else places
    values = np.array([np.interp(at, *one) for one in zip(x, y, strict=True)])
    values[:, (at < low) | (at > high)] = np.nan
    return at, values.mean(axis=0), np.quantile(values, [0.025, 0.975, 0.25, 0.75], axis=0)


def over_output(results: Results, output: str, over: str, *, ax: Axes | None = None) -> Figure:
    """Draw an output over another one: each realisation is a curve in the plane of both, run through in time.

    Where the other output only grows, or only falls, in every realisation, the curves are functions of it: their mean
    and the bands that hold 50 % and 95 % of them at each of its values are drawn, over the values that all of them
    pass.  Else (a wheel that goes up and down) single realisations are drawn as lines, and the means of both outputs,
    which are taken at each time.  Curves of a polynomial chaos are samples of it.  With several methods the first has
    filled bands, or lines; of the others the mean and the edges of the 95 % band are drawn.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of these
        A study's result, the node of one propagator, or several such nodes.
    output : str
        Name of the output that is drawn upwards.
    over : str
        Name of the output that is drawn to the right.
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
    >>> from uqmbd.results import labels, propagator_node, sample_dataset, statistics_of_samples
    >>> axes = labels([("x", "m"), ("y", "m")], ["k"], [0.0, 1.0, 2.0])
    >>> samples = sample_dataset([[[0, 1, 2], [0, 1, 4]], [[0, 1, 2], [0, 2, 5]]], [[1.0], [2.0]], axes)
    >>> node = propagator_node("mine", statistics_of_samples(samples), samples=samples,
    ...                        propagator="p", realisations=2, wall_time=0.0)
    >>> figure = over_output(node, "y", over="x")
    >>> figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()
    ('x [m]', 'y [m]')
    """
    found = paths_over(results, output, over)
    figure, axes = single_axes(3.6, ax)
    handles: dict[str, Any] = {}
    y_ends, x_ends = [np.inf, -np.inf], [np.inf, -np.inf]
    for k, (label, path) in enumerate(found.paths.items()):
        name = "" if len(found.paths) == 1 else f"{label}: "
        draw = _draw_bands if found.banded else _draw_lines
        drawn = draw(axes, path, k, len(found.paths), name, handles)
        for ends, values in zip((x_ends, y_ends), drawn, strict=True):
            ends[:] = min(ends[0], float(values.min())), max(ends[1], float(values.max()))
    axes.set_xlabel(wrapped(with_units(over, found.over_units), 60))
    axes.set_ylabel(wrapped(with_units(output, found.units), 34))
    low, high = x_ends
    if constant(low, high):
        low, high = surroundings(low, high, 0.5)
    margin = 0.0 if found.banded else 0.03 * (high - low)
    axes.set_xlim(low - margin, high + margin)
    widen_if_constant(axes, "y", *y_ends)
    finish_single(figure, axes, ax, handles)
    return figure


def is_function(node: xr.DataTree, output: str, over: str) -> bool:
    """Tell whether every realisation of an output is a function of another one, so that bands over it are drawn."""
    return _is_function(_paths(node, output, over))


def _paths(node: xr.DataTree, output: str, over: str) -> Paths:
    """Return the curves of a method: its samples, samples of its surrogate, or that of its means."""
    statistics = node.children["statistics"]
    means = [of_output(statistics, name)["mean"].values[None, :] for name in (over, output)]
    found, sampled = means, False
    if "samples" in node.children:
        samples = samples_of(node)
        fine = np.flatnonzero(samples["status"].values == Status.OK)[:MOST]
        if len(fine):
            found = [of_output(samples, name)["response"].values[fine] for name in (over, output)]
            sampled = True
    elif surrogate_nodes({"": node}):
        # a general joint distribution cannot be sampled without its mechanism
        with contextlib.suppress(StudyError):
            found = [of_surrogate(node, name).values for name in (over, output)]
            sampled = True
    x, y = (np.asarray(values, dtype=float) for values in found)
    known = np.isfinite(x).all(axis=0) & np.isfinite(y).all(axis=0)
    if not known.any():
        raise StudyError(f"Outputs {output!r} and {over!r} have no values at the same time; there is nothing to draw.")
    times = np.asarray(statistics["time"].values, dtype=float)
    return Paths(x[:, known], y[:, known], sampled, times[known])


def _is_function(path: Paths) -> bool:
    """Whether the other output only grows, or only falls, in all realisations, and all pass common values."""
    steps = np.diff(path.x, axis=1)
    one_way = bool((steps > 0).all() or (steps < 0).all())
    return one_way and steps.shape[1] > 0 and bool(path.x.min(axis=1).max() < path.x.max(axis=1).min())


def _draw_bands(
    axes: Axes, path: Paths, k: int, methods: int, name: str, handles: dict[str, Any]
) -> tuple[Array, Array]:
    """Draw mean and bands at each value of the other output."""
    (colour, line), width = style(k), line_width(k, methods)
    places, mean, (low, high, inner_low, inner_high) = bands_over(path)
    if path.sampled and k == 0:
        outer = axes.fill_between(places, low, high, color=colour, alpha=0.16, lw=0)
        inner = axes.fill_between(places, inner_low, inner_high, color=colour, alpha=0.30, lw=0)
    (handles[f"{name}mean"],) = axes.plot(places, mean, color=colour, ls=line, lw=width)
    if path.sampled and k == 0:
        handles["50 %" if name else "50 % of realisations"] = inner
        handles["95 %" if name else "95 % of realisations"] = outer
    elif path.sampled:
        handles[f"{name}mean, 95 %"] = handles.pop(f"{name}mean")
        for edge in (low, high):
            axes.plot(places, edge, color=colour, ls=line, lw=0.6 * width)
    return places, np.stack([low, high, mean])


def _draw_lines(
    axes: Axes, path: Paths, k: int, methods: int, name: str, handles: dict[str, Any]
) -> tuple[Array, Array]:
    """Draw realisations of the first method as lines, and the means of both outputs at each time."""
    (colour, line), width = style(k), line_width(k, methods)
    x, y = path.means
    many_x, many_y = path.single if k == 0 else (x[:0], y[:0])
    if len(many_x):
        thin = axes.plot(many_x.T, many_y.T, color="0.45", lw=0.5, alpha=0.45, zorder=1.5)
        handles[f"{name}single realisations"] = thin[0]
    (handles[f"{name}mean at each time"],) = axes.plot(x, y, color=colour, ls=line, lw=width)
    return np.append(many_x, x), np.append(many_y, y)
