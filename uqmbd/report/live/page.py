"""What a page with charts carries besides its data: a library, its style, our own scripts; and cells of notebooks."""

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
    """Return the text of one module with what the files `names` hold, and before them what they import.

    Their names share one scope; the text is for `<script type="module">`.

    Raise ValueError if two files declare the same name, one has an import or export of another form, or one holds
    `</script`.
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
            raise ValueError(f"{name} has an import or an export that cannot be joined.")
        if "</script" in text.lower() or "<!--" in text:
            raise ValueError(f"{name} holds a text that ends its element in HTML.")
        for declared in _DECLARED.findall(text):
            if declared in owner:
                raise ValueError(f"{name} and {owner[declared]} both declare {declared}.")
            owner[declared] = name
        texts[name] = text

    for name in names:
        add(name)
    return "\n".join(map(_bare, texts.values()))


def _bare(source: str) -> str:
    """Return a script without its comments and the beginnings of its lines: a page carries what runs."""
    kept, comment = [], False
    for line in map(str.strip, source.splitlines()):
        if line.count("`") % 2:
            raise ValueError(f"A script has a text over several lines, whose spaces count: {line!r:.80}.")
        comment = comment or line.startswith("/*")
        if not comment and line and not line.startswith("//"):
            kept.append(line)
        comment = comment and not line.endswith("*/")
    return "\n".join(kept) + "\n"


START = "\nstartCharts();\nstartPlayers();\nstartExplorers();\nstartFolds();\n"
"""What the scripts do when the page is there: the chart of the first screen says at which time the page begins."""


@dataclass(frozen=True)
class PageScripts:
    """Texts for elements of a page."""

    style: str  # for ``<style>``: that of the library
    uplot: str  # for ``<script>``: uPlot, with its licence as a comment
    module: str  # for ``<script type="module">``: makes charts, players and sliders of what has data


@functools.cache
def page_scripts() -> PageScripts:
    """Return the scripts of a page with charts."""
    vendor = files(__package__) / "vendor"
    library, style, licence = (
        (vendor / name).read_text(encoding="utf-8")
        for name in ("uPlot.iife.min.js", "uPlot.min.css", "LICENSE-uPlot.txt")
    )
    own = joined_modules("charts.js", "player.js", "explorer.js", "folds.js")
    return PageScripts(style, f"/*\nuPlot\n{licence}\n*/\n{library}", own + START)


def cell_html(fragment: str, style: str) -> str:
    """Return an output of a notebook with what makes its charts alive.

    `fragment`: HTML with figures that have data; where scripts do not run it stays as it is; `style`: CSS of what the
    scripts show; it does not reach the rest of the page.
    """
    scripts = page_scripts()
    # no id: one fragment may be shown several times, and names of its elements are in a tree of their own
    mark = hashlib.sha256(fragment.encode("utf-8", "replace")).hexdigest()[:16]
    # a function of its own for each output: pages of notebooks run scripts in one scope, and never as modules of names
    lines = [
        scripts.uplot,
        joined_modules("cell.js"),
        f"startCell({json_script(mark)}, {json_script(scripts.style + style)});",
    ]
    script = "\n".join(["(() => {", *lines, "})();"])
    return f'<div class="uqmbd-cell" data-mark="{mark}">{fragment}</div><script>{script}</script>'
