"""The report's section on which inputs matter."""

from __future__ import annotations

import functools

from uqmbd.report import figures
from uqmbd.report.charts import charted
from uqmbd.report.figures import OF_GERMS, Indices, has_indices, indices_of, label_of, node_with_indices
from uqmbd.report.sections.about_results.outputs import most_uncertain
from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import StudyResult
from uqmbd.results.assessment import STILL
from uqmbd.wording import format_share

__all__ = ["INFLUENCE"]

_MINOR = 0.01


def influence(result: StudyResult) -> Content | None:
    """Return what the section says and shows; None if no method knows."""
    nodes = result.nodes
    if not any(has_indices(node) for node in nodes.values()):
        return None
    node = node_with_indices(nodes)
    label = label_of(node)
    found = {name: indices_of(node, name) for name in result.methods[label].names}
    varying = {name: one for name, one in found.items() if one.meaningful.any()}
    if not varying:
        return {"words": [f"No output has a spread to share: each {STILL}."], "rows": [], "figures": [], "outputs": []}
    first = next(iter(varying.values()))
    kind = "germ" if first.of_germs else "input"
    words = []
    if result.several:
        words.append(f"These are Sobol' indices of {label}.")
    if first.of_germs:
        words.append(
            "The inputs depend on one another, so that no share of the variance belongs to an input alone. The shares "
            f"are those of independent germs, in the order in which the inputs were declared: {OF_GERMS}."
        )
    if len(first.names) == 1:
        words.append(f"There is one input, {first.names[0]}: all variance comes from it.")
        return {"words": words, "rows": [], "figures": [], "outputs": list(varying), "kind": kind}
    shares = {name: one.weighted for name, one in varying.items()}
    minor = [n for k, n in enumerate(first.names) if all(total[k] < _MINOR for _, total in shares.values())]
    if minor:
        words.append(f"Taking part in less than 1 % of the variance of every output: {', '.join(minor)}.")
    rows = [
        {
            "name": name,
            "cells": [f"{format_share(total[k])} ({format_share(alone[k])})" for alone, total in shares.values()],
        }
        for k, name in enumerate(first.names)
    ]
    shown = most_uncertain(result, list(varying))
    drawn = [
        charted(
            functools.partial(figures.indices_chart, one, name),
            f"Sobol' indices of {name} over time. {_in_words(name, one)}",
            _in_words(name, one),
            f"{name}-sobol-indices",
            on_paper=functools.partial(figures.indices_charts, one, name),
        )
        for name, one in varying.items()
        if name in shown
    ]
    if len(drawn) < len(varying):
        words.append(f"Figures are those of the {len(drawn)} most uncertain outputs; the table is that of all.")
    return {"words": words, "kind": kind, "outputs": list(varying), "rows": rows, "figures": drawn}


INFLUENCE = TemplateSection("Which inputs matter", "influence", influence)


def _in_words(name: str, one: Indices) -> str:
    """Say which inputs take part in most of the variance."""
    _, total = one.weighted
    ranked = sorted(range(len(total)), key=lambda k: -total[k])
    largest = [k for k in ranked[:3] if total[k] >= _MINOR] or ranked[:1]
    parts = [
        f"{one.names[k]} takes part in {format_share(total[k])} of the variance of {name}"
        if not n
        else f"{one.names[k]} in {format_share(total[k])}"
        for n, k in enumerate(largest)
    ]
    return f"Averaged over time, {', '.join(parts)}."
