"""Style of figures, and their conversion to images."""

from __future__ import annotations

from uqmbd.report.drawing.images import CHARTED, drawn_source, figure_html, image_html, still_image, svg, write_images
from uqmbd.report.drawing.scales import across_axis, decades, log_axis
from uqmbd.report.drawing.style import (
    COLOURS,
    FAILED,
    LINES,
    ON_DARK,
    WIDTH,
    arrange,
    axes_grid,
    constant,
    finish_single,
    histogram,
    line_width,
    series_style,
    shortened,
    single_axes,
    surroundings,
    with_units,
    wrapped,
)
from uqmbd.report.drawing.vectors import DARK_STYLE, GROUND, LETTER, PALE, ROLES, Drawing, mixed

__all__ = [
    "CHARTED",
    "COLOURS",
    "DARK_STYLE",
    "FAILED",
    "GROUND",
    "LETTER",
    "LINES",
    "ON_DARK",
    "PALE",
    "ROLES",
    "WIDTH",
    "Drawing",
    "across_axis",
    "arrange",
    "axes_grid",
    "constant",
    "decades",
    "drawn_source",
    "figure_html",
    "finish_single",
    "histogram",
    "image_html",
    "line_width",
    "log_axis",
    "mixed",
    "shortened",
    "single_axes",
    "still_image",
    "series_style",
    "surroundings",
    "svg",
    "with_units",
    "wrapped",
    "write_images",
]
