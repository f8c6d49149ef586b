"""Content of the first screen of the report: results, motion of the mechanism, and a chart of one output."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import xarray as xr

from uqmbd.names import ANY
from uqmbd.plugins import InputTreatment, such_as
from uqmbd.report import figures
from uqmbd.report.charts import Chart, Views, charted
from uqmbd.report.figures import band_edges
from uqmbd.report.overview.influences import FEWEST_SAMPLES, SAMPLES, Influences, of_history, of_requirement, of_scalar
from uqmbd.report.overview.margins import chart_in_view, margin_words, tightening, yield_words
from uqmbd.report.overview.pictures import mechanism_picture, pose_pictures
from uqmbd.report.sections import Content, TemplateSection, only_density, ranked
from uqmbd.report.view import Method, StudyResult
from uqmbd.results import Answer, answers
from uqmbd.results.assessment import NO_VARIATION, OutputReliability
from uqmbd.results.requirements import met_in_words
from uqmbd.typing import Array
from uqmbd.wording import (
    format_cells,
    format_count,
    format_duration,
    format_interval_ends,
    format_probability,
    resolved_width,
)

__all__ = ["ANSWERS", "answer_of", "in_view", "results_table"]


ROWS = 5
"""Maximum number of table rows on the first screen."""

MET, UNMET, UNSURE = ("✓", "met", 2), ("✗", "not met", 0), ("!", "not certain", 1)


def results_table(result: StudyResult) -> Content:
    """Return the table of results.

    The keys are ``kind`` (``requirements``, ``outputs`` or ``scalars``), ``rows``, ``more`` (omitted rows) and
    ``allowed`` (allowed probability of violation). Requirements have ``yield`` and ``margins`` (heading of margins).
    """
    allowed = result.tree.attrs.get("allowed_probability")
    if found := answers(result.nodes):
        rows = [_requirement(result, name) for name in found]
        # sort by descending probability; the row of any violation is last
        rows.sort(key=lambda row: (row["name"] == ANY, -row["probability"]))
        more = len(rows) - ROWS
        shown = [*rows[: ROWS - 1], rows[-1]] if more > 0 else rows
        words = "" if allowed is None else format_probability(float(allowed))
        whole = rows[-1]["name"]  # "any" if there are several requirements, otherwise the only requirement
        return {
            "kind": "requirements",
            "rows": shown,
            "more": max(more, 0),
            "allowed": words,
            "yield": yield_words(answer_of(result, whole), len(rows) > 1),
            "margins": _margin_head([row["margin"] for row in shown]),
        }
    if names := result.histories:
        every = [one for name in ranked(result, names) for one in result.assessment.of(name)]
        reasons = _alike(
            [of_history(result.alike(one.method), one.quantity) for one in every[:ROWS]],
            lambda k: of_history(result.alike(every[k].method), every[k].quantity, correlations=True),
        )
        rows = [_history(result, one, because) for one, because in zip(every, reasons, strict=False)]
        return {"kind": "outputs", "rows": rows, "more": len(every) - len(rows), "allowed": ""}
    every = [one for name in result.single_scalars for one in result.assessment.of(name, "scalar")]
    reasons = _alike(
        [of_scalar(result.alike(one.method), one.quantity) for one in every[:ROWS]],
        lambda k: of_scalar(result.alike(every[k].method), every[k].quantity, correlations=True),
    )
    rows = [_scalar(result, one, because) for one, because in zip(every, reasons, strict=False)]
    return {"kind": "scalars", "rows": rows, "more": len(every) - len(rows), "allowed": ""}


def _margin_head(margins: Sequence[tuple[str, str, str]]) -> str:
    """Return the heading of the column of margins; empty if no margin is known."""
    known = [units for mean, _, units in margins if mean]
    return f"Mean margin{'' if all(known) else ', in units of the limit'}" if known else ""


def in_view(result: StudyResult) -> str:
    """Return the name of the output in the chart: the output with the most probable violation of a limit.

    Without limits, return the most uncertain output.
    """
    names, found = result.histories, answers(result.nodes)
    limited = [one for one in result.limits if one["output"] in names and one["requirement"] in found]
    if limited:
        worst = max(limited, key=lambda one: answer_of(result, str(one["requirement"])).probability)
        return str(worst["output"])
    return ranked(result, names)[0] if names else ""


def answer_of(result: StudyResult, name: str) -> Answer:
    """Return the result for a requirement of the method whose numbers are displayed."""
    return answers(result.nodes)[name][result.assessment.of(name, "requirement")[0].method]


def _requirement(result: StudyResult, name: str) -> Content:
    one, (found,) = answer_of(result, name), result.assessment.of(name, "requirement")
    sign, verdict, level = "", "", 3
    if "allowed_probability" in result.tree.attrs:
        sign, verdict, level = {True: MET, False: UNMET, None: UNSURE}[found.met]
        if found.met is None:
            every = answers(result.nodes)[name].values()
            verdict = met_in_words(every, float(result.tree.attrs["allowed_probability"])) or verdict
    return {
        "name": name,
        "meaning": one.meaning,
        "probability": one.probability if math.isfinite(one.probability) else 1.0,
        "value": format_probability(one.probability, resolved_width(one.lower, one.upper), one.upper),
        "interval": format_interval_ends(one.lower, one.upper),
        "sign": sign,
        "verdict": verdict,
        "sign_level": level,
        "margin": margin_words(result, name, one.method),
        "because": _because(of_requirement(result, name)) if name != ANY else "",
        "method": one.method,
        "known": found,
    }


def _alike(found: list[Influences | None], correlated: Callable[[int], Influences | None]) -> list[Influences | None]:
    """Return influences of the same kind for one column: if any of them are correlations, replace effects by these."""
    if not any(one is not None and one.correlations for one in found):
        return found
    return [correlated(k) if one is not None and one.signed else one for k, one in enumerate(found)]


def _because(found: Influences | None) -> str:
    return "" if found is None else found.words


def _history(result: StudyResult, one: OutputReliability, because: Influences | None) -> Content:
    name, method = one.quantity, result.methods[one.method]
    data, units = method.of(name), method.units(name)
    row = {"name": one.name, "meaning": "", "method": method.label, "extremes": _extremes(data, units), "known": one}
    if one.level == 3:
        return {**row, "spread": "none", "when": "", "note": NO_VARIATION, "because": ""}
    std = np.nan_to_num(data["std"].values, nan=-1.0)
    at = int(std.argmax())
    return {
        **row,
        "spread": str(format_cells([float(std[at])], units)[0]),
        "when": f"{float(data['time'][at]):.4g} s",
        "note": "",
        "because": _because(because),
    }


def _extremes(data: xr.Dataset, units: str) -> Content:
    """Return the minimum and the maximum of the 95 % band over time, and their times, s."""
    (low, high), _, kind = band_edges(data)
    times = np.asarray(data["time"].values, dtype=float)
    ends = [_at(low, times, np.nanargmin), _at(high, times, np.nanargmax)]
    shown = [value for value, _ in ends]
    return {
        "low": str(format_cells(shown)[0]),
        "high": str(format_cells(shown, units)[1]),
        "low_at": f"{ends[0][1]:.4g} s",
        "high_at": f"{ends[1][1]:.4g} s",
        "what": kind,
    }


def _at(values: Array, times: Array, which: object) -> tuple[float, float]:
    if not np.isfinite(values).any():
        return math.nan, math.nan
    k = int(which(values))  # type: ignore[operator]
    return float(values[k]), float(times[k])


def _scalar(result: StudyResult, one: OutputReliability, because: Influences | None) -> Content:
    numbers = _of_scalar(result.scalars[one.method], one.quantity)
    row = {"name": one.name, "meaning": "", "method": one.method, "known": one}
    return {**row, **numbers, "because": _because(because)}


def _of_scalar(method: Method, name: str) -> Content:
    data, units = method.of(name), method.units(name)
    levels = data["probability"].values
    ends = []
    for p in (0.025, 0.975):
        k = int(np.abs(levels - p).argmin()) if levels.size else -1
        known = k >= 0 and abs(levels[k] - p) < 1e-6
        ends.append(float(data["quantile"].values[k]) if known else math.nan)
    known = bool(np.isfinite(ends).all())
    std = float(data["std"])
    (mean,), (spread,) = format_cells([float(data["mean"])], units, scale=std), format_cells([std], units)
    return {
        "mean": str(mean),
        "spread": str(spread),
        "interval": f"{format_cells(ends)[0]} to {format_cells(ends, units)[1]}" if known else "unknown",
    }


LINES = 5  # maximum number of lines on reliability, and of bars of main contributors, on the first screen


def content(result: StudyResult) -> Content:
    """Return the texts and charts of the first screen."""
    shown = results_table(result)
    name = in_view(result)
    found, quantity = _influences(_latest(result), shown, name)
    known = result.assessment
    lines = _lines(result.distinct(known.reliability))
    return {
        "contributions": [],
        "problems": [*result.problems, *known.contradictions],
        "failures": _failures(result),
        "results_table": shown,
        "mechanism": mechanism_picture(result),
        "timeless": all(node.dataset.sizes.get("time", 0) < 2 for node in result.tree.subtree),
        "picture": _picture(result, name),
        "poses": pose_pictures(result),
        "in_view": name,
        "matters": None if found is None else _bars(found, quantity) | _tightened(result, shown, found, quantity),
        "no_influences": _why_no_influences(result, shown),
        "reliability": lines[:LINES],
        "more_lines": max(len(lines) - LINES, 0),
        "next": {"methods": _costs(result), "words": known.recommendation},
    }


ANSWERS = TemplateSection("Answers", "answers", content)


def _lines(found: Sequence[OutputReliability]) -> list[Content]:
    """Return one line for each quantity, or, with several populations, for each method, kind and level."""
    groups: dict[tuple[object, ...], list[OutputReliability]] = {}
    for k, one in enumerate(found):
        groups.setdefault((one.method, one.kind, one.level) if one.population else (k,), []).append(one)
    return [
        {
            "level": worst.level,
            "sign": worst.sign,
            "word": worst.word,
            "name": worst.name if not rest else f"{', '.join(one.quantity for one in (worst, *rest))} ({worst.method})",
            "reason": worst.reason if not rest else f"{worst.quantity}: {worst.reason}",
        }
        for worst, *rest in groups.values()
    ]


def _costs(result: StudyResult) -> list[Content]:
    """Return the costs of the recommended methods, or of the only method if it is reliable."""
    known = result.assessment
    fine = all(one.level > 0 for one in known.reliability)
    labels = known.recommended or (result.methods if len(result.methods) == 1 and fine else ())
    some = [result.methods[label] for label in labels]
    counts = [f"{format_count(m.total_realisations, 'realisation')}, {format_duration(m.wall_time)}" for m in some]
    return [{"label": method.label, "cost": cost} for method, cost in zip(some, counts, strict=True)]


def _latest(result: StudyResult) -> StudyResult:
    """Return the result for the last population of the inputs, such as the population after a calibration."""
    labels = [label for label, method in result.methods.items() if method.population]
    return result.alike(labels[-1]) if labels else result


def _influences(result: StudyResult, shown: Content, name: str) -> tuple[Influences | None, str]:
    """Return influences and the name of the influenced quantity.

    The quantity is the most probable violation with known influences, otherwise the output in the chart, otherwise a
    scalar output.
    """
    for row in shown["rows"]:
        if shown["kind"] == "requirements" and (found := of_requirement(result, str(row["name"]))):
            return found, str(row["name"])
    if name and (found := of_history(result, name)):
        return found, name
    for row in shown["rows"]:
        one = str(row["name"])
        if shown["kind"] == "scalars" and (found := of_scalar(result, one)):
            return found, one
    for one in result.single_scalars:
        if found := of_scalar(result, one):
            return found, one
    return None, name


def _why_no_influences(result: StudyResult, shown: Content) -> str:
    """State why the influence of inputs is unknown, and name a method that computes it."""
    if not any("input" in method.node.children["statistics"].to_dataset().coords or method.samples is not None
               for method in result.methods.values()):  # fmt: skip
        return "The results contain no inputs, so their influence is unknown."
    fitting, searching = such_as(InputTreatment.INTERPOLATE), such_as(searches_violations=True)
    if shown["kind"] == "requirements":
        return (
            f"The influence of the inputs is unknown. Methods that search for violations{searching} compute it, and so "
            f"do methods with a surrogate{fitting}, except for outputs that depend on sampled paths."
        )
    return (
        f"The influence of the inputs is unknown. Methods with a surrogate{fitting} compute it, except for outputs "
        f"that depend on sampled paths. So do at least {FEWEST_SAMPLES} stored samples, and {SAMPLES} for each input."
    )


def _bars(found: Influences, quantity: str) -> Content:
    """Return the largest bars of a tornado chart, and a text on the other influences."""
    largest = max((abs(share) for share in found.shares), default=0.0)
    scale = max(largest, 1.0) if not found.signed else max(largest, 1e-12)
    count = LINES + 1 if len(found.names) == LINES + 1 else LINES
    bars = [
        {
            "name": one,
            "text": found.written(k),
            "width": f"{100 * min(abs(found.shares[k]) / scale, 1.0):.1f}",
            "lowers": found.shares[k] < 0 and found.signed,
            # if inputs interact: the part of the bar that is due to the input alone
            "alone": f"{100 * min(max(found.alone[k] / found.shares[k], 0.0), 1.0):.1f}"
            if found.together and found.shares[k] > 0
            else None,
        }
        for k, one in enumerate(found.names[:count])
    ]
    rest = found.names[count:]
    others = f"{format_count(len(rest), 'other')}, each at most {found.written(count).lstrip('+−')}" if rest else ""
    return {"of": quantity, "bars": bars, "others": others, "kind": found.kind, "together": found.together}


def _tightened(result: StudyResult, shown: Content, found: Influences, quantity: str) -> Content:
    """Return the effect of a tighter tolerance of each displayed input on a requirement.

    The value of the key ``halved`` is None if the quantity is not a requirement, or if the effect is unknown.
    """
    if shown["kind"] != "requirements" or quantity not in (str(row["name"]) for row in shown["rows"]):
        return {"halved": None}
    return {"halved": tightening(result, quantity, found.names[: LINES + 1])}


def _failures(result: StudyResult) -> list[str]:
    """List the methods with failures."""
    return [
        f"{method.failures} of {format_count(method.realisations, 'realisation')} of {label} failed"
        for label, method in result.methods.items()
        if method.failures
    ]


def _picture(result: StudyResult, name: str) -> Content | None:
    """Return the chart of the output in view, with its limit if a requirement states one."""
    if name:
        if found := chart_in_view(result, name):
            chart, caption = found
            unreliable = [one.method for one in result.assessment.of(name) if one.level == 0]
            if unreliable:
                caption += f" {' and '.join(unreliable)}: unreliable; see Reliability of the results."
            return _charted(chart, caption)
        holders = {one.method: result.methods[one.method].node for one in result.assessment.of(name)}
        density = only_density(holders, name)
        return None if density is None else _charted(*density)
    if violated := _violations(result):
        return violated
    scalars = figures.scalars_chart(result.nodes, name) if result.scalar_names else None
    if scalars is None:
        return None
    return _charted(scalars, "Probability densities of the scalar outputs.")


def _violations(result: StudyResult) -> Content | None:
    """Return the chart of violation probabilities over time; None if no requirement is violated after the start."""
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
    return _charted(chart, f"Probability of a violation up to each time{by}. Bars are 95 % intervals.")


def _charted(chart: Chart | Views, words: str) -> Content:
    return charted(chart, words, words, "first-screen")
