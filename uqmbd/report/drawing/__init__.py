"""How figures look, and how they become images."""

from __future__ import annotations

from uqmbd.report.drawing.images import CHARTED, charted, figure_html, image, image_html, svg, write_images
from uqmbd.report.drawing.scales import decades, log_axis
from uqmbd.report.drawing.style import (
    COLOURS,
    FAILED,
    WIDTH,
    arrange,
    axes_grid,
    constant,
    draw_histogram,
    few_ticks,
    finish_single,
    histogram,
    limit_times,
    line_width,
    shortened,
    single_axes,
    style,
    surroundings,
    widen_if_constant,
    with_units,
    wrapped,
)

__all__ = [
    "CHARTED",
    "COLOURS",
    "FAILED",
    "WIDTH",
    "arrange",
    "axes_grid",
    "charted",
    "constant",
    "decades",
    "draw_histogram",
    "few_ticks",
    "histogram",
    "finish_single",
    "figure_html",
    "image",
    "image_html",
    "limit_times",
    "line_width",
    "log_axis",
    "shortened",
    "single_axes",
    "style",
    "surroundings",
    "svg",
    "widen_if_constant",
    "with_units",
    "wrapped",
    "write_images",
]
