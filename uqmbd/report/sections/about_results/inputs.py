"""The report's section on what was uncertain: a table of the inputs, and how they were sampled."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from uqmbd.errors import StudyError
from uqmbd.report import figures
from uqmbd.report.charts import charted
from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import Method, StudyResult, dataset_of
from uqmbd.wording import typeset_units

if TYPE_CHECKING:
    from uqmbd.randomness import GermSpace

__all__ = ["INPUTS", "input_rows"]


def inputs(result: StudyResult) -> Content:
    """Return what the section says and shows."""
    return {"rows": input_rows(result), "figure": _figure(result.methods) or _figure(result.scalars)}


INPUTS = TemplateSection("What was uncertain", "inputs", inputs)


def input_rows(result: StudyResult) -> list[dict[str, str]]:
    """Return the table of inputs: name, distribution and units, from the first method that tells."""
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
    lines = "smooth estimates of the density" if space is None else "the densities of their distributions"
    caption = f"The inputs as {first.label} sampled them: bars are histograms, lines {lines}."
    return charted(
        lambda: figures.inputs_chart(first.node, space),
        "Histograms of the sampled inputs.",
        caption,
        "inputs",
    )


def _space(sampled: Method, methods: Sequence[Method]) -> GermSpace | None:
    """Return the germs and distributions of the inputs, from a surrogate of the same population that stores them."""
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
