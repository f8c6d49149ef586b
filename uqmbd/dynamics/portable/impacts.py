"""Contacts of a motion in C: impacts and persistent contacts; other events only record a time."""

from __future__ import annotations

import numpy as np

from uqmbd.compiled import ContactPrograms, Dynamics
from uqmbd.dynamics.contact import contact_programs
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.portable.c_source import SourceWriter

__all__ = ["PARTS_OF_STEPS", "contacts_of", "impact_obstacle", "written_contacts"]

PARTS_OF_STEPS = 20
"""Least number of steps over the output times; guards are evaluated within steps."""

SAMPLES = 8
"""Number of guard evaluations in a step of the driver."""


def impact_obstacle(model: Model) -> str:
    """Return why the events of a model have no form in C, or an empty text."""
    maps = [model.outputs, *(loop.measure for loop in model.controls)]
    if _touches(model) and any(one.accelerates for one in maps):
        names = ", ".join(repr(component) for component, *_, directions in model.events if directions)
        return f"it has impacts ({names}), and an output contains an acceleration or a reaction; remove such outputs"
    return ""


def _touches(model: Model) -> bool:
    """Return whether a model has contacts; events without directions are marks."""
    return any(directions for *_, directions in model.events)


def contacts_of(model: Model) -> tuple[Dynamics, ContactPrograms] | None:
    """Return the programs of a model with contacts; None without contacts."""
    return contact_programs(model) if _touches(model) else None


def written_contacts(
    w: SourceWriter, model: Model, found: tuple[Dynamics, ContactPrograms] | None
) -> tuple[str, str, dict[str, int], int]:
    """Return the C structure of contacts, a table of rows, sizes, and the workspace of the driver.

    The table has the rows of the gap, the coefficient of friction and the normal speed of each contact. Its entries for
    other events have no meaning.
    """
    names = ("MOTION_EVENTS", "MOTION_DIRECTIONS")
    if found is None:
        return "{0}", "NULL", dict.fromkeys(names, 0), 0
    c, events = found[1], len(model.events)
    text = ", ".join(
        [
            f"{events}, {len(c.speed)}, {w.integers(c.first)}",
            f"{w.program(c.guards)}, {w.integers(c.guard)}, {w.program(c.contact)}",
            *(w.integers(x) for x in (c.gap, c.law, c.speed, c.bias, c.slope)),
            f"{c.size}, {len(c.rows)}",
            *(w.integers(x) for x in (c.rows, c.columns, c.values, c.right)),
            "{0}, {0}, 0, NULL",  # the elimination with pivots needs no further programs
        ]
    )
    rows = np.concatenate([c.gap, c.law[:, 1], c.speed[np.minimum(c.first[:-1], len(c.speed) - 1)]])
    n = len(c.speed)
    # twice the workspace of contacts.c, which the driver checks
    memory = 2 * (2 * events * (SAMPLES + 2) + c.size * (c.size + 1 + n) + c.size * (1 + n) + 4 * n * n + 8 * n + 1)
    sizes = dict(zip(names, (events, n), strict=True))
    return f"{{{text}}}", w.integers(rows), sizes, memory
