"""What people look at: figures of results, and a self-contained HTML report."""

from __future__ import annotations

from uqmbd.report.figures import (
    bands,
    coefficient_decay,
    convergence,
    differences,
    failure_inputs,
    histograms,
    inputs,
    order_convergence,
    sobol_indices,
    std_over_time,
    time_history_histogram,
    verification,
)
from uqmbd.report.html import Section, write_report

__all__ = [
    "Section",
    "bands",
    "coefficient_decay",
    "convergence",
    "differences",
    "failure_inputs",
    "histograms",
    "inputs",
    "order_convergence",
    "sobol_indices",
    "std_over_time",
    "time_history_histogram",
    "verification",
    "write_report",
]
