"""How mechanisms, studies and chaoses show themselves in notebooks: tables, and a picture of the mechanism."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.wording import format_number, typeset_units

if TYPE_CHECKING:
    from uqmbd.mechanism import Mechanism
    from uqmbd.propagation import Study
    from uqmbd.results import PolynomialChaos

__all__ = ["chaos_html", "mechanism_html", "study_html"]

ROWS = 40
"""Most rows of a table; of longer ones, the number of the others is given."""


def mechanism_html(mechanism: Mechanism) -> str:
    """Return bodies, components, random inputs and outputs as tables, beside a picture of the assembled pose.

    Parameters
    ----------
    mechanism : Mechanism
        Any, also an empty or unfinished one.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("fall", uqmbd.Translational())
    >>> stone = mechanism.body("stone", mass=2)
    >>> "stone" in mechanism_html(mechanism) and "<svg" not in mechanism_html(mechanism)
    True
    """
    space = f"{type(mechanism.space).__name__.lower()} mechanism"
    return _page(f"{mechanism.name} – {space}", _tables(mechanism), _picture(mechanism))


def study_html(study: Study) -> str:
    """Return times, methods and the mechanism of a study.

    Parameters
    ----------
    study : Study
        Any.
    """
    times = study.times
    facts = [
        ("times", f"{len(times)}, from {format_number(times[0])} s to {format_number(times[-1])} s")
        if len(times) > 1
        else ("times", "none"),
        ("relative tolerance", format_number(study.rtol)),
        ("integrator", study.integrator),
        ("start", study.start),
    ]
    methods = [(p.node_name, type(p).__name__, _options(p)) for p in study.propagators]
    parts = [_table("", ("study", ""), facts), _table("Methods", ("label", "type", "options"), methods)]
    inner = f"<details><summary>{escape(study.mechanism.name)}</summary>{mechanism_html(study.mechanism)}</details>"
    return _page(f"{study.name} – study", "".join(parts), "") + inner


def chaos_html(chaos: PolynomialChaos) -> str:
    """Return inputs, size, results at the end and how far to trust them.

    Parameters
    ----------
    chaos : PolynomialChaos
        Any.
    """
    labels = chaos.labels
    mean, std = (np.asarray(x).reshape(len(labels.outputs), -1)[:, -1] for x in (chaos.mean, chaos.std))
    rows = [
        (output.name, typeset_units(output.units), format_number(float(mean[k])), format_number(float(std[k])))
        for k, output in enumerate(labels.outputs)
    ]
    when = "" if labels.times is None else f" at t = {format_number(labels.times[-1])} s"
    index = getattr(chaos, "multi_index", None)
    size = ""
    if index is not None:
        size = f"<p>Order {int(index.max(initial=0))}, {len(index)} term{'s' * (len(index) != 1)}.</p>"
    inputs = [(i.name, i.description, typeset_units(i.units)) for i in labels.inputs]
    parts = [
        size,
        _table("Inputs", ("name", "distribution", "units"), inputs),
        _table(f"Outputs{when}", ("name", "units", "mean", "standard deviation"), rows),
    ]
    if chaos.verification_germs is not None:
        parts += [f"<p>{escape(text)}</p>" for text in getattr(chaos, "verdicts", tuple)()]
    return _page("polynomial chaos", "".join(parts), "")


def _tables(mechanism: Mechanism) -> str:
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
            _table("Bodies", ("name", "mass [kg]", "position as drawn [m]"), bodies),
            _table("Components", ("name", "type", "between"), components),
            _table("Controllers", ("name", "rate [Hz]", "measures", "commands"), controllers),
            _table("Random inputs", ("name", "distribution", "units"), inputs),
            _table("Outputs", ("name", "units", "expression"), outputs),
            _table("Not taken from the file, or changed", ("what", "count", "which", "why"), _omissions(mechanism)),
        )
    )


def _picture(mechanism: Mechanism) -> str:
    """Picture as an image with an alternative text; a note where it cannot be drawn."""
    if not mechanism.bodies:
        return ""
    from uqmbd.report.drawing import image
    from uqmbd.report.mechanisms import mechanism as draw

    made = image(lambda: draw(mechanism), f"The mechanism {mechanism.name} in its assembled pose.", "")
    if made["problem"]:
        return f"<p>It cannot be drawn: {escape(made['problem'])}</p>"
    return (
        f'<img src="{made["source"]}" alt="{escape(made["alt"], quote=True)}" style="max-width:100%;background:#fff">'
    )


def _omissions(mechanism: Mechanism) -> list[tuple[str, str, str, str]]:
    """List what a mechanism that was read from a file does not have of it."""
    return [(row.what, str(row.count), row.listed, row.why) for row in getattr(mechanism, "not_taken", ())]


def _value(value: Any) -> str:
    try:
        return format_number(float(value))
    except (TypeError, ValueError):
        return str(value)


def _options(propagator: Any) -> str:
    from dataclasses import fields, is_dataclass

    if not is_dataclass(propagator):
        return ""
    given = ((f.name, getattr(propagator, f.name), f.default) for f in fields(propagator) if f.name != "label")
    return ", ".join(f"{name}={value!r}" for name, value, default in given if value is not default and value != default)


def _table(title: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
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


def _page(heading: str, tables: str, picture: str) -> str:
    return (
        f'<div><p style="font-weight:bold">{escape(heading)}</p>'
        '<div style="display:flex;flex-wrap:wrap;gap:1.5em;align-items:flex-start">'
        f"<div>{picture}</div><div>{tables}</div></div></div>"
    )
