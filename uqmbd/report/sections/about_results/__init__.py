"""Sections on results: outputs, requirements, events, and inputs."""

from __future__ import annotations

from uqmbd.report.sections.about_results.inputs import EXPLORE, INFLUENCE, INPUTS, input_rows
from uqmbd.report.sections.about_results.outputs import (
    OUTPUTS,
    bands_chart,
    bands_of,
    most_uncertain,
    only_density,
    over_chart,
    ranked,
)
from uqmbd.report.sections.about_results.requirements import REQUIREMENTS
from uqmbd.report.sections.about_results.scalars import EVENTS, SCALARS

__all__ = [
    "ABOUT_RESULTS",
    "bands_chart",
    "bands_of",
    "input_rows",
    "most_uncertain",
    "only_density",
    "over_chart",
    "ranked",
]

ABOUT_RESULTS = (EXPLORE, REQUIREMENTS, OUTPUTS, SCALARS, EVENTS, INFLUENCE, INPUTS)
"""Sections between the first screen and the sections of plugins, in the order of the page."""
