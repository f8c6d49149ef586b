"""What a page with charts carries besides its data: the library that draws them, its style, and our own scripts."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from importlib.resources import files

from uqmbd.report.live.scripts import joined_modules

__all__ = ["PageScripts", "page_scripts"]

START = "\nstartCharts();\nstartPlayers();\nstartExplorers();\n"
"""What the scripts do when the page is there: the chart of the first screen says at which time the page begins."""


@dataclass(frozen=True)
class PageScripts:
    """Texts for elements of a page.

    Attributes
    ----------
    style : str
        For ``<style>``: that of the library.
    uplot : str
        For ``<script>``: uPlot, with its licence as a comment.
    module : str
        For ``<script type="module">``: makes charts, players and sliders of what has data.
    """

    style: str
    uplot: str
    module: str


@functools.cache
def page_scripts() -> PageScripts:
    """Return the scripts of a page with charts."""
    vendor = files(__package__) / "vendor"
    library, style, licence = (
        (vendor / name).read_text(encoding="utf-8")
        for name in ("uPlot.iife.min.js", "uPlot.min.css", "LICENSE-uPlot.txt")
    )
    return PageScripts(
        style, f"/*\nuPlot\n{licence}\n*/\n{library}", joined_modules("charts.js", "player.js", "explorer.js") + START
    )
