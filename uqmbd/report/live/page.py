"""Scripts, styles and libraries of a page with charts, and output cells of notebooks."""

from __future__ import annotations

import functools
import hashlib
from dataclasses import dataclass

from uqmbd.javascript import joined_modules, library, surface_library, vendor_file
from uqmbd.report.charts import json_script

__all__ = ["PageScripts", "cell_html", "joined_modules", "page_scripts"]


START = "\nstartCharts();\nstartPlayers();\nstartExplorers();\nstartFolds();\nstartSearch();\n"
"""Calls that start the scripts of a loaded page; the chart of the first screen sets the initial time of the page."""


@dataclass(frozen=True)
class PageScripts:
    """HTML elements for the scripts of a page."""

    style: str  # for ``<style>``: the style of the library
    uplot: str  # for ``<script>``: uPlot, with its licence as a comment
    three: str  # for ``<script>`` of a page with surfaces in space: three.js, with its licence as a comment
    module: str  # for ``<script type="module">``: makes charts, players and sliders from the data


@functools.cache
def page_scripts() -> PageScripts:
    """Return the scripts of a page with charts."""
    own = joined_modules("charts.js", "player.js", "explorer.js", "folds.js", "search.js")
    return PageScripts(
        vendor_file("uPlot.min.css"), library("uPlot", "uPlot.iife.min.js"), surface_library(), own + START
    )


def cell_html(fragment: str, style: str) -> str:
    """Return the output of a notebook cell with the scripts of its charts.

    `fragment` is HTML with figures that have data; without scripts, the cell shows it unchanged. `style` is the CSS of
    elements that scripts make; it does not affect the rest of the notebook.
    """
    scripts = page_scripts()
    # a mark instead of an id, because a notebook may show the same fragment several times
    mark = hashlib.sha256(fragment.encode("utf-8", "replace")).hexdigest()[:16]
    # wrap the scripts in a function, because notebooks run all scripts in one scope and support no named modules
    lines = [
        scripts.uplot,
        joined_modules("cell.js"),
        f"startCell({json_script(mark)}, {json_script(scripts.style + style)});",
    ]
    script = "\n".join(["(() => {", *lines, "})();"])
    return f'<div class="uqmbd-cell" data-mark="{mark}">{fragment}</div><script>{script}</script>'
