"""A chart of a plugin's own data, for its section of the report."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from uqmbd.report.drawing import image_html
from uqmbd.report.figures import Curve, checked
from uqmbd.report.live.chart_data import curves_data
from uqmbd.report.live.packing import json_script
from uqmbd.report.live.still import still_chart

__all__ = ["chart_html"]


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
