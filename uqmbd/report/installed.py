"""Sections of the report from installed plugins."""

from __future__ import annotations

import warnings

from uqmbd import plugins
from uqmbd.arguments import typechecked
from uqmbd.errors import PluginWarning
from uqmbd.isolation import Isolated
from uqmbd.report.sections import Section

__all__ = ["installed_sections"]


@typechecked
def installed_sections() -> list[Section]:
    """Make the sections of installed plugins for `write_report`.

    Returns
    -------
    list of Section
        Sections in the order of registration.

    Warns
    -----
    uqmbd.extend.PluginWarning
        For each section that cannot be made; this section is omitted.

    Examples
    --------
    >>> all(isinstance(section.title, str) for section in installed_sections())
    True
    """
    sections = []
    for name, section in plugins.report_sections().items():
        with Isolated() as work:
            sections.append(section())
        if work.failed:
            package = plugins.owner("report_sections", name) or section.__module__
            text = f"report section {name!r} of {package} is omitted: {work.reason}"
            warnings.warn(text, PluginWarning, stacklevel=2)
    return sections
