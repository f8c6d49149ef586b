"""Sections on scalar outputs and event times: statistics of all methods, and densities."""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.report import figures
from uqmbd.report.charts import Views, charted
from uqmbd.report.figures import MOST_SCALARS, events_in_words, failure_reasons, has_events
from uqmbd.report.sections.about_results.output_words import quantile_interval
from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import Method, StudyResult
from uqmbd.results.assessment import worst_integration_share
from uqmbd.wording import Cell, format_at_most, format_cells, format_count, format_index, format_percent, format_share

__all__ = ["EVENTS", "SCALARS"]


def describe_scalars(result: StudyResult) -> Content | None:
    """Return the content of the section; None if there are no such outputs."""
    inner = result.scalars.values()
    statistics = {method.label: method.statistics for method in inner}
    names = [name for name in result.scalar_names if name not in result.series]
    if not result.scalar_names:
        return None
    rows = [row for name in names for row in _rows(inner, name)]
    drawn = (
        [
            charted(
                lambda: figures.scalars_chart(result.nodes),
                f"Probability densities of {', '.join(names[:MOST_SCALARS])}.",
                "Probability densities. Bars: histogram of the first method with samples. Curves: kernel density "
                "estimates (for a surrogate, of its samples).",
                "outputs-without-time",
            )
        ]
        if names and any({"samples", "chaos"} & set(method.node.children) for method in inner)
        else []
    )
    if result.series:
        drawn.append(
            charted(
                lambda: figures.series_chart(statistics),
                "Means and quantiles of series of scalar outputs.",
                "Series of scalar outputs: mean, and band of 95 % of the realisations.",
                "series-of-outputs",
            )
        )
    return {
        "words": [*_integration(inner), *_bounds(inner), *(text for method in inner for text in _words(method))],
        "rows": rows,
        "influence": any(row["influence"] for row in rows),
        "stated": any(row["error"] for row in rows),
        "within": any("quantile_interval" in method.statistics for method in inner),
        "figures": drawn,
    }


SCALARS = TemplateSection("Scalar outputs", "scalars", describe_scalars)


def _rows(methods: Iterable[Method], name: str) -> list[dict[str, Any]]:
    """Return the rows of an output, one for each method, with the same number of digits."""
    some = [method for method in methods if name in method.names]
    data, units = [method.of(name) for method in some], some[0].units(name)
    scale = float(np.fmax.reduce([float(one["std"]) for one in data], initial=0.0))
    columns: dict[str, Sequence[Cell | str]] = {}
    for value in ("mean", "std"):
        errors = [float(one.get(f"std_error_{value}", math.nan)) for one in data]
        at = [float(one[value]) for one in data]
        columns[value] = format_cells(at, units, errors, scale if value == "mean" else 0.0)
    for level in (0.05, 0.95):
        found = [one["quantile"].sel(probability=level, method="nearest") for one in data]
        known = [float(one) if abs(float(one["probability"]) - level) < 1e-6 else math.nan for one in found]
        columns[f"q{level}"] = format_cells(known, units, scale=scale)
        columns[f"within{level}"] = [_within(one, level, scale) for one in data]
    return [
        {"output": name, "method": method.label, "influence": strongest_input(one), "error": _error(one)}
        | {key: cells[k] for key, cells in columns.items()}
        for k, (method, one) in enumerate(zip(some, data, strict=True))
    ]


def _within(data: xr.Dataset, level: float, scale: float) -> str:
    """Return the 95 % interval of a quantile as text; empty if it is not stored."""
    ends = quantile_interval(data, level)
    if ends is None:
        return ""
    low, high = format_cells(ends.values.tolist(), scale=scale)
    return f"{low} to {high}"


def strongest_input(data: xr.Dataset) -> str:
    """Name the input with the largest share in the variance."""
    for name, dim in (("sobol_total", "input"), ("sobol_total_germ", "germ")):
        if name in data and float(data["std"]) > 0:
            values = data[name].values
            top = int(np.argmax(values))
            ends = data[f"{name}_interval"].values[:, top] if f"{name}_interval" in data else ()
            return f"{data[dim].values[top]!s} ({format_index(float(values[top]), *map(float, ends))})"
    return ""


def _bounds(methods: Iterable[Method]) -> list[str]:
    """State upper bounds of the probability that an event does not occur, if it occurred in all realisations."""
    sentences = []
    for method in methods:
        if "censored_bound" not in method.statistics:
            continue
        shares, bounds = (method.statistics[name].values for name in ("censored", "censored_bound"))
        certain = (shares == 0) & (bounds > 0)
        if certain.any():
            names = [name for name, here in zip(method.names, certain, strict=True) if here]
            happen = ("occurs", "it") if len(names) == 1 else ("occur", "they")
            sentences.append(
                f"With {method.label}, {', '.join(names)} {happen[0]} in all computed realisations; {happen[1]} may "
                f"be absent in at most {format_share(float(bounds[certain].max()))} of all realisations (95 % "
                "confidence)."
            )
    return sentences


def _integration(methods: Iterable[Method]) -> list[str]:
    """State the largest error of the time integration, with its method."""
    found = [(one, m.label) for m in methods if (one := worst_integration_share(m.node)) is not None]
    known = [(one, label) for one, label in found if math.isfinite(one.share)]
    if not known:
        return []
    worst, label = max(known, key=lambda pair: pair[0].share)
    where = f"{worst.output}, with {label}" if len(known) > 1 else worst.output
    size = format_at_most(worst.share, worst.whole) if worst.share else worst.words()
    return [f"The integration error is {size} (of {where})."]


def _error(data: xr.Dataset) -> str:
    """Return the stated error of a surrogate as text."""
    share = float(data.get("verification_error", math.nan))
    return format_percent(share) if math.isfinite(share) else ""


def _words(method: Method) -> list[str]:
    label = method.label
    words = []
    if method.fit and method.failures:
        words.append(f"With {label}: {method.fit}.")
    late = method.statistics.get("censored")
    for name, share in zip(method.names, [] if late is None else late.values, strict=False):
        if not share == 0:
            part = "some" if math.isnan(share) else format_share(float(share))
            known = name not in json.loads(method.node.attrs.get("refused", "{}"))
            words.append(
                f"With {label}, {name} does not occur in {part} of the realisations by the last time; "
                + (
                    "its statistics use the other realisations."
                    if known
                    else "it has no statistics here, because a surrogate would be an extrapolation."
                )
            )
    if method.failures:
        first = [] if method.samples is None else failure_reasons(method.samples)
        reason = f" Most frequent reason: {first[0].text}" if first else ""
        words.append(
            f"With {label}, {method.failures} of {format_count(method.realisations, 'realisation')} lack scalar "
            f"outputs and do not enter the statistics.{reason}"
        )
    return words


def events(result: StudyResult) -> Content | None:
    """Return the content of the section for each method that followed events; None without such a method."""
    drawn = []
    for label, node in result.nodes.items():
        if not has_events(node):
            continue
        try:
            words = events_in_words(node)
        except Exception as error:  # noqa: BLE001 - results of other packages may be invalid in any way; the rest must remain
            words = f"The event times cannot be read: {type(error).__name__}: {error}"
        drawn.append(
            charted(
                functools.partial(_chart, node),
                f"Distributions of event times, from samples of {label}. {words}",
                f"Event times, from samples of {label}. {words}",
                f"{label}-event-times",
            )
        )
    return {"figures": drawn} if drawn else None


def _chart(node: xr.DataTree) -> Views:
    return figures.events_chart(figures.earliest_events(node))


EVENTS = TemplateSection("Event times", "events", events)
