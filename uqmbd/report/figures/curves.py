"""Curves over time with bands about them: what charts and their figures are drawn from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uqmbd.errors import StudyError
from uqmbd.report.drawing import line_width, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Band", "Curve", "checked", "draw_curve"]

_Array = NDArray[np.float64]


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
    drawn : {"line", "points", "bars"}
        How: points have no line between them, and bars stand on zero, or on the lower end of a logarithmic axis; bars
        are for charts over categories.

    Examples
    --------
    >>> Curve("measured", [0.0, 1.0], (Band("accuracy of the sensor", [-0.1, 0.9], [0.1, 1.1]),)).bands[0].name
    'accuracy of the sensor'
    """

    name: str
    values: ArrayLike
    bands: tuple[Band, ...] = ()
    quantity: str = "value"
    drawn: Literal["line", "points", "bars"] = "line"

    def at(self, places: NDArray[np.intp]) -> Curve:
        """Return the curve at some of its times only."""
        bands = tuple(replace(b, low=np.asarray(b.low)[places], high=np.asarray(b.high)[places]) for b in self.bands)
        return replace(self, values=np.asarray(self.values)[places], bands=bands)


def checked(
    name: str, times: ArrayLike, given: Sequence[Curve], axis: str = "", *, categories: bool = False
) -> tuple[_Array, list[Curve]]:
    """Return the times and curves of a chart as arrays; of another axis places may be equal, and one is enough.

    Bars are for categories: they are as wide as these are apart.

    Raises
    ------
    StudyError
        If they do not fit together; the message says which.
    """
    where = f"chart {name!r}"
    if not isinstance(name, str):
        raise StudyError(f"{where}: its name is a {type(name).__name__}; expected a text.")
    moments = _numbers(f"{where}: times", times)
    numbers = moments.ndim == 1 and bool(np.isfinite(moments).all())
    if axis and not (numbers and len(moments) > 0 and np.all(np.diff(moments) >= 0)):
        raise StudyError(
            f"{where}: places of shape {moments.shape} along {axis!r}; expected numbers that do not decrease, or names."
        )
    if not axis and not (numbers and len(moments) > 1 and np.all(np.diff(moments) > 0)):
        raise StudyError(f"{where}: times of shape {moments.shape}; expected two or more, finite and increasing, in s.")
    if isinstance(given, Curve) or not given or not all(isinstance(curve, Curve) for curve in given):
        raise StudyError(f"{where}: curves is {given!r:.80}; expected a sequence of one or more uqmbd.report.Curve.")

    def fitting(what: str, values: ArrayLike) -> _Array:
        found = _numbers(f"{where}: {what}", values)
        if found.shape != moments.shape or np.isinf(found).any():
            told = "an infinity; NaN says that a value is unknown" if found.shape == moments.shape else found.shape
            raise StudyError(f"{where}: {what} has {told}; expected numbers of the shape of times, {moments.shape}.")
        return found

    made = []
    for curve in given:
        texts = [curve.name, curve.quantity, *(band.name for band in curve.bands)]
        if not all(isinstance(text, str) for text in texts):
            raise StudyError(f"{where}: the names of a curve and its bands are {texts!r}; expected texts.")
        if curve.drawn not in ("line", "points", "bars"):
            raise StudyError(
                f"{where}: curve {curve.name!r} is drawn as {curve.drawn!r}; expected line, points or bars."
            )
        if curve.drawn == "bars" and not categories:
            raise StudyError(
                f"{where}: curve {curve.name!r} is drawn as bars along numbers; expected names as the places of a "
                "uqmbd.report.Chart, or a curve of points."
            )
        if len(curve.bands) > 2:
            raise StudyError(f"{where}: curve {curve.name!r} has {len(curve.bands)} bands; expected two at most.")
        bands = tuple(
            replace(
                band,
                low=fitting(f"the lower end of {band.name!r} of {curve.name!r}", band.low),
                high=fitting(f"the upper end of {band.name!r} of {curve.name!r}", band.high),
            )
            for band in curve.bands
        )
        made.append(replace(curve, values=fitting(f"curve {curve.name!r}", curve.values), bands=bands))
    names = [curve.name for curve in made]
    if len(set(names)) < len(names):
        raise StudyError(f"{where}: its curves are named {names}; expected a name of its own for each.")
    return moments, made


def _numbers(what: str, values: ArrayLike) -> _Array:
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise StudyError(f"{what}: {error}; expected real numbers.") from error


def draw_curve(axes: Axes, times: _Array, curve: Curve, k: int, count: int) -> tuple[Any, list[Any]]:
    """Draw the k-th of some curves: the line, and of the first one the areas of its bands; return these.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    times : array, shape (T,)
    curve : Curve
    k, count : int
    """
    (colour, line), width = style(k), line_width(k, count)
    areas = []
    if k == 0:
        for opacity, band in zip((0.16, 0.30), curve.bands, strict=False):
            low, high = (np.asarray(edge, dtype=float) for edge in (band.low, band.high))
            areas.append(axes.fill_between(times, low, high, color=colour, alpha=opacity, lw=0))
    else:
        for edge in (band_edge for band in curve.bands[:1] for band_edge in (band.low, band.high)):
            axes.plot(times, np.asarray(edge, dtype=float), color=colour, ls=line, lw=0.6 * width)
    (drawn,) = axes.plot(times, np.asarray(curve.values, dtype=float), color=colour, ls=line, lw=width)
    return drawn, areas
