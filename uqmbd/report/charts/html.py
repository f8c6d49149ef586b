"""HTML of charts: data, a still picture for pages without scripts, and the figure for a file."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.report.charts.checks import checked_chart
from uqmbd.report.charts.model import Chart, Curve, Views
from uqmbd.report.charts.page import chart_script, json_script, page_data, thinned_chart
from uqmbd.report.charts.paper import draw_on_paper
from uqmbd.report.drawing import drawn_source, image_html

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["chart_figure", "chart_html", "charted", "charts_html", "still_html"]

NOTHING_TO_DRAW = "Not drawn, because the output does not vary or has fewer than two values: "
"""Text in place of a chart without data, before its caption."""

SMALL = 300
"""Number of places of a chart in a picture of the first screen."""

Shown = Chart | Views


def charted(
    given: Shown | Callable[[], Shown | None],
    alt: str,
    caption: str,
    name: str,
    *,
    on_paper: Callable[[], Shown] | None = None,
    still: bool = False,
) -> dict[str, Any]:
    """Return the HTML of a chart; a note replaces a chart that has no data or cannot be drawn.

    ``name`` is the name of the file of the figure, if files are requested. ``on_paper`` returns the content of this
    figure, if it differs from the chart. ``still`` requests a picture that is visible if scripts do not run.
    """
    found: dict[str, Any] = {"source": "", "alt": alt, "caption": caption, "problem": "", "name": name}
    try:
        shown = given() if callable(given) else given
        data = chart_script(shown)
    except Exception as error:  # noqa: BLE001 - results of other packages may be invalid in any way; the tables must remain
        return found | {"problem": f"{type(error).__name__}: {error}"}
    if shown is not None:
        found["draw"] = lambda: draw_on_paper(shown if on_paper is None else on_paper())
        if still and data is not None:
            # if the picture fails, a sentence refers to the tables instead
            with contextlib.suppress(Exception):
                found["source"] = drawn_source(lambda: draw_on_paper(_coarse(shown)))
    return found | ({"note": f"{NOTHING_TO_DRAW}{caption}"} if data is None else {"chart": data})


def _coarse(shown: Shown) -> Shown:
    """Reduce charts to the number of places of a small picture; peaks remain."""
    if isinstance(shown, Views):
        return replace(shown, charts=[thinned_chart(chart, SMALL)[0] for chart in shown.charts])
    return thinned_chart(shown, SMALL)[0]


def still_html(shown: Shown, alt: str, caption: str) -> str:
    """Return the HTML of a chart with a still picture, which is visible if no script runs."""
    source = drawn_source(lambda: draw_on_paper(shown))
    return image_html({"source": source, "alt": alt, "caption": caption, "problem": ""}, json_script(page_data(shown)))


@typechecked
def chart_figure(*charts: Chart) -> Figure:
    """Draw the charts of `charts_html` as a Matplotlib figure.

    Parameters
    ----------
    *charts : Chart
        One or more charts.

    Returns
    -------
    matplotlib.figure.Figure
        Figure with axes for each chart, in two columns if there are several.

    Raises
    ------
    StudyError
        If the parts of a chart do not fit together.

    Examples
    --------
    >>> from uqmbd.report import Chart, Curve
    >>> bars = Chart("error", ["coarse", "fine"], [Curve("mine", [2.0, 0.1], drawn="bars")], "by mesh", "%", "mesh")
    >>> chart_figure(bars).axes[0].get_ylabel()
    'error [%]'
    """
    if not charts or not all(isinstance(one, Chart) for one in charts):
        raise StudyError(f"chart_figure: charts is {charts!r:.80}; expected one or more uqmbd.report.Chart.")
    found = [checked_chart(chart) for chart in charts]
    return draw_on_paper(found[0] if len(found) == 1 else Views(found))


@typechecked
def charts_html(charts: Sequence[Chart], alt: str, caption: str, *, choose: str = "Chart") -> str:
    """Return the HTML of charts for a section of the report; buttons select the visible one.

    The charts have the properties of `chart_html`, along any axis. The buttons contain their titles. Print, and pages
    without scripts, show all charts. All texts are plain text, and this function escapes them.

    Parameters
    ----------
    charts : sequence of Chart
        One or more charts; the first chart is initially visible.
    alt, caption : str
        Alternative text of the figure, and its caption.
    choose : str
        Label of the choice that the buttons offer.

    Returns
    -------
    str
        HTML fragment.

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
    if not isinstance(charts, Sequence) or not charts or not all(isinstance(one, Chart) for one in charts):
        raise StudyError(
            f"charts_html: charts is {charts!r:.80}; expected a sequence of one or more uqmbd.report.Chart."
        )
    titles = [chart.title for chart in charts]
    if len(set(titles)) < len(titles):
        raise StudyError(f"charts_html: the charts have the titles {titles}; expected a different title for each.")
    return still_html(Views([checked_chart(chart) for chart in charts], choose), alt, caption)


@typechecked
def chart_html(
    name: str, times: ArrayLike, curves: Sequence[Curve], alt: str, caption: str, *, units: str = "1"
) -> str:
    """Return a chart over time for a section of the report, as HTML.

    If scripts run, the page draws the chart like other charts of the report. The reader can zoom, read values, use the
    time of the page, switch curves on and off, and save numbers and pictures. Otherwise the page shows a figure of the
    same curves. All texts are plain text, and this function escapes them.

    Parameters
    ----------
    name : str
        Name of the drawn quantity, on the vertical axis.
    times : array_like, shape (T,)
        Two or more increasing times, s. Of more than 1000 times, the page contains a selection with the peaks of each
        curve.
    curves : sequence of Curve
        One or more curves with unique names; at most six curves have unique colours.
    alt, caption : str
        Alternative text of the figure, and caption of the chart.
    units : str
        Units of all curves, written like units of outputs: ``N*m``.

    Returns
    -------
    str
        HTML fragment.

    Raises
    ------
    StudyError
        If times and curves are inconsistent.

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
    return still_html(checked_chart(Chart(name, times, curves, units=units)), alt, caption)
