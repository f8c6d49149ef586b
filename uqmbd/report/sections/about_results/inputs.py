"""Sections on the inputs: their distributions, their influence, and sliders for other values."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from uqmbd.errors import StudyError
from uqmbd.report import figures, live
from uqmbd.report.charts import charted, json_script
from uqmbd.report.figures import OF_GERMS, Indices, has_indices, indices_of, label_of, node_with_indices
from uqmbd.report.sections.about_results.outputs import most_uncertain
from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import Method, StudyResult, dataset_of
from uqmbd.results.assessment import NO_VARIATION
from uqmbd.wording import format_percent, typeset_units

if TYPE_CHECKING:
    from uqmbd.randomness import GermSpace

__all__ = ["EXPLORE", "INFLUENCE", "INPUTS", "input_rows"]


def describe_inputs(result: StudyResult) -> Content:
    """Return the content of the section."""
    return {"rows": input_rows(result), "figure": _figure(result.methods) or _figure(result.scalars)}


INPUTS = TemplateSection("Uncertain inputs", "inputs", describe_inputs)


def input_rows(result: StudyResult) -> list[dict[str, str]]:
    """Return the table of inputs with name, distribution and units, from the first method that states them."""
    for method in result.methods.values():
        for child in ("samples", "statistics", "chaos"):
            data = dataset_of(method.node, child)
            if data is None or "input" not in data.coords:
                continue
            columns = []
            for name in ("input", "input_units", "input_description"):
                blank = [""] * data.sizes["input"]
                columns.append([str(v) for v in data[name].values] if name in data.coords else blank)
            return [
                {"name": name, "units": typeset_units(units), "distribution": text or "not stated"}
                for name, units, text in zip(*columns, strict=True)
            ]
    return []


def _figure(methods: Mapping[str, Method]) -> Content | None:
    sampled = (m for m in methods.values() if m.samples is not None and m.samples.sizes.get("input", 0))
    first = next(sampled, None)
    if first is None:
        return None
    space = _space(first, [*methods.values()])
    lines = "kernel density estimates" if space is None else "the densities of their distributions"
    caption = f"Inputs sampled by {first.label}. Bars: histograms; lines: {lines}."
    return charted(
        lambda: figures.inputs_chart(first.node, space),
        "Histograms of the sampled inputs.",
        caption,
        "inputs",
    )


def _space(sampled: Method, methods: Sequence[Method]) -> GermSpace | None:
    """Return the germ space of the inputs from a surrogate of the same population; None without one."""
    from uqmbd.randomness import GermSpace

    population = sampled.node.attrs.get("population")
    for method in methods:
        if method.node.attrs.get("population") != population:
            continue
        for child in method.node.children.values():
            with contextlib.suppress(StudyError):
                if "germ_family" in child.data_vars:
                    return GermSpace.from_dataset(child.to_dataset())
    return None


_MINOR = 0.01


def influence(result: StudyResult) -> Content | None:
    """Return the content of the section; None if no method states influences."""
    nodes = result.nodes
    if not any(has_indices(node) for node in nodes.values()):
        return None
    node = node_with_indices(nodes)
    label = label_of(node)
    found = {name: indices_of(node, name) for name in result.methods[label].names}
    varying = {name: one for name, one in found.items() if one.meaningful.any()}
    if not varying:
        return {
            "words": [f"There are no Sobol' indices: each output {NO_VARIATION}."],
            "rows": [],
            "figures": [],
            "outputs": [],
        }
    first = next(iter(varying.values()))
    kind = "germ" if first.of_germs else "input"
    words = []
    if result.several:
        words.append(f"The Sobol' indices were computed by {label}.")
    if first.of_germs:
        words.append(
            "The inputs are dependent, so the variance cannot be attributed to single inputs. The indices refer to "
            f"the independent germs, in the order in which the inputs were declared: {OF_GERMS}."
        )
    if len(first.names) == 1:
        words.append(f"{first.names[0]} is the only input and causes the whole variance.")
        return {"words": words, "rows": [], "figures": [], "outputs": list(varying), "kind": kind}
    shares = {name: one.weighted for name, one in varying.items()}
    minor = [n for k, n in enumerate(first.names) if all(total[k] < _MINOR for _, total in shares.values())]
    if minor:
        words.append(f"Inputs with total indices below 1 % for every output: {', '.join(minor)}.")
    written = [one.written for one in varying.values()]
    rows = [
        {
            "name": name,
            "cells": [f"{total} ({alone})" for alone, total in (one[k] for one in written)],
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
        words.append(f"The figures show the {len(drawn)} most uncertain outputs; the table lists all.")
    return {"words": words, "kind": kind, "outputs": list(varying), "rows": rows, "figures": drawn}


INFLUENCE = TemplateSection("Sensitivity to inputs", "influence", influence)


def _in_words(name: str, one: Indices) -> str:
    """State the largest total indices, averaged over time."""
    (_, total), written = one.weighted, one.written
    ranked = sorted(range(len(total)), key=lambda k: -total[k])
    largest = [k for k in ranked[:3] if total[k] >= _MINOR] or ranked[:1]
    parts = [
        f"{one.names[k]} contributes to {written[k][1]} of the variance of {name}"
        if not n
        else f"{one.names[k]} to {written[k][1]}"
        for n, k in enumerate(largest)
    ]
    return f"Averaged over time, {', '.join(parts)}."


def explore(result: StudyResult) -> Content | None:
    """Return the data of the sliders, or the reason why they are missing; None if the results contain no inputs.

    ``explorer`` is JSON, or None. ``nearest`` is the number of realisations that replace a surrogate, or 0. ``fitted``
    is true if polynomials replace the model of a plugin, and ``moving`` if the page draws a mechanism. ``notes`` lists
    quantities that do not depend on the sliders, with reasons.
    """
    if not live.live_method(result.tree) and not _sampled(result):
        return None
    moving = result.motion is not None
    try:
        found = live.collect_explorer_data(result.tree, result.limits)
    except Exception as error:  # noqa: BLE001 - results of other packages may be invalid in any way; the report must remain
        found = {"reason": f"{type(error).__name__}: {error}"}
    reason, samples_only = str(found.get("reason", "")), bool(found.get("samples_only"))
    if reason:
        found = _nearest(result) or found
    if "reason" in found:
        notes = [f"This report has no sliders for the inputs: {found['reason']}"]
        return {"explorer": None, "nearest": 0, "moving": moving, "notes": notes}
    fitted = [] if found.get("nearest") else _fitted(found)
    notes = [*fitted, *(f"Some outputs are not evaluated at the chosen inputs: {one}" for one in found["missing"])]
    if reason and not samples_only:
        notes.insert(0, f"The page evaluates no surrogate: {reason}")
    if found["still"]:
        names = ", ".join(found["still"])
        why = f"{found['method']} has no surrogate of their margins"
        notes.append(f"These requirements are not evaluated at the chosen inputs: {names}; {why}.")
    about = {"nearest": found.get("nearest", 0), "fitted": bool(fitted), "moving": moving, "notes": notes}
    return {"explorer": json_script(found), **about}


def _fitted(found: Content) -> list[str]:
    """Return a sentence on the polynomials that replace the model of a plugin; empty without such polynomials."""
    parts = [found[kind]["surrogate"]["fitted"] for kind in ("histories", "scalars", "margins") if found[kind]]
    known = [one for one in parts if one]
    if not known:
        return []
    orders, largest = sorted({one["order"] for one in known}), max(one["difference"] for one in known)
    order = f"order {orders[0]}" if len(orders) == 1 else f"orders {orders[0]} to {orders[-1]}"
    return [
        f"A page cannot evaluate the model {known[0]['model']!r}. The sliders evaluate polynomials of {order} that are "
        "fitted to the model. Their root mean square difference from the model is at most "
        f"{format_percent(largest)} of the standard deviation; the stated errors include this difference."
    ]


def _nearest(result: StudyResult) -> Content | None:
    """Return stored realisations for the sliders, from the first method with samples of inputs; None without one."""
    for label, method in result.methods.items():
        names = [name for name in most_uncertain(result) if name in method.names]
        with contextlib.suppress(StudyError, ValueError):
            if found := live.collect_nearest_data(method.node, label, names, result.limits):
                rest = len(method.names) - len(names)
                missing = [f"the page stores the {len(names)} most uncertain outputs."] if rest > 0 else []
                return found | {"missing": missing}
    return None


def _sampled(result: StudyResult) -> bool:
    """Return whether any method stores outputs at samples of inputs, so that the sliders can select realisations."""
    parts = [one for method in result.methods.values() for one in (method, method.scalars) if one is not None]
    return any(one.samples is not None and one.samples.sizes.get("input", 0) and one.names for one in parts)


EXPLORE = TemplateSection("What-if", "explore", explore)
