"""Charts as plain data, which scripts draw on a page and Matplotlib draws in files."""

from __future__ import annotations

from uqmbd.report.charts.arrays import Kind, packed, packed_relative, packed_within, share_arrays, unpacked
from uqmbd.report.charts.checks import checked_chart
from uqmbd.report.charts.html import chart_figure, chart_html, charted, charts_html, still_html
from uqmbd.report.charts.model import (
    MARKS,
    Axis,
    Band,
    Boxes,
    Chart,
    Column,
    Curve,
    Look,
    Span,
    Strands,
    Views,
    several,
)
from uqmbd.report.charts.page import MOST_TIMES, chart_script, json_script, page_data, thinned
from uqmbd.report.charts.paper import draw_on_paper

__all__ = [
    "MARKS",
    "MOST_TIMES",
    "Axis",
    "Band",
    "Boxes",
    "Chart",
    "Column",
    "Curve",
    "Kind",
    "Look",
    "Span",
    "Strands",
    "Views",
    "chart_figure",
    "chart_html",
    "chart_script",
    "charted",
    "charts_html",
    "checked_chart",
    "json_script",
    "packed",
    "packed_relative",
    "packed_within",
    "page_data",
    "draw_on_paper",
    "several",
    "share_arrays",
    "still_html",
    "thinned",
    "unpacked",
]
