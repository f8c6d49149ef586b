"""Data model of a chart: curves with bands and points along an axis or in a plane; boxes; levels; texts.

The model depends neither on HTML nor on Matplotlib; the modules `page` and `paper` draw it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uqmbd.arguments import shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.report.drawing import COLOURS, LINES, ON_DARK, ROLES, line_width
from uqmbd.typing import Index
from uqmbd.wording import typeset_units

__all__ = [
    "MARKS",
    "Axis",
    "Band",
    "Boxes",
    "Chart",
    "Column",
    "Curve",
    "Look",
    "Span",
    "Strands",
    "Views",
    "axis_of",
    "painted",
    "several",
]

MARKS = {"disc": "o", "square": "s", "diamond": "D", "up": "^", "down": "v", "plus": "P", "cross": "x"}
"""Shapes of points, with their letters in Matplotlib; readers can distinguish all shapes without colour."""

QUIET = ("#8a8f96", "#7d868f")
"""Colours of curves that represent several quantities, on a light and on a dark page."""


@typechecked(values=False)
@dataclass(frozen=True)
class Band:
    """A band between two curves.

    Attributes
    ----------
    name : str
        Content of the band, such as ``95 % of realisations``.
    low, high : array_like, shape (T,)
        Ends of the band, in the units of the chart; NaN if unknown.
    bars : bool
        Whether the band is drawn as a bar at each place instead of an area.

    Examples
    --------
    >>> import numpy as np
    >>> from uqmbd.report import Band
    >>> band = Band("95 % of realisations", low=np.array([-1.0, 0.0]), high=np.array([1.0, 2.0]))
    >>> band.name, (band.high - band.low).tolist()
    ('95 % of realisations', [2.0, 2.0])
    """

    name: str
    low: ArrayLike
    high: ArrayLike
    bars: bool = False


@dataclass(frozen=True)
class Look:
    """Line style of a curve that differs from the default of its position in the chart.

    ``colour`` is an index in the series of colours, or the name of a role. ``dash`` contains lengths on and off, in
    widths of the line; ``width`` is in points. ``shape`` is the shape of marks, a key of ``MARKS``, and ``size`` their
    size, pixels. ``hollow`` states whether marks are hollow, and ``joined`` whether a line joins them. The cursor
    ignores a ``quiet`` curve.
    """

    colour: int | str | None = None
    dash: tuple[float, ...] | None = None
    width: float | None = None
    shape: str = ""
    size: float | None = None
    hollow: bool = False
    joined: bool = False
    quiet: bool = False


@dataclass(frozen=True, eq=False)
class Column:
    """Column of the table of values that is not drawn: one number or name for each place.

    ``units`` are None for the units of the chart. ``digits`` states whether two digits are sufficient, as for an error.
    """

    name: str
    values: ArrayLike | Sequence[str]
    units: str | None = None
    digits: bool = False


@dataclass(frozen=True, eq=False)
class Strands:
    """Thin lines beneath a curve, such as single realisations: ``across`` and ``up`` (N, K).

    In a plane, ``at`` contains the places (K,) of the cursor for their points.
    """

    name: str
    across: NDArray[np.float64]
    up: NDArray[np.float64]
    at: NDArray[np.intp] | None = None


@typechecked(values=False)
@dataclass(frozen=True)
class Curve:
    """A line over time with bands; the reader can switch it off.

    Attributes
    ----------
    name : str
        Name of the curve in the chart, such as the name of a method.
    values : array_like, shape (T,)
        Values in the units of the chart; NaN if unknown.
    bands : tuple of Band
        At most two bands: first the outer band, then the inner band, which is darker. The bands of the first curve are
        areas. For other curves, thin lines show the ends of the outer band.
    quantity : str
        Name of the quantity, such as ``mean``, which is the head of its column in the table.
    drawn : {"line", "points", "bars", "dotted", "filled"}
        Style of the curve. Points have no line between them. Bars begin at zero, or at the lower end of a logarithmic
        axis, and are for charts over categories. Dotted lines have a point at each value; filled lines have an area
        down to zero.
    look : Look, optional
        Colour, line and marks. The default depends on the index of the curve.
    columns : tuple of Column
        Further values for the table and the cursor, which are not drawn.
    marks : sequence of tuple of float
        Marked points: places and values.
    strands : Strands, optional
        Thin lines beneath the curve.
    places : array_like, shape (T,), optional
        Positions of the values along the horizontal axis of a plane.
    note : str
        Text in a legend after the name of the curve.

    Examples
    --------
    >>> Curve("measured", [0.0, 1.0], (Band("accuracy of the sensor", [-0.1, 0.9], [0.1, 1.1]),)).bands[0].name
    'accuracy of the sensor'
    """

    name: str
    values: ArrayLike
    bands: tuple[Band, ...] = ()
    quantity: str = "value"
    drawn: Literal["line", "points", "bars", "dotted", "filled"] = "line"
    look: Look | None = None
    columns: tuple[Column, ...] = ()
    marks: Sequence[tuple[float, float]] = ()
    strands: Strands | None = None
    places: ArrayLike | None = None
    note: str = ""

    @typechecked
    def at(self, places: Index) -> Curve:
        """Return the curve at a selection of its times.

        Raises
        ------
        uqmbd.StudyError
            If there is no such time.
        """
        count = len(np.asarray(self.values))
        if places.ndim != 1 or ((places < -count) | (places >= count)).any():
            raise StudyError(f"Curve.at: places is {shown(places)}; expected whole numbers from 0 to {count - 1}.")
        bands = tuple(replace(b, low=np.asarray(b.low)[places], high=np.asarray(b.high)[places]) for b in self.bands)
        columns = tuple(replace(column, values=np.asarray(column.values)[places]) for column in self.columns)
        return replace(self, values=np.asarray(self.values)[places], bands=bands, columns=columns)


@dataclass(frozen=True)
class Axis:
    """A horizontal axis.

    ``units`` are typeset. ``ends`` are the ends of the axis (default: ends of the places). ``whole`` states whether its
    numbers are integers. ``before`` is the text before the number of a place, and ``place_units`` are the units after
    this number (default: units of the axis). ``texts`` are names of the places, and ticks of the axis if they are
    ``categories``.
    """

    name: str
    units: str = ""
    ends: tuple[float, float] | None = None
    log: bool = False
    whole: bool = False
    before: str = ""
    place_units: str | None = None
    texts: tuple[str, ...] = ()
    categories: bool = False


@dataclass(frozen=True, eq=False)
class Boxes:
    """Boxes in a plane, from ``left`` to ``right`` (B,), with the height of the band of the only curve.

    ``shade`` (B,) are the values that the shade of each box represents. ``ends`` are the values of the palest and the
    darkest shade, on a linear or logarithmic scale. A ``grid`` (paper only) has values (rows, columns) of equal cells;
    ``left`` contains its left and right end, and ``right`` its bottom and top end.
    """

    name: str
    units: str
    left: NDArray[np.float64]
    right: NDArray[np.float64]
    shade: NDArray[np.float64]
    ends: tuple[float, float]
    log: bool
    grid: bool = False


@dataclass(frozen=True, eq=False)
class Span:
    """Intervals (R, 2) of the horizontal axis without information, which are shaded (Matplotlib only)."""

    name: str
    runs: NDArray[np.float64]


@typechecked(values=False)
@dataclass(frozen=True)
class Chart:
    """One of several charts of a figure: curves over time, over another quantity, or over categories.

    Attributes
    ----------
    name : str
        Name of the drawn quantity, on the vertical axis.
    places : array_like, shape (T,), or sequence of str
        Positions along the horizontal axis: increasing times, s; non-decreasing numbers of another quantity; or names
        of categories.
    curves : sequence of Curve
        One or more curves with unique names.
    title : str
        Text of the button that selects this chart.
    units : str
        Units of all curves, written like units of outputs.
    across : str
        Quantity of the horizontal axis; empty: time, which charts share, or categories.
    across_units : str
        Units of the quantity of the horizontal axis.
    ends : tuple of float, optional
        Ends of the vertical axis; default: ends of the drawn data.
    log : bool
        Whether the vertical axis is logarithmic; this requires `ends`.
    limits : mapping of str to float
        Drawn levels, by name.
    references : mapping of str to float
        Levels for comparison, by name, which are not limits.
    axis : str
        Name of the vertical axis, if it is shorter than the name of the quantity.
    along : Axis, optional
        Complete horizontal axis, which replaces ``across``.
    plane : Axis, optional
        Horizontal axis of curves with separate places. The places of the chart are then positions of a cursor along the
        curves.
    boxes : Boxes, optional
        Boxes in the plane of the only curve.
    spans : tuple of Span
        Intervals without information.
    start : int, optional
        Initial place of the cursor; default: the place of the widest outer band of the first curve.
    count : int, optional
        Number of places; default: number of given places.
    digits : bool
        Whether two digits of the values are sufficient, as for errors.
    decimals : int, optional
        Digits after the point of the values.
    hidden : bool
        Whether heights have no meaning, so that the vertical axis has no numbers.
    short : bool
        Whether seven digits of the values are sufficient, as for estimates.
    follows : bool
        Whether the chart may show the value of the surrogate of the page at the chosen inputs.
    stacked : bool
        Whether the bands of all curves are stacked areas without lines.
    heading : str
        Text above the chart (Matplotlib).
    words : str
        Text in a chart without visible data (Matplotlib).

    Examples
    --------
    >>> Chart("error", ["coarse", "fine"], [Curve("mine", [2.0, 0.1], drawn="bars")], "by mesh", "%", "mesh").title
    'by mesh'
    """

    name: str
    places: ArrayLike | Sequence[str]
    curves: Sequence[Curve]
    title: str = ""
    units: str = "1"
    across: str = ""
    across_units: str = "1"
    ends: tuple[float, float] | None = None
    log: bool = False
    limits: Mapping[str, float] = field(default_factory=dict)
    references: Mapping[str, float] = field(default_factory=dict)
    axis: str = ""
    along: Axis | None = None
    plane: Axis | None = None
    boxes: Boxes | None = None
    spans: tuple[Span, ...] = ()
    start: int | None = None
    count: int | None = None
    digits: bool = False
    decimals: int | None = None
    hidden: bool = False
    short: bool = False
    follows: bool = False
    stacked: bool = False
    heading: str = ""
    words: str = ""


@dataclass(frozen=True)
class Views:
    """Charts of one figure: a page shows one chart at a time, Matplotlib draws all charts.

    ``choose`` is the label of the buttons, and ``seen`` the index of the first visible chart. ``columns`` is the number
    of columns on paper, and ``heights`` are the heights of its rows, inches. ``shared`` states whether charts in a
    column on paper share their horizontal axis.
    """

    charts: Sequence[Chart]
    choose: str = "Chart"
    seen: int = 0
    columns: int = 2
    shared: bool = False
    heights: tuple[float, ...] = ()


TIME = Axis("time", "s")


def axis_of(chart: Chart) -> Axis:
    """Return the horizontal axis of a chart."""
    if chart.along is not None:
        return chart.along
    if not chart.across:
        return TIME
    return Axis(chart.across, typeset_units(chart.across_units))


def several(chart: Chart) -> bool:
    """Return whether a chart has two or more places, or needs only one (categories, planes, boxes)."""
    along = chart.along
    without_line = along is not None and (along.categories or chart.plane is not None or chart.boxes is not None)
    return without_line or len(np.asarray(chart.places)) > 1


def painted(curve: Curve, k: int, count: int) -> tuple[tuple[str, str], tuple[float, ...], float]:
    """Return the colours (light and dark page), dashes and width of the k-th curve."""
    look = curve.look or Look()
    number = look.colour if isinstance(look.colour, int) else k
    named = ROLES | {"quiet": QUIET}
    series = COLOURS[number % len(COLOURS)], ON_DARK[number % len(COLOURS)]
    colours = named[look.colour] if isinstance(look.colour, str) else series
    line = LINES[number % len(LINES)]
    dash = look.dash if look.dash is not None else () if line == "-" else line[1]
    return colours, dash, look.width or line_width(k, count)
