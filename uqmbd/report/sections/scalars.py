"""The report's section on outputs without a time: their statistics side by side, and their densities."""

from __future__ import annotations

import json
import math

import numpy as np
import xarray as xr

from uqmbd.report import figures
from uqmbd.report.drawing import image
from uqmbd.report.figures import MOST_SCALARS, failure_reasons
from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import Method, StudyResult
from uqmbd.results import worst_integration_share
from uqmbd.wording import format_count, format_percent, format_quantity, format_share

__all__ = ["SCALARS"]


def scalars(result: StudyResult) -> Content | None:
    """Return what the section says and shows; None if there are no such outputs."""
    names, inner = result.scalar_names, result.scalars.values()
    if not names:
        return None
    rows = [_row(method, name) for name in names for method in inner if name in method.names]
    drawn = (
        [
            image(
                lambda: figures.scalar_densities(result.nodes),
                f"Probability densities of {', '.join(names[:MOST_SCALARS])}.",
                "How they are distributed: bars are the histogram of the first method with samples, curves a smooth "
                "estimate of the density (of a surrogate, from samples of it); the area under each is 1.",
                "outputs-without-time",
            )
        ]
        if any({"samples", "chaos"} & set(method.node.children) for method in inner)
        else []
    )
    return {
        "words": [sentence for method in inner for sentence in _words(method)],
        "rows": rows,
        "influence": any(row["influence"] for row in rows),
        "stated": any(row["error"] for row in rows),
        "figures": drawn,
    }


SCALARS = TemplateSection("Outputs without a time", "scalars", scalars)


def _row(method: Method, name: str) -> dict[str, str]:
    data, units = method.of(name), method.units(name)

    def shown(value: float, error: str = "") -> str:
        return format_quantity(value, units, float(data[error]) if error in data else None)

    found = {"output": name, "method": method.label}
    for value in ("mean", "std"):
        found[value] = shown(float(data[value]), f"std_error_{value}")
    for level in (0.05, 0.95):
        at = data["quantile"].sel(probability=level, method="nearest")
        known = abs(float(at["probability"]) - level) < 1e-6
        found[f"q{level}"] = shown(float(at)) if known else "unknown"
    return found | {"influence": _influence(data), "error": _error(data)}


def _influence(data: xr.Dataset) -> str:
    """Say which input takes part in most of the variance."""
    for name, dim in (("sobol_total", "input"), ("sobol_total_germ", "germ")):
        if name in data and float(data["std"]) > 0:
            values = data[name].values
            top = int(np.argmax(values))
            return f"{data[dim].values[top]!s} ({format_share(min(max(float(values[top]), 0.0), 1.0))})"
    return ""


def _bounds(method: Method) -> list[str]:
    """Say of outputs that happen in all realisations how often they may not happen elsewhere."""
    if "censored_bound" not in method.statistics:
        return []
    shares, bounds = (method.statistics[name].values for name in ("censored", "censored_bound"))
    return [
        f"With {method.label}, {name} happens in all realisations; elsewhere it may not, in at most "
        f"{format_share(bound)} (with 95 % confidence)."
        for name, share, bound in zip(method.names, shares.tolist(), bounds.tolist(), strict=True)
        if share == 0 < bound
    ]


def _error(data: xr.Dataset) -> str:
    """Say the stated error of a surrogate."""
    share = float(data.get("verification_error", math.nan))
    return format_percent(share) if math.isfinite(share) else ""


def _words(method: Method) -> list[str]:
    label = method.label
    words = []
    worst = worst_integration_share(method.statistics)
    if worst is not None and math.isfinite(worst.share):
        words.append(f"With {label}, the error of the time integration is {worst.words()} ({worst.output}), or less.")
    if method.fit and method.failures:
        words.append(f"With {label}: {method.fit}.")
    words += _bounds(method)
    late = method.statistics.get("censored")
    for name, share in zip(method.names, [] if late is None else late.values, strict=False):
        if not share == 0:
            part = "some" if math.isnan(share) else format_share(float(share))
            known = name not in json.loads(method.node.attrs.get("refused", "{}"))
            words.append(
                f"With {label}, {name} does not happen in {part} of the realisations until the last time; "
                + (
                    "its statistics are those of the others."
                    if known
                    else "it has no statistics here, for a surrogate of the others would go on beyond them."
                )
            )
    if method.failures:
        first = [] if method.samples is None else failure_reasons(method.samples)
        reason = f" The most frequent reason: {first[0].text}" if first else ""
        words.append(
            f"With {label}, {method.failures} of {format_count(method.realisations, 'realisation')} have no such "
            f"values and do not enter the statistics.{reason}"
        )
    return words
