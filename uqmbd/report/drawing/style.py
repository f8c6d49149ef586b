"""Common style of figures: size, colours, axes, legends, and labels with names as the user wrote them.

Length: public functions document their parameters and have an example.
"""

from __future__ import annotations

import functools
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.arguments import Bounds, Count, Size, shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.report.drawing.scales import plain_formatter
from uqmbd.wording import typeset_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

__all__ = [
    "COLOURS",
    "FAILED",
    "LINES",
    "ON_DARK",
    "arrange",
    "arranged_layout",
    "axes_grid",
    "constant",
    "finish_single",
    "histogram",
    "histogram_edges",
    "is_arranged",
    "line_width",
    "shortened",
    "single_axes",
    "series_style",
    "surroundings",
    "tick_width",
    "with_units",
    "wrapped",
]


@functools.cache
def arranged_layout() -> Any:
    """Return a class of constrained layout, which identifies figures that `arrange` has placed."""
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    class ArrangedLayout(ConstrainedLayoutEngine):
        pass

    return ArrangedLayout


def is_arranged(figure: Figure) -> bool:
    """Return whether `arrange` has placed the axes of a figure."""
    return isinstance(figure.get_layout_engine(), arranged_layout())


# colours of Okabe and Ito, distinguishable with every common type of colour vision; in print, line styles differ
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#8A6D00", "#000000")
# lighter versions in the same order, legible on a dark page
ON_DARK = ("#56B4E9", "#FF9955", "#2CCB9C", "#F0A6D0", "#D6B940", "#F2F2F2")
LINES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1, 1.2)), (0, (6, 2, 1, 2)), (0, (3, 1, 1, 1, 1, 1)), (0, (9, 3)))
FAILED = "#B00020"
TALLEST = 1000.0
"""Maximum height of a row of axes, inches."""

WIDTH = 5.6  # inches: legible at full size, and also on a phone that reduces the figure
MOST_LINES = 4
"""Maximum number of lines of a label; more lines would cover the figure."""
_LINE, _CHARACTER = 0.165, 0.078  # inches: height of a line, width of a digit
_RIGHT = 0.18  # inches: half a number at the end of an axis


@typechecked
def series_style(k: Size) -> tuple[str, Any]:
    """Return the colour and the line style of the k-th series of a figure, counted from 0.

    Parameters
    ----------
    k : int
        Index of the series.

    Returns
    -------
    tuple
        Colour and line style of Matplotlib, distinguishable with every common colour vision and in print.

    Examples
    --------
    >>> series_style(0)
    ('#0072B2', '-')
    """
    return COLOURS[k % len(COLOURS)], LINES[k % len(LINES)]


def single_axes(height: float, given: Axes | None = None) -> tuple[Figure, Axes]:
    """Return a new figure of a height (inches) with one pair of axes, or the given axes and their figure."""
    if given is not None:
        return given.get_figure(root=True), given  # type: ignore[return-value]
    figure, (axes,) = axes_grid(1, height, 1)
    axes.grid(color="0.9", lw=0.7)
    return figure, axes


def finish_single(figure: Figure, axes: Axes, given: Axes | None, legend: Mapping[str, Any]) -> None:
    """Arrange a figure with one pair of axes; for a figure of the caller, only add the legend."""
    if given is None:
        arrange(figure, [axes], legend=legend)
        return
    for text in axes.legend(list(legend.values()), [shortened(name) for name in legend], fontsize=8).get_texts():
        text.set_parse_math(False)


@typechecked
def axes_grid(
    count: Count, height: Annotated[float, Bounds(0, TALLEST)], columns: Count = 2
) -> tuple[Figure, list[Axes]]:
    """Return a figure of the width of the report with axes in rows; `arrange` places them later.

    Parameters
    ----------
    count : int
        Number of axes.
    height : float
        Height of each row, inches.
    columns : int
        Maximum number of columns.

    Returns
    -------
    figure : matplotlib.figure.Figure
    axes : list of matplotlib.axes.Axes
        Row after row.

    Examples
    --------
    >>> figure, grid = axes_grid(3, 2.0)
    >>> len(grid), figure.get_size_inches().round(2).tolist()
    (3, [5.6, 4.3])
    """
    from matplotlib.figure import Figure

    rows = -(-count // min(count, columns))
    figure = Figure(figsize=(WIDTH, max(height * rows + (0.3 if rows > 1 else 0.0), 2.2)))
    # `arrange` sets the positions as soon as the labels are known
    grid = [figure.add_axes((0.1, 0.1, 0.8, 0.8)) for _ in range(count)]
    for axes in grid:
        _dress(axes)
    return figure, grid


def _dress(axes: Axes) -> None:
    from matplotlib.ticker import MaxNLocator

    axes.spines[["top", "right"]].set_visible(False)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=9)
    # a given height of the title avoids a search for overlapping objects
    axes.set_title("", y=1.0)
    for axis in (axes.xaxis, axes.yaxis):
        formatter = plain_formatter()(useMathText=False)
        formatter.set_powerlimits((-3, 4))
        axis.set_major_formatter(formatter)
        axis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 2.5, 5, 10]))
        axis.get_offset_text().set_fontsize(9)


@typechecked
def arrange(
    figure: Figure,
    grid: Sequence[Axes],
    columns: Count = 1,
    *,
    legend: Mapping[str, Any] | None = None,
    right: float = _RIGHT,
    heights: Sequence[float] | None = None,
) -> None:
    """Place axes row by row, with a legend above them.

    The figure then has the constrained layout of Matplotlib. Axes make room for their labels at each drawing, also
    after changes of the size, fonts or texts of the figure. Pictures of the report page do not change, so they do not
    use this layout, which takes 17 ms for each picture. Their positions follow from the number of characters.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    grid : sequence of matplotlib.axes.Axes
        Row after row, with `columns` axes in each row.
    columns : int
    legend : mapping of str to artist, optional
        Names and handles of the legend.
    right : float
        Width on the right of the axes, inches, with the texts next to them.
    heights : sequence of float, optional
        Heights of the rows of axes without labels, inches. The height of the figure is the sum of these heights, the
        labels and the legend. Rows without time labels are close together. Default: equal shares of the figure.

    Raises
    ------
    uqmbd.StudyError
        If there are no axes, or `heights` has not one height for each row.

    Examples
    --------
    >>> figure, axes = single_axes(3.0)
    >>> arrange(figure, [axes])
    >>> bool(0 < axes.get_position().x0 < 0.15 and axes.get_position().x1 > 0.9)
    True
    >>> figure.get_layout_engine().adjust_compatible
    False
    """
    from matplotlib.gridspec import GridSpec

    top = 0.08 + (_legend_above(figure, legend) if legend else 0.0)
    rows = -(-len(grid) // columns)
    if not rows or (heights is not None and len(heights) != rows):
        raise StudyError(
            f"arrange: there are {len(grid)} axes in {rows} rows, and heights is {shown(heights)}; expected at least "
            "one pair of axes, and a height for each row."
        )
    cells = GridSpec(rows, min(columns, len(grid)), figure=figure, height_ratios=heights)
    for k, axes in enumerate(grid):
        axes.set_subplotspec(cells[k // columns, k % columns])
    _place(figure, grid, columns, top, right, heights)
    for axes in grid:
        # include axes in the layout, from which their explicit position would exclude them
        axes.set_in_layout(True)
    figure.align_ylabels(grid)
    # the layout does not measure objects outside the axes, which need additional room on the right
    room = 0.0 if any(axes.child_axes for axes in grid) else max(right - _RIGHT, 0.0)
    figure.set_layout_engine(arranged_layout()(rect=(0, 0, 1 - room / figure.get_figwidth(), 1)))


def _place(
    figure: Figure,
    grid: Sequence[Axes],
    columns: int,
    top: float,
    right: float,
    heights: Sequence[float] | None,
) -> None:
    """Place axes below the top margin ``top``, inches; the lengths of their texts determine the distances."""
    width, height = figure.get_size_inches()
    rows = [grid[k : k + columns] for k in range(0, len(grid), columns)]
    ticks = [max(tick_width(row[j].yaxis) for row in rows if j < len(row)) for j in range(len(rows[0]))]
    lefts = [w + max(_lines(row[j].get_ylabel()) for row in rows if j < len(row)) for j, w in enumerate(ticks)]
    heads = [max(0.2 if _title(a) or _offset(a.yaxis) else 0.06 for a in row) for row in rows]
    feet = [0.27 + max(_lines(a.get_xlabel()) or (0.12 if _offset(a.xaxis) else 0.0) for a in row) for row in rows]
    inner_width = (width - sum(lefts) - right * len(lefts)) / len(lefts)
    if heights is None:
        inner = [(height - top - sum(heads) - sum(feet)) / len(rows)] * len(rows)
    else:
        inner = list(heights)
        heads = [
            head + (0.06 if any(map(_title, row)) else 0.0) + (0.08 if k else 0.0)
            for k, (row, head) in enumerate(zip(rows, heads, strict=True))
        ]
        feet = [
            foot if any(a.xaxis.get_tick_params().get("labelbottom", True) for a in row) else 0.1
            for row, foot in zip(rows, feet, strict=True)
        ]
        height = top + sum(heads) + sum(inner) + sum(feet)
        figure.set_figheight(height)
    down = height - top
    for row, head, inner_height, foot in zip(rows, heads, inner, feet, strict=True):
        down -= head + inner_height
        across = 0.0
        for axes, left in zip(row, lefts, strict=False):
            across += left
            axes.set_position((across / width, down / height, inner_width / width, inner_height / height))
            _keep_ticks_apart(axes.xaxis, inner_width)
            across += inner_width + right
        down -= foot


def _title(axes: Axes) -> str:
    return axes.get_title() or axes.get_title("left") or axes.get_title("right")


def _keep_ticks_apart(axis: Axis, room: float) -> None:
    """Remove ticks until their texts do not overlap; ``room`` is the length of the axis, inches."""
    from matplotlib.ticker import MaxNLocator

    low, high = sorted(axis.get_view_interval())
    for bins in (4, 3, 2, 1):
        places = [place for place in axis.get_majorticklocs() if low <= place <= high]
        texts = axis.get_major_formatter().format_ticks(places)
        longest = _CHARACTER * (max(map(len, texts), default=0) + 1)
        if type(axis.get_major_locator()) is not MaxNLocator or len(places) < 2:
            return
        if longest < room * (places[1] - places[0]) / (high - low):
            return
        axis.set_major_locator(MaxNLocator(nbins=bins, steps=[1, 2, 2.5, 5, 10]))


def tick_width(axis: Axis) -> float:
    """Return the width of the tick labels of an axis, inches."""
    texts = axis.get_major_formatter().format_ticks(list(axis.get_majorticklocs()))
    return 0.12 + _CHARACTER * max((len(text) for text in texts), default=0)


def _offset(axis: Axis) -> bool:
    axis.get_major_formatter().format_ticks(list(axis.get_majorticklocs()))
    return bool(axis.get_major_formatter().get_offset())


def _lines(text: str) -> float:
    return _LINE * (text.count("\n") + 1) + 0.05 if text else 0.0


def histogram_edges(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return bin edges for values (S,): one bin for a constant, at most 60 bins otherwise."""
    low, high = float(values.min()), float(values.max())
    if constant(low, high):
        return np.array(surroundings(low, high, 0.04))
    # Freedman-Diaconis rule, with a minimum number of samples in each bin
    edges = np.histogram_bin_edges(values, "auto")
    return np.linspace(low, high, 61) if len(edges) > 61 else np.asarray(edges, dtype=float)


def histogram(values: NDArray[np.float64], *, density: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the bin edges and the heights of the bars: counts or densities."""
    edges = histogram_edges(values)
    heights, _ = np.histogram(values, edges, density=density)
    return edges, heights.astype(float)


def line_width(k: int, count: int) -> float:
    """Return the line width of the k-th of several methods; earlier lines are wider, so that they are never hidden.

    >>> line_width(0, 1), line_width(0, 3) > line_width(1, 3) > line_width(2, 3)
    (1.6, True)
    """
    return 1.6 if count == 1 else max(2.8 - 0.6 * k, 1.0)


def constant(low: float, high: float) -> bool:
    """Return whether a minimum and a maximum differ only by rounding."""
    return high - low <= 1e-9 * max(abs(low), abs(high))


def surroundings(low: float, high: float, share: float) -> tuple[float, float]:
    """Return the ends of an axis around a constant, at a distance of `share` times its magnitude."""
    centre = (low + high) / 2
    reach = share * (abs(centre) or 1.0)
    return centre - reach, centre + reach


def _legend_above(figure: Figure, handles: Mapping[str, Any]) -> float:
    """Place a legend at the top, with the largest possible number of columns; return its height, inches."""
    names = [shortened(name) for name in handles]
    columns = len(names)
    while columns > 1 and _legend_width(names, columns) > 72 * WIDTH - 10:
        columns -= 1
    legend = figure.legend(
        list(handles.values()), names, loc="outside upper left", ncols=columns, frameon=False,
        fontsize=9, borderaxespad=0.15,
    )  # fmt: skip
    for text in legend.get_texts():
        text.set_parse_math(False)
    return 0.19 * -(-len(names) // columns) + 0.06


def _legend_width(names: Sequence[str], columns: int) -> float:
    """Estimate the width of a legend, points, with evenly filled columns as in Matplotlib."""
    return sum(5.2 * max(map(len, column)) + 42 for column in np.array_split(np.array(names, dtype=object), columns))


@typechecked
def with_units(name: str, units: str) -> str:
    """Return a label: the name, followed by its units in brackets if it has units.

    Parameters
    ----------
    name, units : str

    Examples
    --------
    >>> with_units("angle", "rad"), with_units("ratio", "1"), with_units("acceleration", "m/s^2")
    ('angle [rad]', 'ratio', 'acceleration [m/s²]')
    """
    shown = typeset_units(units)
    return f"{name} [{shown}]" if shown else name


@typechecked
def wrapped(text: str, width: Count) -> str:
    r"""Break a long name into lines and escape its dollar signs; names above the maximum length are cut.

    Parameters
    ----------
    text : str
        The name.
    width : int
        Number of letters in a line.

    Returns
    -------
    str
        Name with line breaks.

    Examples
    --------
    >>> wrapped("force in the left spring", 14), wrapped("w" * 300, 10).count("\n")
    ('force in the\nleft spring', 3)
    """
    lines = textwrap.wrap(text, width) or [text]
    if len(lines) > MOST_LINES:
        # the middle is cut, because names often differ at the end
        half = MOST_LINES * width // 2 - width // 4 - 2
        lines = textwrap.wrap(f"{text[:half].rstrip()} … {text[-half:].lstrip()}", width)
    return "\n".join(lines).replace("$", r"\$")


def shortened(text: str) -> str:
    """Shorten a text of more than 60 characters in its middle, because names often differ at the end."""
    return text if len(text) <= 60 else f"{text[:34].rstrip()} … {text[-22:].lstrip()}"
