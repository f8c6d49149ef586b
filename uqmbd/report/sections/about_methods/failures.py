"""Section on failures of each method: number, reasons, and inputs that separate failed and successful samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uqmbd.report import figures
from uqmbd.report.charts import charted
from uqmbd.report.drawing import with_units
from uqmbd.report.figures import ENOUGH, FailureGroup, failure_reasons, failure_words, runs_of
from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import Method, StudyResult
from uqmbd.status import Status
from uqmbd.wording import format_integer, minus

__all__ = ["FAILURES"]

_SHOWN_FAILURES = 20
_SHOWN_REASONS = 6


def describe_failures(result: StudyResult) -> Content:
    """Return the content of the section for each method."""
    fine = [method for method in result.methods.values() if not method.failures]
    rest = [method for method in result.methods.values() if method.failures or method.lacking]
    return {"fine": _fine(fine, len(result.methods)), "methods": [_of_method(method) for method in rest]}


FAILURES = TemplateSection("Failures", "failures", describe_failures, "about_methods.html.j2")


def _fine(methods: Sequence[Method], count: int) -> str:
    """List the methods without failures in one sentence."""
    if not methods:
        return ""
    if len(methods) == count:
        return "No realisation failed."
    return f"No realisation of {', '.join(method.label for method in methods)} failed."


def _of_method(method: Method) -> Content:
    total, failed = method.realisations, method.failures
    found: Content = {
        "label": method.label,
        "count": failed,
        "total": total,
        "share": _share(failed, total),
        "reasons": [],
        "names": [],
        "rows": [],
        "hidden": 0,
        "stored": "",
        "fit": method.fit,
        "lacking": method.lacking,
    }
    samples = runs_of(method.node)
    if samples is None or not failed:
        return found
    reasons = failure_reasons(method.node)
    seen = sum(len(r.samples) for r in reasons)
    if samples.sizes["sample"] < total:
        found["stored"] = format_integer(samples.sizes["sample"])
    units = samples["input_units"].values if "input_units" in samples.coords else [""] * samples.sizes["input"]
    found["names"] = [with_units(str(n), str(u)) for n, u in zip(samples["input"].values, units, strict=True)]
    found["reasons"] = [
        {
            "kind": r.kind,
            "reason": r.text,
            "count": len(r.samples),
            "share": _share(len(r.samples), seen),
            "words": (words := failure_words(method.node, r)),
            "figure": _figure(method, r, number, words) if found["names"] and len(r.samples) >= ENOUGH else None,
        }
        for number, r in enumerate(reasons[:_SHOWN_REASONS], 1)
    ]
    found["more_reasons"] = len(reasons) - len(found["reasons"])
    which = np.flatnonzero(samples["status"].values != Status.OK)
    drawn = samples["inputs"].values
    found["rows"] = [
        {"sample": int(k), "inputs": [minus(f"{float(v):.6g}") for v in drawn[k]]} for k in which[:_SHOWN_FAILURES]
    ]
    found["hidden"] = len(which) - len(found["rows"])
    return found


def _figure(method: Method, group: FailureGroup, number: int, words: list[str]) -> Content:
    return charted(
        lambda: figures.failures_chart(method.node, group),
        f"Inputs of failed and successful samples. {' '.join(words)}",
        "Each mark is a sample. Pale points succeeded; crosses failed for this reason.",
        f"failures-{method.label}-{number}",
    )


def _share(part: int, whole: int) -> str:
    return f"{100 * part / whole:.3g} %" if whole else ""
