"""What people look at: figures of results, and a self-contained HTML report."""

from __future__ import annotations

from uqmbd.report.figures import (
    bands,
    convergence,
    failure_inputs,
    histograms,
    inputs,
    std_over_time,
    time_history_histogram,
)
from uqmbd.report.html import Section, write_report

__all__ = [
    "Section",
    "bands",
    "convergence",
    "failure_inputs",
    "histograms",
    "inputs",
    "std_over_time",
    "time_history_histogram",
    "write_report",
]
