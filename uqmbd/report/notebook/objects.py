"""HTML of uqmbd objects in notebooks, and their tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.report.notebook.charts import (
    FIRST_SCREEN,
    alive,
    motion_charts,
    noted,
    output_charts,
    surrogate_charts,
    too_large,
)
from uqmbd.wording import format_duration, format_integer, format_number, typeset_units

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.mechanism import Mechanism
    from uqmbd.propagation import Study
    from uqmbd.report.view import StudyResult
    from uqmbd.results import PolynomialChaos

__all__ = [
    "ROWS",
    "chaos_html",
    "mechanism_html",
    "mechanism_tables",
    "options_of",
    "page",
    "picture",
    "result_html",
    "study_html",
    "table",
]


ROWS = 40
"""Maximum number of rows of a table; a longer table states the number of omitted rows."""


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
            table("Bodies", ("name", "mass [kg]", "given position [m]"), bodies),
            table("Components", ("name", "type", "between"), components),
            table("Controllers", ("name", "rate [Hz]", "measures", "commands"), controllers),
            table("Random inputs", ("name", "distribution", "units"), inputs),
            table("Outputs", ("name", "units", "expression"), outputs),
            table(
                "Omitted from the file, or changed", ("content", "count", "elements", "reason"), _omissions(mechanism)
            ),
        )
    )


def _omissions(mechanism: Mechanism) -> list[tuple[str, str, str, str]]:
    """List the elements of a model file that an imported mechanism omits or changes."""
    return [(row.what, str(row.count), row.listed, row.why) for row in getattr(mechanism, "not_taken", ())]


def _value(value: Any) -> str:
    try:
        return format_number(float(value))
    except (TypeError, ValueError):
        return str(value)


def options_of(propagator: Any) -> str:
    """Return the options of a method that differ from the defaults."""
    from dataclasses import fields, is_dataclass

    if not is_dataclass(propagator):
        return ""
    given = ((f.name, getattr(propagator, f.name), f.default) for f in fields(propagator) if f.name != "label")
    return ", ".join(f"{name}={value!r}" for name, value, default in given if value is not default and value != default)


def picture(mechanism: Mechanism) -> str:
    """Return a picture with an alternative text, or a note if the drawing fails."""
    if not mechanism.bodies:
        return ""
    from uqmbd.report.mechanisms import draw_pose, drawn_pose

    try:
        source = draw_pose(drawn_pose(mechanism)).source()
    except Exception as error:  # noqa: BLE001 - a mechanism may be unfinished in any way; its tables must remain
        return f"<p>The mechanism cannot be drawn: {escape(f'{type(error).__name__}: {error}')}</p>"
    alt = escape(f"The mechanism {mechanism.name} in its assembled pose.", quote=True)
    return f'<img src="{source}" alt="{alt}" style="max-width:100%;background:#fff">'


def mechanism_html(mechanism: Mechanism) -> str:
    """Return bodies, components, random inputs and outputs as tables next to a picture of the assembled pose.

    `mechanism` may be empty or incomplete.

    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("fall", uqmbd.Translational())
    >>> stone = mechanism.body("stone", mass=2)
    >>> "stone" in mechanism_html(mechanism) and "<svg" not in mechanism_html(mechanism)
    True
    """
    space = f"{type(mechanism.space).__name__.lower()} mechanism"
    return page(f"{mechanism.name} – {space}", mechanism_tables(mechanism), picture(mechanism))


def study_html(study: Study) -> str:
    """Return times, methods and the mechanism of a study."""
    times = study.times
    facts = [
        ("times", f"{len(times)}, from {format_number(times[0])} s to {format_number(times[-1])} s")
        if len(times) > 1
        else ("times", "none"),
        ("relative tolerance", format_number(study.rtol)),
        ("integrator", study.integrator),
        ("start", study.start),
    ]
    methods = [(p.node_name, type(p).__name__, options_of(p)) for p in study.propagators]
    parts = [table("", ("study", ""), facts), table("Methods", ("label", "type", "options"), methods)]
    parts.append(noted("The findings could not be computed", lambda: _findings(study)))
    inner = f"<details><summary>{escape(study.mechanism.name)}</summary>{mechanism_html(study.mechanism)}</details>"
    return alive(page(f"{study.name} – study", "".join(parts), "") + inner + motion_charts(study))


def _findings(study: Study) -> str:
    """Return the findings on a study, one paragraph each."""
    import warnings

    from uqmbd.propagation import findings

    if too_large(study):
        return "<p>The study is large, so its findings are not computed here. uqmbd.findings computes them.</p>"
    with warnings.catch_warnings():
        # a run issues these warnings
        warnings.simplefilter("ignore")
        return "".join(f"<p>{escape(str(one))}</p>" for one in findings(study))


def chaos_html(chaos: PolynomialChaos) -> str:
    """Return inputs, size, results at the end, and stated errors of a chaos."""
    labels = chaos.labels
    mean, std = (np.asarray(x).reshape(len(labels.outputs), -1)[:, -1] for x in (chaos.mean, chaos.std))
    rows = [
        (output.name, typeset_units(output.units), format_number(float(mean[k])), format_number(float(std[k])))
        for k, output in enumerate(labels.outputs)
    ]
    when = "" if labels.times is None else f" at t = {format_number(labels.times[-1])} s"
    index = getattr(chaos, "multi_index", None)
    size = ""
    if index is not None and len(index):
        size = f"<p>Order {int(index.max(initial=0))}, {len(index)} term{'s' * (len(index) != 1)}.</p>"
    inputs = [(i.name, i.description, typeset_units(i.units)) for i in labels.inputs]
    parts = [
        size,
        table("Inputs", ("name", "distribution", "units"), inputs),
        table(f"Outputs{when}", ("name", "units", "mean", "standard deviation"), rows),
    ]
    if chaos.verification_germs is not None:
        parts += [f"<p>{escape(text)}</p>" for text in getattr(chaos, "verdicts", tuple)()]
    return alive(page("polynomial chaos", "".join(parts), "") + surrogate_charts(chaos))


def result_html(tree: xr.DataTree, outputs: Sequence[str] | None = None) -> str:
    """Return the first screen of the report of a result, its methods, and charts of its outputs over time.

    `tree` is the result of a study, or the node of one method. `outputs` are the drawn outputs; the default is the six
    most uncertain outputs. Raise StudyError if the tree is not a result, or lacks an output.
    """
    from uqmbd.report.sections import most_uncertain
    from uqmbd.report.view import StudyResult
    from uqmbd.results import answers

    result = StudyResult.of(tree)
    if not result.methods:
        raise StudyError(
            "The tree contains no result of a method; expected the result of Study.run, or one of its nodes."
        )
    every = [*result.histories, *result.scalar_names]
    if outputs is not None and (isinstance(outputs, str) or (unknown := [x for x in outputs if x not in every])):
        named = repr(outputs) if isinstance(outputs, str) else ", ".join(map(repr, unknown))
        raise StudyError(f"outputs is or has {named}; expected a list of some of: {', '.join(map(repr, every))}.")
    drawn = most_uncertain(result) if outputs is None else [x for x in outputs if x in result.histories]
    methods = [
        (label, format_integer(m.total_realisations), format_integer(m.failures), format_duration(m.wall_time))
        for label, m in result.methods.items()
    ]
    required = [(name, one.method, one.words) for name, by in answers(result.nodes).items() for one in by.values()]
    scalars = [
        (name, label, format_number(float(of["mean"])), format_number(float(of["std"])), typeset_units(m.units(name)))
        for label, m in result.scalars.items()
        for name, of in ((name, m.of(name)) for name in m.names if outputs is None or name in outputs)
    ]
    found = result.assessment
    first = noted("The first screen of the report cannot be shown", lambda: _first_screen(result))
    sentences = [*result.problems, *found.contradictions, *found.recommendation, *found.reasons]
    reasons = [one.reason for one in found.reliability]
    parts = [
        *(f"<p>{escape(str(one))}</p>" for one in result.findings),
        # add the messages that the first screen does not contain
        *(f"<p>{escape(one)}</p>" for one in dict.fromkeys((*sentences, *reasons)) if one and escape(one) not in first),
        table("Methods", ("label", "realisations", "failed", "time"), methods),
        table("Requirements", ("requirement", "method", "probability of violation"), required),
        table("Scalar outputs", ("name", "method", "mean", "standard deviation", "units"), scalars),
    ]
    left = len(result.histories) - len(drawn)
    more = f"<p>Of {len(result.histories)} outputs over time, {len(drawn)} are shown.</p>" if left else ""
    tables = page(f"{result.study} – results", first + "".join(parts), "")
    return alive(tables + output_charts(result, drawn) + more)


def _first_screen(result: StudyResult) -> str:
    """Return the first screen of the report without charts of outputs, and without motion of the mechanism."""
    from uqmbd.report.html import first_screen
    from uqmbd.report.installed import installed_sections
    from uqmbd.report.overview import ANSWERS

    contributions = [one for section in installed_sections() if (one := first_screen(section, result.tree))]
    content = {**(ANSWERS.content(result) or {}), "picture": None, "contributions": contributions}
    if content["mechanism"] and not content["mechanism"].get("problem"):
        content["mechanism"] |= {"player": "null"}
    return f"{FIRST_SCREEN}{ANSWERS.fragment(result, content)}</div>"
