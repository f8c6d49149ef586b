"""Draw a chart as a Matplotlib figure, for files, notebooks and readers without scripts.

The code does not use pyplot or its global state, so it can make any number of figures in any thread.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.report.charts.model import MARKS, Band, Boxes, Chart, Curve, Look, Views, axis_of, painted
from uqmbd.report.charts.page import MOST_POINTS, thinned_chart
from uqmbd.report.drawing import (
    FAILED,
    WIDTH,
    across_axis,
    arrange,
    axes_grid,
    constant,
    finish_single,
    log_axis,
    single_axes,
    surroundings,
    with_units,
    wrapped,
)
from uqmbd.typing import Array
from uqmbd.wording import format_quantity, typeset_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

__all__ = ["draw_on_paper"]

HEIGHT, PANEL = 3.3, 1.45
"""Height of a figure with a single chart, and height of the axes of each of several charts, inches."""

LETTERS = 13
"""Number of letters of a label per inch of an axis."""

REACH = 2.0
"""Maximum distance of a limit from the drawn data, relative to their height, as in `chart_model.js`."""

BENEATH, AREAS = 0.8, (0.16, 0.30)
"""Opacity of overlapping areas, and of the outer and the inner band of the first curve."""

Legend = dict[str, Any]


def draw_on_paper(shown: Chart | Views, *, ax: Axes | None = None, height: float = HEIGHT) -> Figure:
    """Draw a chart, or all charts of a figure, in existing axes ``ax`` or a new figure of ``height``, inches."""
    if isinstance(shown, Chart):
        figure, axes = single_axes(height, ax)
        legend = _draw(axes, shown, 60, 2.6, alone=True)
        if shown.boxes is not None and ax is None:
            width = _shades(figure, axes, shown.boxes)
            arrange(figure, [axes], right=width, legend=legend, heights=(2.6,))
            return figure
        finish_single(figure, axes, ax, legend)
        return figure
    charts = list(shown.charts)
    columns = min(shown.columns, len(charts))
    rows = -(-len(charts) // columns)
    heights = shown.heights or (PANEL,) * rows
    figure, grid = axes_grid(len(charts), 1.75, columns)
    legend = {}
    last: Legend = {}
    for k, (axes, chart) in enumerate(zip(grid, charts, strict=True)):
        drawn = _draw(axes, chart, 60 if columns == 1 else 24, heights[k // columns])
        _few_ticks(axes, columns, whole=(chart.plane or axis_of(chart)).whole)
        legend = drawn | legend if k == 0 else legend | {n: h for n, h in drawn.items() if n not in legend}
        last |= {span.name: legend.pop(span.name) for span in chart.spans if span.name in legend}
    _once(grid, columns, shared=shown.shared)
    arrange(figure, grid, columns, legend=legend | last, heights=heights)
    return figure


def _few_ticks(axes: Axes, columns: int, *, whole: bool) -> None:
    """Limit small axes to four intervals, unless their ticks are already set."""
    from matplotlib.ticker import MaxNLocator

    chosen: list[tuple[Axis, int]] = [(axes.yaxis, 4)]
    if not whole:
        chosen.append((axes.xaxis, 5 if columns > 1 else 6))
    for axis, bins in chosen:
        if type(axis.get_major_locator()) is MaxNLocator:
            axis.set_major_locator(MaxNLocator(nbins=bins, steps=[1, 2, 2.5, 5, 10]))


def _once(grid: Sequence[Axes], columns: int, *, shared: bool) -> None:
    """Remove labels that neighbouring axes repeat."""
    if columns > 1 and len({axes.get_ylabel() for axes in grid}) == 1:
        for k, axes in enumerate(grid):
            axes.set_ylabel(axes.get_ylabel() if k % columns == 0 else "")
    if len({axes.get_xlabel() for axes in grid}) == 1:
        for axes in grid[:-columns]:
            axes.set_xlabel("")
    if shared:
        for axes in grid[:-columns]:
            axes.tick_params(labelbottom=False)


def _draw(axes: Axes, whole: Chart, letters: int, height: float, *, alone: bool = False) -> Legend:
    """Draw a chart and return its legend.

    ``letters`` is the number of letters in a row of text beneath the chart. ``height`` is the height of the axes,
    inches. ``alone`` states whether the figure has no other chart.
    """
    chart, _ = thinned_chart(whole, MOST_POINTS)
    axis = chart.plane or axis_of(chart)
    places = np.asarray(chart.places, dtype=float)
    limits, beyond = _limits(chart)
    legend: Legend = {}
    if chart.boxes is not None:
        _draw_boxes(axes, chart.boxes, chart.curves[0].bands)
    for name, value in chart.references.items():
        legend[name] = axes.axhline(value, color="0.35", lw=0.9, ls=(0, (4, 2)), zorder=1.5)
    for k, curve in enumerate(chart.curves):
        if chart.boxes is None or chart.boxes.grid:
            x = places if curve.places is None else np.asarray(curve.places, dtype=float)
            legend |= _draw_curve(axes, x, curve, k, chart, _name(curve, alone and len(chart.curves) == 1))
    for name, value in limits.items():
        message = f"limit: {name} ({format_quantity(value, typeset_units(chart.units))})"
        legend[message] = axes.axhline(value, color=FAILED, ls=(0, (1.25, 1.875)), lw=1.6)
    for name, value in beyond.items():
        (nothing,) = axes.plot([], [], ls="")
        legend[f"outside the chart: limit {name} ({format_quantity(value, typeset_units(chart.units))})"] = nothing
    _right(axes, chart, places, letters)
    _up(axes, chart, limits)
    for span in chart.spans:
        runs = [(start, stop - start) for start, stop in span.runs]
        cover: dict[str, Any] = {"color": "#ECECEC", "alpha": 0.93, "lw": 0, "zorder": 4}
        legend[span.name] = axes.broken_barh(runs, (0, 1), transform=axes.get_xaxis_transform(), **cover)
    if chart.words:
        looks: dict[str, Any] = {"ha": "right", "va": "top", "fontsize": 9, "color": "0.3"}
        axes.text(0.97, 0.95, chart.words, transform=axes.transAxes, **looks)
    if chart.heading:
        axes.set_title(wrapped(chart.heading, letters + 8), fontsize=9.5, y=1.0, loc="right")
    axes.set_xlabel(wrapped(with_units(axis.name, axis.units), letters))
    if not chart.hidden:
        axes.set_ylabel(wrapped(with_units(chart.axis or chart.name, chart.units), int(LETTERS * height)))
    if chart.boxes is None and (chart.plane is None or axis.log):
        axes.grid(color="0.9", lw=0.7)
    else:
        axes.grid(visible=False)
    return legend


def _draw_curve(axes: Axes, x: Array, curve: Curve, k: int, chart: Chart, name: str) -> Legend:
    """Draw a curve with its bands, and return their legend entries; the entry of the curve is first."""
    (colour, _), dash, width = painted(curve, k, len(chart.curves))
    line: Any = (0, dash) if dash else "-"
    values = np.asarray(curve.values, dtype=float)
    if curve.strands is not None:
        thin: dict[str, Any] = {"color": "0.45", "lw": 0.5, "alpha": 0.45, "zorder": 1.5}
        strands = axes.plot(curve.strands.across.T, curve.strands.up.T, **thin)
    signs: Legend = {}
    if chart.stacked:
        for band in curve.bands:
            low, high = (np.asarray(edge, dtype=float) for edge in (band.low, band.high))
            signs[name] = axes.fill_between(x, low, high, color=colour, alpha=BENEATH, lw=0)
            axes.plot(x, high, color="white", lw=0.6)
        return signs
    for depth, band in enumerate(curve.bands):
        signs |= _draw_band(
            axes,
            x,
            band,
            depth,
            first=k == 0,
            looks={"color": colour, "ls": line, "lw": width},
            shift=5 * (k - (len(chart.curves) - 1) / 2),
        )
    base = chart.ends[0] if chart.log and chart.ends else 0.0
    look = curve.look or Look()
    drawn: Any
    if curve.drawn == "bars":
        count = sum(one.drawn == "bars" for one in chart.curves)
        place = sum(one.drawn == "bars" for one in chart.curves[:k])
        wide = 0.7 / count
        drawn = axes.bar(
            x - 0.35 + place * wide, values - base, 0.94 * wide, base, align="edge", color=colour, alpha=0.8
        )
    elif curve.drawn == "filled":
        drawn = axes.fill_between(x, base, values, color=colour, alpha=0.25, lw=0)
        axes.plot(x, values, color=colour, lw=width)
    else:
        bare = curve.drawn == "points" or (bool(look.shape) and not look.joined)
        if bare or curve.drawn == "dotted":
            known = np.isfinite(values) & np.isfinite(x)
            x, values = x[known], values[known]
        mark = MARKS[look.shape] if look.shape else "o" if curve.drawn != "line" or len(x) == 1 else ""
        size = look.size * 0.6 if look.size else 5.0 if look.shape else 3.5
        looks: dict[str, Any] = {"color": colour, "ls": "" if bare else line, "lw": width, "marker": mark, "ms": size}
        if look.shape and not look.joined and not look.hollow:
            looks["mew"] = 1.0 if mark == "x" else 0.0
        (drawn,) = axes.plot(x, values, mfc="white" if look.hollow else colour, clip_on=not mark, **looks)
    if curve.marks:
        at, level = np.transpose(curve.marks)
        looks = {"color": colour, "ls": "", "marker": "o", "ms": 6, "mec": "white", "mew": 0.8, "zorder": 4}
        (marks,) = axes.plot(at, level, clip_on=False, **looks)
        drawn = drawn if np.isfinite(values).any() else marks
    own = {name: drawn} if name else {}
    return own | signs | ({curve.strands.name: strands[0]} if curve.strands is not None and strands else {})


def _name(curve: Curve, only: bool) -> str:
    """Return the name of a curve in the legend; the only curve of a figure has the name of its quantity."""
    if curve.note:
        return f"{curve.name}: {curve.note}"
    return curve.quantity if only else curve.name


def _draw_band(
    axes: Axes, x: Array, band: Band, depth: int, *, first: bool, looks: Mapping[str, Any], shift: float
) -> Legend:
    """Draw a band as bars, as an area (first curve), or as the two ends of the outer band (other curves)."""
    from matplotlib.transforms import ScaledTranslation

    low, high = (np.asarray(edge, dtype=float) for edge in (band.low, band.high))
    if band.bars or len(x) == 1:
        aside = axes.transData + ScaledTranslation(shift / 72, 0, axes.get_figure(root=True).dpi_scale_trans)  # type: ignore[union-attr]
        known = np.isfinite(low) & np.isfinite(high)
        wide = 3.0 if band.bars else 1.2
        for at, *ends in zip(x[known], low[known], high[known], strict=True):
            axes.plot(
                [at, at], ends, color=looks["color"], lw=wide, transform=aside, solid_capstyle="butt", clip_on=False
            )
        return {}
    if first:
        return {band.name: axes.fill_between(x, low, high, color=looks["color"], alpha=AREAS[depth], lw=0)}
    if depth == 0:
        for edge in (low, high):
            axes.plot(x, edge, color=looks["color"], ls=looks["ls"], lw=0.6 * looks["lw"])
    return {}


def _values(chart: Chart) -> Array:
    """Return all drawn values."""
    parts = [np.asarray(curve.values, dtype=float) for curve in chart.curves if not chart.stacked]
    for curve in chart.curves:
        parts += [np.asarray(edge, dtype=float) for band in curve.bands for edge in (band.low, band.high)]
        parts += [] if curve.strands is None else [curve.strands.up.ravel()]
        parts += [np.array([value for _, value in curve.marks])]
        parts += [np.zeros(1)] if curve.drawn in ("bars", "filled") else []
    every = np.concatenate(parts)
    return np.asarray(every[np.isfinite(every)])


def _limits(chart: Chart) -> tuple[dict[str, float], dict[str, float]]:
    """Return the limits to draw, and limits that are not drawn because the curve would look flat."""
    drawn = _values(chart)
    low, high = (float(drawn.min()), float(drawn.max())) if len(drawn) else (0.0, 0.0)
    far = {
        name
        for name, value in chart.limits.items()
        if chart.ends is None and high > low and max(value - high, low - value) > REACH * (high - low)
    }
    every = {name: float(value) for name, value in chart.limits.items()}
    return {n: v for n, v in every.items() if n not in far}, {n: v for n, v in every.items() if n in far}


def _up(axes: Axes, chart: Chart, limits: Mapping[str, float]) -> None:
    """Set the ends of the vertical axis to the ends of the chart, or to the ends of the data with a margin."""
    if chart.hidden:
        axes.set_yticks([])
        axes.spines["left"].set_visible(False)
    if chart.ends is not None:
        (log_axis(axes, "y", *chart.ends) if chart.log else axes.set_ylim(*chart.ends))
        return
    drawn = np.concatenate([_values(chart), list(limits.values())])
    if len(drawn):
        axes.set_ylim(*_roomy(float(drawn.min()), float(drawn.max()), 0.05))


def _right(axes: Axes, chart: Chart, places: Array, letters: int) -> None:
    """Set the ends and the ticks of the horizontal axis from the places."""
    from matplotlib.ticker import FixedFormatter, FixedLocator

    axis = chart.plane or axis_of(chart)
    if axis.categories:
        axes.set_xlim(*(axis.ends or (0.5, len(places) + 0.5)))
        axes.xaxis.set_major_locator(FixedLocator(places.tolist()))
        wide = max(letters // len(places), 8)
        axes.xaxis.set_major_formatter(FixedFormatter([wrapped(text, wide) for text in axis.texts]))
        return
    every = places
    if chart.plane is not None:
        parts = [np.asarray(curve.places, dtype=float) for curve in chart.curves]
        parts += [curve.strands.across.ravel() for curve in chart.curves if curve.strands is not None]
        every = np.concatenate(parts)
        every = every[np.isfinite(every)]
    low, high = axis.ends or ((float(every.min()), float(every.max())) if len(every) else (0.0, 1.0))
    if axis.whole or axis.log:
        room = 1.1 if axis.log and chart.plane is not None else 1.0
        across_axis(axes, low / room, high * room, log=axis.log, whole=axis.whole)
    elif chart.plane is not None:
        axes.set_xlim(*_roomy(low, high, 0.04))
    elif high > low:
        axes.set_xlim(low, high)


def _roomy(low: float, high: float, share: float) -> tuple[float, float]:
    """Return the ends of an axis with a margin; rounding errors of a constant are not magnified."""
    if constant(low, high):
        return surroundings(low, high, 0.5)
    return low - share * (high - low), high + share * (high - low)


def _draw_boxes(axes: Axes, boxes: Boxes, bands: Sequence[Band]) -> None:
    """Draw shaded boxes, the largest values on top."""
    from matplotlib.collections import PolyCollection

    norm, cmap = _tones(boxes)
    if boxes.grid:
        extent = (*boxes.left, *boxes.right)
        shade = np.ma.masked_equal(boxes.shade, 0)
        looks: dict[str, Any] = {"origin": "lower", "aspect": "auto", "interpolation": "none"}
        axes.imshow(shade, norm=norm, cmap=cmap, extent=extent, **looks)
        return
    from matplotlib.cm import ScalarMappable

    x0, x1 = boxes.left, boxes.right
    y0, y1 = (np.asarray(edge, dtype=float) for edge in (bands[0].low, bands[0].high))
    order = np.argsort(boxes.shade, kind="stable")
    sides = ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
    corners = np.stack([np.stack(side, -1) for side in sides], 1)
    faces = ScalarMappable(norm, cmap).to_rgba(np.maximum(boxes.shade, boxes.ends[0])[order])
    axes.add_collection(PolyCollection(list(corners[order]), facecolors=faces, edgecolors="0.25", linewidths=0.7))


def _tones(boxes: Boxes) -> tuple[Any, str]:
    from matplotlib.colors import LogNorm, Normalize

    low, high = boxes.ends
    norm = LogNorm(low, high) if boxes.log else Normalize(low, high or 1.0)
    return norm, "viridis_r" if boxes.grid else "YlGnBu"


def _shades(figure: Figure, axes: Axes, boxes: Boxes) -> float:
    """Draw a colour bar and return its width, inches; the colour bar of Matplotlib takes as long as the figure."""
    from matplotlib.ticker import FixedFormatter, FixedLocator
    from matplotlib.transforms import Bbox

    bar = figure.add_axes((0.9, 0.1, 0.025, 0.8))

    def place(*_: Any) -> Bbox:
        main = axes.get_position()
        return Bbox.from_bounds(main.x1 + 0.02, main.y0, 0.025, main.height)

    bar.set_position(place())
    bar.set_axes_locator(place)
    norm, cmap = _tones(boxes)
    bar.imshow(np.linspace(0, 1, 128)[:, None], cmap=cmap, extent=(0, 1, 0, 1), origin="lower", aspect="auto")
    low, high = boxes.ends
    if boxes.log:
        powers = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
        ones = (1, 2, 5) if high > 10 * low else range(1, 10)
        steps = [m * 10.0**k for k in powers for m in ones if low * (1 - 1e-9) <= m * 10.0**k <= high * (1 + 1e-9)]
    else:
        steps = np.linspace(low, high or 1.0, 5).tolist()
    texts = [f"{step:g}" for step in steps]
    bar.yaxis.set_major_locator(FixedLocator([float(norm(step)) for step in steps]))
    bar.yaxis.set_major_formatter(FixedFormatter(texts))
    bar.yaxis.tick_right()
    bar.yaxis.set_label_position("right")
    bar.set_ylabel(with_units(boxes.name, boxes.units), fontsize=9)
    longest = max(map(len, texts), default=1)
    bar.yaxis.set_label_coords(1 + (0.14 + 0.07 * longest) / (0.025 * WIDTH), 0.5)
    bar.tick_params(labelsize=8)
    bar.set_xticks([])
    bar.spines[["top", "right"]].set_visible(True)
    return 0.65 + 0.07 * longest
