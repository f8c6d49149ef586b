"""What people look at: figures of results, and a self-contained HTML report."""

from __future__ import annotations

from uqmbd.report.figures import bands, histograms, inputs, std_over_time
from uqmbd.report.html import Section, write_report

__all__ = ["Section", "bands", "histograms", "inputs", "std_over_time", "write_report"]
