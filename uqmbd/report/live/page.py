"""Scripts, styles and libraries of a page with charts, and output cells of notebooks."""

from __future__ import annotations

import functools
import hashlib
import re
from dataclasses import dataclass
from importlib.resources import files

from uqmbd.report.charts import json_script

__all__ = ["PageScripts", "cell_html", "joined_modules", "page_scripts"]


_IMPORT = re.compile(r'^import \{[^}]*\} from "\./([\w.-]+)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:async )?function\b|const\b|class\b)", re.MULTILINE)
_DECLARED = re.compile(r"^(?:async )?(?:function|const|let|class) ([\w$]+)", re.MULTILINE)


def joined_modules(*names: str) -> str:
    """Return the text of one module that contains the files `names` and, before them, their imports.

    The names of all files share one scope; the text is for `<script type="module">`.

    Raise ValueError if two files declare the same name. Also raise it if a file contains an import or export of another
    form, or `</script`.
    """
    texts: dict[str, str] = {}
    owner: dict[str, str] = {}

    def add(name: str) -> None:
        if name in texts:
            return
        source = (files(__package__) / name).read_text(encoding="utf-8")
        for other in _IMPORT.findall(source):
            add(other)
        text = _EXPORT.sub("", _IMPORT.sub("", source))
        if re.search(r"^(?:import|export)\b", text, re.MULTILINE):
            raise ValueError(f"{name} has an import or an export that the page cannot merge.")
        if "</script" in text.lower() or "<!--" in text:
            raise ValueError(f"{name} contains a text that would end its HTML element.")
        for declared in _DECLARED.findall(text):
            if declared in owner:
                raise ValueError(f"{name} and {owner[declared]} both declare {declared}.")
            owner[declared] = name
        texts[name] = text

    for name in names:
        add(name)
    return "\n".join(map(_bare, texts.values()))


def _bare(source: str) -> str:
    """Return a script without comments and indentation, which makes pages smaller."""
    kept, comment = [], False
    for line in map(str.strip, source.splitlines()):
        if line.count("`") % 2:
            raise ValueError(f"A script has a multi-line text, in which spaces are significant: {line!r:.80}.")
        comment = comment or line.startswith("/*")
        if not comment and line and not line.startswith("//"):
            kept.append(line)
        comment = comment and not line.endswith("*/")
    return "\n".join(kept) + "\n"


START = "\nstartCharts();\nstartPlayers();\nstartExplorers();\nstartFolds();\nstartSearch();\n"
"""Calls of the scripts after the page has loaded; the chart of the first screen sets the initial time of the page."""


@dataclass(frozen=True)
class PageScripts:
    """HTML elements for the scripts of a page."""

    style: str  # for ``<style>``: the style of the library
    uplot: str  # for ``<script>``: uPlot, with its licence as a comment
    module: str  # for ``<script type="module">``: makes charts, players and sliders from the data


@functools.cache
def page_scripts() -> PageScripts:
    """Return the scripts of a page with charts."""
    vendor = files(__package__) / "vendor"
    library, style, licence = (
        (vendor / name).read_text(encoding="utf-8")
        for name in ("uPlot.iife.min.js", "uPlot.min.css", "LICENSE-uPlot.txt")
    )
    own = joined_modules("charts.js", "player.js", "explorer.js", "folds.js", "search.js")
    return PageScripts(style, f"/*\nuPlot\n{licence}\n*/\n{library}", own + START)


def cell_html(fragment: str, style: str) -> str:
    """Return the output of a notebook cell with the scripts of its charts.

    `fragment` is HTML with figures that have data; it does not change if scripts do not run. `style` is the CSS of
    elements that scripts make; it does not affect the rest of the page.
    """
    scripts = page_scripts()
    # no id: one fragment may be shown several times, and the names of its elements are in a separate tree
    mark = hashlib.sha256(fragment.encode("utf-8", "replace")).hexdigest()[:16]
    # a separate function for each output: pages of notebooks run scripts in one scope, and never as named modules
    lines = [
        scripts.uplot,
        joined_modules("cell.js"),
        f"startCell({json_script(mark)}, {json_script(scripts.style + style)});",
    ]
    script = "\n".join(["(() => {", *lines, "})();"])
    return f'<div class="uqmbd-cell" data-mark="{mark}">{fragment}</div><script>{script}</script>'
