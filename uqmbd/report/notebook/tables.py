"""Tables of notebooks, and the picture of a mechanism."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from uqmbd.wording import format_number, typeset_units

if TYPE_CHECKING:
    from uqmbd.mechanism import Mechanism

__all__ = ["ROWS", "mechanism_tables", "options_of", "page", "picture", "table"]


ROWS = 40
"""Most rows of a table; of longer ones, the number of the others is given."""


def page(heading: str, tables: str, picture: str) -> str:
    """Return a heading above a picture and tables."""
    return (
        f'<div><p style="font-weight:bold">{escape(heading)}</p>'
        '<div style="display:flex;flex-wrap:wrap;gap:1.5em;align-items:flex-start">'
        f"{f'<div>{picture}</div>' if picture else ''}<div>{tables}</div></div></div>"
    )


def table(title: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; empty without rows."""
    every = list(rows)
    if not every:
        return ""
    cells = "".join(f'<th scope="col" style="text-align:left">{escape(text)}</th>' for text in head)
    lines = []
    for first, *rest in every[:ROWS]:
        body = "".join(f'<td style="text-align:left">{escape(_cut(text))}</td>' for text in rest)
        lines.append(f'<tr><th scope="row" style="text-align:left">{escape(_cut(first))}</th>{body}</tr>')
    more = f"<p>and {len(every) - ROWS} more</p>" if len(every) > ROWS else ""
    caption = f'<caption style="text-align:left;font-weight:bold">{escape(title)}</caption>' if title else ""
    return f"<table>{caption}<thead><tr>{cells}</tr></thead><tbody>{''.join(lines)}</tbody></table>{more}"


def _cut(text: str) -> str:
    return text if len(text) <= 100 else text[:97] + "..."


def mechanism_tables(mechanism: Mechanism) -> str:
    """Return bodies, components, controllers, inputs and outputs."""
    import warnings

    bodies = [
        (b.name, _value(b.terms.values["mass"]), ", ".join(map(_value, b.pose.q[: b.space.dimension])))
        for b in mechanism.bodies.values()
    ]
    components = [
        (c.name, type(c).__name__, ", ".join(str(getattr(c.attached[b], "name", "ground")) for b in c.bodies))
        for c in mechanism.components.values()
    ]
    controllers = [
        (c.name, f"{c.rate:g}", ", ".join(map(str, c.measured)), ", ".join(c.commands))
        for c in mechanism.controllers.values()
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        inputs = [(v.name, v.description, typeset_units(v.units)) for v in mechanism.inputs.variables]
    outputs = [(o.name, typeset_units(o.units), str(o.expression)) for o in mechanism.outputs.values()]
    return "".join(
        (
            table("Bodies", ("name", "mass [kg]", "position as drawn [m]"), bodies),
            table("Components", ("name", "type", "between"), components),
            table("Controllers", ("name", "rate [Hz]", "measures", "commands"), controllers),
            table("Random inputs", ("name", "distribution", "units"), inputs),
            table("Outputs", ("name", "units", "expression"), outputs),
            table("Not taken from the file, or changed", ("what", "count", "which", "why"), _omissions(mechanism)),
        )
    )


def _omissions(mechanism: Mechanism) -> list[tuple[str, str, str, str]]:
    """List what a mechanism that was read from a file does not have of it."""
    return [(row.what, str(row.count), row.listed, row.why) for row in getattr(mechanism, "not_taken", ())]


def _value(value: Any) -> str:
    try:
        return format_number(float(value))
    except (TypeError, ValueError):
        return str(value)


def options_of(propagator: Any) -> str:
    """Return the options of a method that are not as by default."""
    from dataclasses import fields, is_dataclass

    if not is_dataclass(propagator):
        return ""
    given = ((f.name, getattr(propagator, f.name), f.default) for f in fields(propagator) if f.name != "label")
    return ", ".join(f"{name}={value!r}" for name, value, default in given if value is not default and value != default)


def picture(mechanism: Mechanism) -> str:
    """Picture as an image with an alternative text; a note where it cannot be drawn."""
    if not mechanism.bodies:
        return ""
    from uqmbd.report.mechanisms import drawn_pose, pose_still

    try:
        source = pose_still(drawn_pose(mechanism)).source()
    except Exception as error:  # noqa: BLE001 - a mechanism may be unfinished in any way; its tables must stand
        return f"<p>It cannot be drawn: {escape(f'{type(error).__name__}: {error}')}</p>"
    alt = escape(f"The mechanism {mechanism.name} in its assembled pose.", quote=True)
    return f'<img src="{source}" alt="{alt}" style="max-width:100%;background:#fff">'
