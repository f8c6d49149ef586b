"""Charts of a plugin's own data, for its section of the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.errors import StudyError
from uqmbd.report.drawing import image_html
from uqmbd.report.figures import Curve, checked
from uqmbd.report.live.chart_data import curves_data
from uqmbd.report.live.packing import json_script
from uqmbd.report.live.still import still_chart
from uqmbd.typing import Array
from uqmbd.wording import typeset_units

__all__ = ["Chart", "chart_html", "charts_html"]


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

    Examples
    --------
    >>> Chart("error", ["coarse", "fine"], [Curve("mine", [2.0, 0.1], drawn="bars")], "by mesh", "%", "mesh").title
    'by mesh'
    """

    name: str
    places: ArrayLike | Sequence[str]
    curves: Sequence[Curve]
    title: str
    units: str = "1"
    across: str = ""
    across_units: str = "1"
    ends: tuple[float, float] | None = None
    log: bool = False
    limits: Mapping[str, float] = field(default_factory=dict)

    def data(self) -> dict[str, Any]:
        """Return the data of the page.

        Raises
        ------
        StudyError
            If its parts do not fit together.
        """
        where = f"chart {self.name!r}"
        texts = {"title": self.title, "units": self.units, "across": self.across, "across_units": self.across_units}
        if wrong := [f"{key} is {value!r}" for key, value in texts.items() if not isinstance(value, str)]:
            raise StudyError(f"{where}: {', '.join(wrong)}; expected a text.")
        names = self._categories()
        places = np.arange(1.0, len(names) + 1) if names else self.places
        axis = self.across or ("category" if names else "")
        moments, found = checked(self.name, places, self.curves, axis, categories=bool(names))
        if not isinstance(self.limits, Mapping) or not all(map(_finite, self.limits.values())):
            raise StudyError(f"{where}: limits is {self.limits!r}; expected finite numbers by their names.")
        if self.ends is not None and not (
            len(self.ends) == 2 and all(map(_finite, self.ends)) and self.ends[0] < self.ends[1]
        ):
            raise StudyError(f"{where}: ends is {self.ends!r}; expected two finite numbers that increase.")
        if self.log and (self.ends is None or self.ends[0] <= 0):
            raise StudyError(f"{where}: a logarithmic axis has ends {self.ends}; expected two above zero.")
        data, _ = curves_data(self.name, moments, found, self.units)
        data["title"] = self.title
        data["limits"] = [{"name": name, "value": float(value)} for name, value in self.limits.items()]
        if self.ends is not None:
            data["up"] = {"low": float(self.ends[0]), "high": float(self.ends[1])} | ({"log": True} if self.log else {})
        if axis:
            units = typeset_units(self.across_units)
            data["across"] = {"name": axis, "units": units, "told": units, "ends": _ends(moments)}
        if names:
            data["across"] |= {"categories": True, "texts": names, "whole": True, "ends": [0.5, len(names) + 0.5]}
        return data

    def _categories(self) -> list[str]:
        """Return the names of categories; none where the places are numbers."""
        if isinstance(self.places, str):
            raise StudyError(f"chart {self.name!r}: places is the text {self.places!r}; expected a list of names.")
        given = self.places.tolist() if isinstance(self.places, np.ndarray) else self.places
        every = list(given) if isinstance(given, Sequence) else []
        named = [isinstance(one, str) for one in every]
        if any(named) and not all(named):
            raise StudyError(f"chart {self.name!r}: places is {every!r:.80}; expected names or numbers, not both.")
        return list(map(str, every)) if any(named) else []


def _finite(value: object) -> bool:
    return isinstance(value, (int, float, np.number)) and bool(np.isfinite(value))


def _ends(places: Array) -> list[float]:
    low, high = float(places[0]), float(places[-1])
    room = 0.02 * (high - low) or 0.5 * abs(low) or 0.5
    return [low - room, high + room]


def charts_html(charts: Sequence[Chart], alt: str, caption: str, *, choose: str = "Chart") -> str:
    """Return charts of which one is seen at a time, for a section of the report, as HTML.

    They are what `chart_html` says, along any axis; buttons with their titles choose. Without scripts a note stands
    there. On paper all of them are drawn. All texts are plain text, and are escaped here.

    Parameters
    ----------
    charts : sequence of Chart
        One or more; the first is seen first.
    alt, caption : str
        What stands for the figure, and beneath it.
    choose : str
        What the buttons choose.

    Returns
    -------
    str
        A fragment of HTML.

    Raises
    ------
    StudyError
        If the parts of a chart do not fit together.

    Examples
    --------
    >>> from uqmbd.report import Chart, Curve
    >>> bars = Chart("error", ["coarse", "fine"], [Curve("mine", [2.0, 0.1], drawn="bars")], "by mesh", "%", "mesh")
    >>> charts_html([bars], "Errors by mesh.", "The finer the better.").startswith('<figure class="charted"')
    True
    """
    if isinstance(charts, Chart) or not charts or not all(isinstance(one, Chart) for one in charts):
        raise StudyError(
            f"charts_html: charts is {charts!r:.80}; expected a sequence of one or more uqmbd.report.Chart."
        )
    titles = [chart.title for chart in charts]
    if len(set(titles)) < len(titles):
        raise StudyError(f"charts_html: the charts have the titles {titles}; expected a title of its own for each.")
    views = [chart.data() for chart in charts]
    shown = {"source": "", "alt": alt, "caption": caption, "problem": ""}
    return image_html(shown, json_script({"choose": choose, "seen": 0, "views": views}))


def chart_html(
    name: str, times: ArrayLike, curves: Sequence[Curve], alt: str, caption: str, *, units: str = "1"
) -> str:
    """Return a chart over time for a section of the report, as HTML.

    Where scripts run the page draws it like its own charts: it zooms, tells values, has the time of the page, switches
    curves on and off, and saves numbers and pictures. Else a figure of the same curves stands there. All texts are
    plain text, and are escaped here.

    Parameters
    ----------
    name : str
        What is drawn: that of the vertical axis.
    times : array_like, shape (T,)
        Two or more, increasing, s. Of more than 1000 those are in the page that have the peaks of each curve.
    curves : sequence of Curve
        One or more, with names of their own; at most six have colours of their own.
    alt, caption : str
        What stands for the figure, and beneath the chart.
    units : str
        Of all curves, as those of outputs are written: ``N*m``.

    Returns
    -------
    str
        A fragment of HTML.

    Raises
    ------
    StudyError
        If times and curves do not fit together.

    See Also
    --------
    figure_html : A figure of any kind, without a chart.

    Examples
    --------
    >>> import numpy as np
    >>> from uqmbd.report import Band, Curve
    >>> times = np.linspace(0, 1, 11)
    >>> force = Curve("measured", 9.81 * times, (Band("accuracy", 9 * times, 10 * times),))
    >>> html = chart_html("force", times, [force], "A force that grows.", "It grows.", units="N")
    >>> html.count('<figure class="charted">'), html.count("<img "), html.count('<script type="application/json">')
    (1, 1, 1)
    """
    moments, found = checked(name, times, curves)
    data, _ = curves_data(name, moments, found, units)
    shown = {"source": still_chart(data).source(), "alt": alt, "caption": caption, "problem": ""}
    return image_html(shown, json_script(data))
