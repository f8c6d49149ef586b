"""The report's section on when events happen."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import xarray as xr

from uqmbd.report import figures
from uqmbd.report.drawing import image
from uqmbd.report.figures import events_in_words, has_events

__all__ = ["events"]


def events(nodes: Mapping[str, xr.DataTree]) -> dict[str, Any] | None:
    """Return what the section says and shows of each method that followed events; None if none did.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree
        The methods of a study.
    """
    drawn = []
    for label, node in nodes.items():
        if not has_events(node):
            continue
        try:
            words = events_in_words(node)
        except Exception as error:  # noqa: BLE001 - results of other packages may hold surprises; the rest must stand
            words = f"They cannot be read: {type(error).__name__}: {error}"
        drawn.append(
            image(
                functools.partial(figures.event_times, node),
                f"Distributions of the times of events, from samples of {label}. {words}",
                f"When each event happens, from samples of {label}. {words}",
                f"{label}-event-times",
            )
        )
    return {"figures": drawn} if drawn else None
