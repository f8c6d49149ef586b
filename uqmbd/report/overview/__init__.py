"""The first screen of the report: what was asked, what matters, how reliable it is, and what to do next time."""

from __future__ import annotations

from uqmbd.report.overview.answers import ANSWERS

__all__ = ["ANSWERS"]
