"""Notebook views of mechanisms, studies, results and chaoses: tables, a picture, and charts.

Notebooks show the charts of the report. If scripts do not run, as in untrusted notebooks, still pictures replace the
charts.
"""

from __future__ import annotations

from uqmbd.report.notebook.objects import chaos_html, mechanism_html, result_html, study_html
from uqmbd.report.notebook.shown import Shown, load_ipython_extension, show, unload_ipython_extension
from uqmbd.report.notebook.variables import variable_html

__all__ = [
    "Shown",
    "chaos_html",
    "load_ipython_extension",
    "mechanism_html",
    "result_html",
    "show",
    "study_html",
    "unload_ipython_extension",
    "variable_html",
]
