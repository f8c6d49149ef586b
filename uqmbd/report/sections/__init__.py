"""Sections of the report."""

from __future__ import annotations

from uqmbd.report.sections.agreement import agreement
from uqmbd.report.sections.error_cost import error_against_cost
from uqmbd.report.sections.events import events
from uqmbd.report.sections.motion import moving_picture
from uqmbd.report.sections.outputs import outputs
from uqmbd.report.sections.provenance import cost, problems, provenance, study_attributes
from uqmbd.report.sections.summary import comparison, failures, heading, input_rows, statistics, summary
from uqmbd.report.sections.trust import influence, trust

__all__ = [
    "agreement",
    "comparison",
    "cost",
    "error_against_cost",
    "events",
    "failures",
    "heading",
    "influence",
    "input_rows",
    "moving_picture",
    "outputs",
    "problems",
    "provenance",
    "statistics",
    "study_attributes",
    "summary",
    "trust",
]
