"""The first screen as a section of the report: answers first, beside a picture of the mechanism and of an output."""

from __future__ import annotations

from uqmbd.report import figures
from uqmbd.report.charts import Chart, Views, charted, several
from uqmbd.report.overview.asked import answer_of, asked, in_view
from uqmbd.report.overview.influences import Influences, of_history, of_requirement, of_scalar
from uqmbd.report.overview.motion import mechanism_picture
from uqmbd.report.sections import Content, TemplateSection, only_density
from uqmbd.report.view import StudyResult
from uqmbd.results import answers
from uqmbd.wording import format_count, format_duration

__all__ = ["ANSWERS"]

LINES = 5
"""Lines on reliability, and bars of what matters, on the first screen."""


def content(result: StudyResult) -> Content:
    """Return what the first screen says and shows."""
    shown = asked(result)
    name = in_view(result)
    found, of_what = _influences(result, shown, name)
    known = result.assessment
    return {
        "problems": [*result.problems, *known.contradictions],
        "failures": _failures(result),
        "asked": shown,
        "mechanism": mechanism_picture(result),
        "picture": _picture(result, name),
        "in_view": name,
        "matters": None if found is None else _bars(found, of_what),
        "untold": _untold(result, shown),
        "reliability": known.reliability[:LINES],
        "more_lines": max(len(known.reliability) - LINES, 0),
        "next": {"methods": _costs(result), "words": known.recommendation},
    }


ANSWERS = TemplateSection("Answers", "answers", content)


def _costs(result: StudyResult) -> list[Content]:
    """Return what the recommended methods cost, or the only one."""
    labels = result.assessment.recommended or (result.methods if len(result.methods) == 1 else ())
    some = [result.methods[label] for label in labels]
    counts = [f"{format_count(m.realisations, 'realisation')}, {format_duration(m.wall_time)}" for m in some]
    return [{"label": method.label, "cost": cost} for method, cost in zip(some, counts, strict=True)]


def _influences(result: StudyResult, shown: Content, name: str) -> tuple[Influences | None, str]:
    """Return what matters for the most probable violation; without requirements, for the output in view."""
    for row in shown["rows"]:
        if shown["kind"] == "requirements" and (found := of_requirement(result, str(row["name"]))):
            return found, str(row["name"])
    if name and (found := of_history(result, name)):
        return found, name
    for row in shown["rows"]:
        one = str(row["name"])
        if shown["kind"] == "scalars" and (found := of_scalar(result, one)):
            return found, one
    for one in result.scalar_names:
        if found := of_scalar(result, one):
            return found, one
    return None, name


def _untold(result: StudyResult, shown: Content) -> str:
    """Say why nothing is told of what matters, and what would tell."""
    if not any("input" in method.node.children["statistics"].to_dataset().coords or method.samples is not None
               for method in result.methods.values()):  # fmt: skip
        return "The results do not tell: there are no inputs in them."
    if shown["kind"] == "requirements":
        return "The results do not tell: collocation and Galerkin do, and so does the method reliability."
    return "The results do not tell: collocation and Galerkin do, and so do 30 samples, four for each input."


def _bars(found: Influences, of_what: str) -> Content:
    """Return the bars of a tornado: the largest first, the rest as one line."""
    largest = max((abs(share) for share in found.shares), default=0.0)
    scale = max(largest, 1.0) if not found.signed else max(largest, 1e-12)
    count = LINES + 1 if len(found.names) == LINES + 1 else LINES
    bars = [
        {
            "name": one,
            "text": found.written(k),
            "width": f"{100 * min(abs(found.shares[k]) / scale, 1.0):.1f}",
            "lowers": found.shares[k] < 0 and found.signed,
            # of the bar, what the input explains alone, where inputs act together
            "alone": f"{100 * min(max(found.alone[k] / found.shares[k], 0.0), 1.0):.1f}"
            if found.together and found.shares[k] > 0
            else None,
        }
        for k, one in enumerate(found.names[:count])
    ]
    rest = found.names[count:]
    others = f"{format_count(len(rest), 'other')}, each at most {found.written(count).lstrip('+−')}" if rest else ""
    return {"of": of_what, "bars": bars, "others": others, "kind": found.kind, "together": found.together}


def _failures(result: StudyResult) -> list[str]:
    """Say which methods had failures."""
    return [
        f"{method.failures} of {format_count(method.realisations, 'realisation')} of {label} failed"
        for label, method in result.methods.items()
        if method.failures
    ]


def _picture(result: StudyResult, name: str) -> Content | None:
    """Return the chart of the output in view, with its limit; without one, of what is asked."""
    if name:
        holders = {one.method: result.methods[one.method].node for one in result.assessment.of(name)}
        limits = result.limits_of(name)
        said = "; dotted, what limits it" if limits else ""
        words = f"{name} by {', '.join(holders)}: the mean, and the bands of 50 % and 95 % of the realisations{said}."
        chart = figures.bands_chart(holders, name, limits=limits)
        if several(chart):
            return _charted(chart, words)
        density = only_density(holders, name)
        return None if density is None else _charted(*density)
    if violated := _violations(result):
        return violated
    scalars = figures.scalars_chart(result.nodes, name) if result.scalar_names else None
    if scalars is None:
        return None
    return _charted(scalars, "How the outputs without a time are distributed: the area under each density is 1.")


def _violations(result: StudyResult) -> Content | None:
    """Return the chart of how requirements are violated over time; None if none is after the beginning."""
    found = answers(result.nodes)
    if not found:
        return None
    worst = max(found, key=lambda one: answer_of(result, one).probability)
    first = answer_of(result, worst).method
    nodes = {label: result.nodes[label] for label in dict.fromkeys([first, *result.nodes])}
    chart = figures.worst_violations_chart(nodes)
    if chart is None:
        return None
    of_requirements = len(chart.curves) > 1 and chart.curves[0].name not in nodes
    by = f", by {first}" if of_requirements else ""
    return _charted(chart, f"How probably each requirement has been violated by a time{by}; bars are 95 % intervals.")


def _charted(chart: Chart | Views, words: str) -> Content:
    return charted(chart, words, words, "first-screen")
