"""Section on requirements: the probability of violation by each method, and over time."""

from __future__ import annotations

import numpy as np
import xarray as xr

from uqmbd.report import figures
from uqmbd.report.charts import charted
from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import StudyResult
from uqmbd.results import answers
from uqmbd.results.requirements import differing
from uqmbd.wording import format_integer, format_percent

__all__ = ["REQUIREMENTS"]


def _rows(result: StudyResult) -> Content:
    """Return the table with a row for each requirement and method, and the methods that contradict each other."""
    found = answers(result.nodes)
    rows = [
        {
            "requirement": name,
            "description": one.description,
            "condition": one.relation,
            "method": one.method,
            "words": one.words,
        }
        for name, by_method in found.items()
        for one in by_method.values()
    ]
    return {"rows": rows, "differing": [f"{sentence}." for sentence in differing(result.nodes)]}


def content(result: StudyResult) -> Content | None:
    """Return the content of the section; None if there are no requirements."""
    if not answers(result.nodes):
        return None
    drawn = []
    if any(figures.changing_with_time(data) for data in _data(result).values()):
        drawn = [
            charted(
                lambda: figures.violations_chart(result.nodes),
                "Probability of a violation up to each time.",
                "Probability of a violation up to each time. Bars at the end are 95 % intervals for the whole motion.",
                "requirements",
            )
        ]
    return {"words": _words(result), "figures": drawn, "table": _rows(result)}


REQUIREMENTS = TemplateSection("Requirements", "requirements", content)


def _data(result: StudyResult) -> dict[str, xr.Dataset]:
    return {k: n.children["requirements"].to_dataset() for k, n in result.nodes.items() if "requirements" in n.children}


def _words(result: StudyResult) -> list[str]:
    """State, for each method, the source of the probabilities, and the errors that widen their intervals."""
    sentences = []
    for label, data in _data(result).items():
        sentence = f"{label}: {data.attrs.get('how', 'as the method defines it')}."
        failed = float(data.attrs.get("failed", 0))
        if failed >= 1:
            sentence += f" {format_integer(failed)} realisations failed; they may or may not violate the requirements."
        elif failed > 0:
            sentence += (
                f" {format_percent(failed)} of the realisations failed; they may or may not violate the requirements."
            )
        if "uncertain" in data and bool((data["uncertain"] > 0).any()):
            worst = data.isel(requirement=int(np.argmax(data["uncertain"].values)))
            sentence += (
                f" {format_percent(float(worst['uncertain']))} of the samples are nearer to the limit of "
                f"{worst['requirement'].item()!r} than the error of the surrogate."
            )
        sentences.append(sentence)
    return sentences
