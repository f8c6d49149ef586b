"""What moves in a report: data for its scripts, and the scripts, which are modules of JavaScript in this folder."""

from __future__ import annotations

from uqmbd.report.live.cell import cell_html
from uqmbd.report.live.chart_data import MOST_TIMES, bands_data
from uqmbd.report.live.convergence_charts import decay_data, errors_data, orders_data, settling_data
from uqmbd.report.live.curve_chart import Chart, chart_html, charts_html
from uqmbd.report.live.distribution_charts import densities_data, events_data, inputs_data, scalars_data
from uqmbd.report.live.element_charts import elements_data
from uqmbd.report.live.explorer_data import explorer_data
from uqmbd.report.live.mark_charts import error_cost_data, failures_data, over_data
from uqmbd.report.live.packing import json_script, packed, unpacked
from uqmbd.report.live.page import PageScripts, page_scripts
from uqmbd.report.live.player_data import player_data
from uqmbd.report.live.poses import live_poses, packed_poses, pose_surrogate, with_poses
from uqmbd.report.live.scripts import joined_modules
from uqmbd.report.live.statistics_charts import (
    difference_data,
    indices_data,
    std_data,
    violation_data,
    violations_data,
)
from uqmbd.report.live.still import still_chart
from uqmbd.report.live.surrogates import live_method, live_surrogate, packed_surrogate, shipped

__all__ = [
    "Chart",
    "MOST_TIMES",
    "PageScripts",
    "bands_data",
    "cell_html",
    "chart_html",
    "charts_html",
    "decay_data",
    "densities_data",
    "difference_data",
    "elements_data",
    "error_cost_data",
    "errors_data",
    "events_data",
    "indices_data",
    "inputs_data",
    "explorer_data",
    "failures_data",
    "joined_modules",
    "json_script",
    "live_method",
    "live_poses",
    "live_surrogate",
    "orders_data",
    "over_data",
    "packed",
    "packed_poses",
    "packed_surrogate",
    "page_scripts",
    "player_data",
    "pose_surrogate",
    "scalars_data",
    "settling_data",
    "shipped",
    "std_data",
    "still_chart",
    "unpacked",
    "violation_data",
    "violations_data",
    "with_poses",
]
