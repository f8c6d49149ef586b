"""Figures of results, and a self-contained HTML report."""

from __future__ import annotations

import warnings
from typing import Any

from uqmbd.report.charts import Band, Chart, Curve, chart_figure, chart_html, charts_html
from uqmbd.report.drawing import arrange, axes_grid, figure_html, series_style, with_units, wrapped
from uqmbd.report.figures import (
    bands,
    coefficient_decay,
    convergence,
    differences,
    error_cost,
    event_times,
    failure_inputs,
    histograms,
    inputs,
    order_convergence,
    over_output,
    scalar_densities,
    sobol_indices,
    split_pattern,
    std_over_time,
    time_history_histogram,
    verification,
    violated_by,
)
from uqmbd.report.html import write_report
from uqmbd.report.installed import installed_sections
from uqmbd.report.live import with_poses
from uqmbd.report.mechanisms import animate, mechanism, motion, poses, with_motion
from uqmbd.report.notebook import Shown, load_ipython_extension, show, unload_ipython_extension
from uqmbd.report.sections import ChartGroup, FirstScreen, ReliabilityStatement, Section

__all__ = [
    "Band",
    "Chart",
    "ChartGroup",
    "Curve",
    "FirstScreen",
    "Section",
    "Shown",
    "ReliabilityStatement",
    "animate",
    "arrange",
    "axes_grid",
    "bands",
    "chart_figure",
    "chart_html",
    "charts_html",
    "coefficient_decay",
    "convergence",
    "differences",
    "error_cost",
    "event_times",
    "failure_inputs",
    "figure_html",
    "histograms",
    "inputs",
    "installed_sections",
    "load_ipython_extension",
    "mechanism",
    "motion",
    "order_convergence",
    "over_output",
    "poses",
    "scalar_densities",
    "show",
    "sobol_indices",
    "split_pattern",
    "std_over_time",
    "series_style",
    "time_history_histogram",
    "unload_ipython_extension",
    "verification",
    "violated_by",
    "with_motion",
    "with_poses",
    "with_units",
    "wrapped",
    "write_report",
]


def __getattr__(name: str) -> Any:
    """Return an object by its old name, with a deprecation warning, until version 0.2."""
    if name != "style":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    text = "uqmbd.report.style is uqmbd.report.series_style now; the old name is removed in version 0.2."
    warnings.warn(text, DeprecationWarning, stacklevel=2)
    return series_style
