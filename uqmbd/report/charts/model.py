"""What a chart is, as plain data: curves with bands and points along an axis, or in a plane; boxes; levels; words.

It knows neither a page nor paper: `page` and `paper` draw it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uqmbd.report.drawing import COLOURS, LINES, ON_DARK, ROLES, line_width
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
"""Shapes of points, by the letters that Matplotlib has for them: no two look alike without colour."""

QUIET = ("#8a8f96", "#7d868f")
"""Colours of what stands for several things, on a light and on a dark page."""


@dataclass(frozen=True)
class Band:
    """A band between two curves.

    Attributes
    ----------
    name : str
        What lies in it, such as ``95 % of realisations``.
    low, high : array_like, shape (T,)
        Its ends, in the units of the chart; NaN: unknown then.
    bars : bool
        Whether it is a range at each place, drawn as a bar, and not an area.

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
    """How a curve is drawn, where this does not follow from its place among the curves of its chart.

    ``colour``: the k-th of the series of colours, or the name of a role; ``dash``: lengths on and off, in widths of the
    line; ``width``: points; ``shape``: of a mark at each point, a key of ``MARKS``; ``size``: of marks, pixels;
    ``joined``: whether a line goes through marks; ``quiet``: context that the cursor passes over.
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
    """What the table of values shows of a curve, and nobody draws: numbers, or names, one for each place.

    ``units``: None: those of the chart; ``digits``: whether two digits are enough, as of an error.
    """

    name: str
    values: ArrayLike | Sequence[str]
    units: str | None = None
    digits: bool = False


@dataclass(frozen=True, eq=False)
class Strands:
    """Thin lines beneath a curve, such as single realisations: ``across`` and ``up`` (N, K).

    In a plane ``at`` names the places (K,) of the cursor at which their points are.
    """

    name: str
    across: NDArray[np.float64]
    up: NDArray[np.float64]
    at: NDArray[np.intp] | None = None


@dataclass(frozen=True)
class Curve:
    """A line over time, which a chart can switch off, with bands about it.

    Attributes
    ----------
    name : str
        Its name in the chart, such as that of a method.
    values : array_like, shape (T,)
        In the units of the chart; NaN: unknown then.
    bands : tuple of Band
        Two at most: the outer one first, the inner one is drawn darker. Of the first curve bands are areas, of others
        the ends of the outer band are thin lines.
    quantity : str
        What the values are, such as ``mean``: the head of their column in the table.
    drawn : {"line", "points", "bars", "dotted", "filled"}
        How: points have no line between them, and bars stand on zero, or on the lower end of a logarithmic axis; bars
        are for charts over categories. Dotted lines have a point at each value, filled ones an area down to zero.
    look : Look, optional
        Colour, line and marks; default: those of its place among the curves.
    columns : tuple of Column
        Further values for the table and the cursor, which are not drawn.
    marks : sequence of tuple of float
        Places and values that are marked.
    strands : Strands, optional
        Thin lines beneath.
    places : array_like, shape (T,), optional
        Where its values are along the horizontal axis of a plane.
    note : str
        What a legend says after its name.

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

    def at(self, places: NDArray[np.intp]) -> Curve:
        """Return the curve at some of its times only."""
        bands = tuple(replace(b, low=np.asarray(b.low)[places], high=np.asarray(b.high)[places]) for b in self.bands)
        columns = tuple(replace(column, values=np.asarray(column.values)[places]) for column in self.columns)
        return replace(self, values=np.asarray(self.values)[places], bands=bands, columns=columns)


@dataclass(frozen=True)
class Axis:
    """A horizontal axis.

    ``units`` are typeset; ``ends``: where it ends (default: with the places); ``whole``: whether its numbers are whole;
    ``before``: what stands before the number of a place, and ``told``: its units there (default: those of the axis);
    ``texts``: names of the places, which are its ticks if they are ``categories``.
    """

    name: str
    units: str = ""
    ends: tuple[float, float] | None = None
    log: bool = False
    whole: bool = False
    before: str = ""
    told: str | None = None
    texts: tuple[str, ...] = ()
    categories: bool = False


@dataclass(frozen=True, eq=False)
class Boxes:
    """Boxes in a plane, shaded by a value (B,): from ``left`` to ``right``, up and down the band of the only curve.

    ``ends``: values of the palest and the darkest shade, on a logarithmic scale or not. Of a ``grid`` (paper only) the
    values are (rows, columns) of equal cells, ``left`` and ``right`` its four ends: left, right, and bottom, top.
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
    """Runs (R, 2) along the horizontal axis that are covered, as they say nothing (paper only)."""

    name: str
    runs: NDArray[np.float64]


@dataclass(frozen=True)
class Chart:
    """One of several charts of a figure: curves over time, over another quantity, or over categories.

    Attributes
    ----------
    name : str
        What is drawn: that of the vertical axis.
    places : array_like, shape (T,), or sequence of str
        Along the horizontal axis: times in s, which increase; numbers of another quantity, which do not decrease; or
        the names of categories.
    curves : sequence of Curve
        One or more, with names of their own.
    title : str
        On the button that chooses this chart.
    units : str
        Of all curves, as those of outputs are written.
    across : str
        The quantity of the horizontal axis; empty: time, which charts share, or categories.
    across_units : str
        Of that quantity.
    ends : tuple of float, optional
        Between which values the vertical axis ends; default: those of what is drawn.
    log : bool
        Whether the vertical axis is logarithmic; it needs ends.
    limits : mapping of str to float
        Levels that are drawn, by what they are called.
    references : mapping of str to float
        Levels to compare with, which limit nothing.
    axis : str
        The name of the vertical axis, where it is shorter than what is drawn.
    along : Axis, optional
        The horizontal axis in full, in place of ``across``.
    plane : Axis, optional
        The horizontal axis of curves with places of their own; the places of the chart are those of a cursor along
        the curves.
    boxes : Boxes, optional
        In the plane of the only curve.
    spans : tuple of Span
        What is covered.
    start : int, optional
        Place at which the cursor begins; default: where the outer band of the first curve is widest.
    count : int, optional
        How many places there are; default: as many as are given.
    digits : bool
        Whether two digits of the values are enough, as of errors.
    decimals : int, optional
        Digits after the point of the values.
    hidden : bool
        Whether heights mean nothing: the vertical axis has no numbers.
    short : bool
        Whether seven digits of the values are enough, as of estimates.
    follows : bool
        Whether the surrogate of the page may be of this output.
    stacked : bool
        Whether the bands of all curves are areas, one on another, and there are no lines.
    heading : str
        What stands above the chart on paper.
    words : str
        What stands in the chart on paper where there is nothing to see.

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
    """Charts of one figure: on a page one is seen at a time, on paper all of them are.

    ``choose``: what the buttons choose; ``seen``: which is first; ``columns``: on paper; ``shared``: whether the charts
    above one another on paper share their horizontal axis; ``heights``: of the rows there, inches.
    """

    charts: Sequence[Chart]
    choose: str = "Chart"
    seen: int = 0
    columns: int = 2
    shared: bool = False
    heights: tuple[float, ...] = ()


TIME = Axis("time", "s")


def axis_of(chart: Chart) -> Axis:
    """Return what the horizontal axis of the places is."""
    if chart.along is not None:
        return chart.along
    if not chart.across:
        return TIME
    return Axis(chart.across, typeset_units(chart.across_units))


def several(chart: Chart) -> bool:
    """Return whether a chart has places that a line joins, or needs none."""
    along = chart.along
    standing = along is not None and (along.categories or chart.plane is not None or chart.boxes is not None)
    return standing or len(np.asarray(chart.places)) > 1


def painted(curve: Curve, k: int, count: int) -> tuple[tuple[str, str], tuple[float, ...], float]:
    """Return the colours (on a light and on a dark page), dashes and width of the k-th of some curves."""
    look = curve.look or Look()
    number = look.colour if isinstance(look.colour, int) else k
    named = ROLES | {"quiet": QUIET}
    series = COLOURS[number % len(COLOURS)], ON_DARK[number % len(COLOURS)]
    colours = named[look.colour] if isinstance(look.colour, str) else series
    line = LINES[number % len(LINES)]
    dash = look.dash if look.dash is not None else () if line == "-" else line[1]
    return colours, dash, look.width or line_width(k, count)
