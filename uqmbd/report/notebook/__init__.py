"""How mechanisms, studies, results and chaoses show themselves in notebooks: tables, a picture, and charts.

Charts are those of the report.  Where scripts do not run, as in notebooks that are not trusted, their figures stand.
"""

from __future__ import annotations

from uqmbd.report.notebook.objects import chaos_html, mechanism_html, result_html, study_html
from uqmbd.report.notebook.shown import Shown, load_ipython_extension, show, unload_ipython_extension

__all__ = [
    "Shown",
    "chaos_html",
    "load_ipython_extension",
    "mechanism_html",
    "result_html",
    "show",
    "study_html",
    "unload_ipython_extension",
]
