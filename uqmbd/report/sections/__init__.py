"""Sections of the report on results and on methods."""

from __future__ import annotations

from uqmbd.report.sections.about_methods import ABOUT_METHODS
from uqmbd.report.sections.about_results import (
    ABOUT_RESULTS,
    bands_chart,
    bands_of,
    most_uncertain,
    only_density,
    over_chart,
    ranked,
)
from uqmbd.report.sections.first_screen import ChartGroup, FirstScreen, ReliabilityStatement
from uqmbd.report.sections.section import Content, Section, TemplateSection, environment

__all__ = [
    "ABOUT_METHODS",
    "ABOUT_RESULTS",
    "ChartGroup",
    "Content",
    "FirstScreen",
    "Section",
    "ReliabilityStatement",
    "TemplateSection",
    "bands_chart",
    "bands_of",
    "environment",
    "most_uncertain",
    "only_density",
    "over_chart",
    "ranked",
]
