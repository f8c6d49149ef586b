"""Charts in a page: their data, with a picture where no script runs, and the figure for a file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.report.charts.checks import checked_chart
from uqmbd.report.charts.model import Chart, Curve, Views
from uqmbd.report.charts.page import chart_script, json_script, page_data
from uqmbd.report.charts.paper import draw_on_paper
from uqmbd.report.drawing import drawn_source, image_html

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["chart_figure", "chart_html", "charted", "charts_html", "still_html"]

NOTHING_TO_DRAW = "Not drawn, because the output does not vary or has fewer than two values: "
"""What stands in place of a chart without data, before its caption."""

Shown = Chart | Views


def charted(
    given: Shown | Callable[[], Shown | None],
    alt: str,
    caption: str,
    name: str,
    *,
    on_paper: Callable[[], Shown] | None = None,
) -> dict[str, Any]:
    """Return a chart of the page; where it has no data, or these cannot be made, a note stands.

    ``name``: of the file with its figure, if that is asked for; ``on_paper``: what is drawn there, if it is more.
    """
    found: dict[str, Any] = {"source": "", "alt": alt, "caption": caption, "problem": "", "name": name}
    try:
        shown = given() if callable(given) else given
        data = chart_script(shown)
    except Exception as error:  # noqa: BLE001 - results of other packages may hold surprises; the tables must stand
        return found | {"problem": f"{type(error).__name__}: {error}"}
    if shown is not None:
        found["draw"] = lambda: draw_on_paper(shown if on_paper is None else on_paper())
    return found | ({"note": f"{NOTHING_TO_DRAW}{caption}"} if data is None else {"chart": data})


def still_html(shown: Shown, alt: str, caption: str) -> str:
    """Return a chart with its picture, which stands where no script runs."""
    source = drawn_source(lambda: draw_on_paper(shown))
    return image_html({"source": source, "alt": alt, "caption": caption, "problem": ""}, json_script(page_data(shown)))


@typechecked
def chart_figure(*charts: Chart) -> Figure:
    """Draw charts as a figure: what `charts_html` shows on a page, for files and papers.

    Parameters
    ----------
    *charts : Chart
        One or more.

    Returns
    -------
    matplotlib.figure.Figure
        With axes for each chart, in two columns if there are several.

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
    """Return charts of which one is seen at a time, for a section of the report, as HTML.

    They are what `chart_html` says, along any axis; buttons with their titles choose. Without scripts a figure
    of all charts stands there. On paper all of them are drawn. All texts are plain text, and are escaped here.

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
    return still_html(checked_chart(Chart(name, times, curves, units=units)), alt, caption)
