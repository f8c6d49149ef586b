"""Sections of the report."""

from __future__ import annotations

from uqmbd.report.sections.comparison import COMPARISON
from uqmbd.report.sections.cost import COST
from uqmbd.report.sections.events import EVENTS
from uqmbd.report.sections.explore import EXPLORE
from uqmbd.report.sections.failures import FAILURES
from uqmbd.report.sections.growth import GROWTH
from uqmbd.report.sections.influence import INFLUENCE
from uqmbd.report.sections.inputs import INPUTS
from uqmbd.report.sections.methods import METHODS, precision_sentences
from uqmbd.report.sections.motion import mechanism_picture
from uqmbd.report.sections.outputs import OUTPUTS, bands_chart, most_uncertain, ranked
from uqmbd.report.sections.provenance import PROVENANCE
from uqmbd.report.sections.requirements import REQUIREMENTS
from uqmbd.report.sections.scalars import SCALARS
from uqmbd.report.sections.section import Content, Section, TemplateSection, environment
from uqmbd.report.sections.trust import TRUST

__all__ = [
    "ABOUT_METHODS",
    "ABOUT_RESULTS",
    "Content",
    "Section",
    "TemplateSection",
    "bands_chart",
    "environment",
    "mechanism_picture",
    "most_uncertain",
    "precision_sentences",
    "ranked",
]

ABOUT_RESULTS = (EXPLORE, REQUIREMENTS, OUTPUTS, SCALARS, EVENTS, INFLUENCE, INPUTS)
"""Sections after the first screen and before those of plugins, in the order of the page."""

ABOUT_METHODS = (METHODS, COMPARISON, TRUST, GROWTH, COST, FAILURES, PROVENANCE)
"""Sections after those of plugins."""
