"""Interactive parts of a report: data for its scripts, and the scripts (JavaScript modules in this folder)."""

from __future__ import annotations

from uqmbd.report.live.explorer_data import collect_explorer_data, collect_nearest_data
from uqmbd.report.live.page import PageScripts, cell_html, joined_modules, page_scripts
from uqmbd.report.live.player_data import collect_player_data
from uqmbd.report.live.poses import live_poses, packed_poses, pose_surrogate, with_poses
from uqmbd.report.live.surrogates import live_method, live_surrogate, packed_surrogate, shipped

__all__ = [
    "PageScripts",
    "cell_html",
    "collect_explorer_data",
    "collect_nearest_data",
    "joined_modules",
    "live_method",
    "live_poses",
    "live_surrogate",
    "packed_poses",
    "packed_surrogate",
    "page_scripts",
    "collect_player_data",
    "pose_surrogate",
    "shipped",
    "with_poses",
]
