"""Charts in an output of a notebook: HTML that brings its own scripts, and goes with other outputs on one page."""

from __future__ import annotations

import hashlib

from uqmbd.report.charts import json_script
from uqmbd.report.live.page import page_scripts
from uqmbd.report.live.scripts import joined_modules

__all__ = ["cell_html"]


def cell_html(fragment: str, style: str) -> str:
    """Return an output of a notebook with what makes its charts alive.

    Parameters
    ----------
    fragment : str
        HTML with figures that have data; where scripts do not run it stays as it is.
    style : str
        CSS of what the scripts show; it does not reach the rest of the page.
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
