"""First screen of the report: results, main contributors, reliability, and the recommended method."""

from __future__ import annotations

from uqmbd.report.overview.answers import ANSWERS
from uqmbd.report.overview.contributions import contributed

__all__ = ["ANSWERS", "contributed"]
