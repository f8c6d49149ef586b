"""The report's section on when events happen."""

from __future__ import annotations

import functools

import xarray as xr

from uqmbd.report import figures
from uqmbd.report.charts import Views, charted
from uqmbd.report.figures import events_in_words, has_events
from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import StudyResult

__all__ = ["EVENTS"]


def events(result: StudyResult) -> Content | None:
    """Return what the section says and shows of each method that followed events; None if none did."""
    drawn = []
    for label, node in result.nodes.items():
        if not has_events(node):
            continue
        try:
            words = events_in_words(node)
        except Exception as error:  # noqa: BLE001 - results of other packages may hold surprises; the rest must stand
            words = f"They cannot be read: {type(error).__name__}: {error}"
        drawn.append(
            charted(
                functools.partial(_chart, node),
                f"Distributions of the times of events, from samples of {label}. {words}",
                f"When each event happens, from samples of {label}. {words}",
                f"{label}-event-times",
            )
        )
    return {"figures": drawn} if drawn else None


def _chart(node: xr.DataTree) -> Views:
    return figures.events_chart(figures.earliest_events(node))


EVENTS = TemplateSection("When events happen", "events", events)
