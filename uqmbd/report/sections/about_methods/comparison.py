"""Section that compares methods: the recommendation, agreement, and differences from the reference."""

from __future__ import annotations

import math
from typing import Any

import xarray as xr

from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import StudyResult
from uqmbd.wording import Cell, format_cells, format_duration, format_integer, format_percent

__all__ = ["COMPARISON", "agreement"]


def agreement(result: StudyResult) -> Content | None:
    """Return the recommendation, and the verdicts on each method (``rows``) and on each output (``each``).

    Only the comparison section shows ``each``. Return None for a single method, or for results of earlier versions.
    """
    data, found = result.comparison, result.assessment
    compared = [one for one in found.judgements if one.kind]
    if data is None or not compared:
        return None
    rows = [
        {
            "method": one.method,
            "kind": one.kind,
            "text": f"{one.sign} {one.text}",
            "wall_time": format_duration(result.methods[one.method].wall_time),
            "realisations": format_integer(result.methods[one.method].total_realisations),
        }
        for one in found.verdicts
    ]
    return {
        "lead": "".join(found.recommendation[:1]),
        "others": found.reasons,
        "rows": rows,
        "each": compared,
        "reference": _references(data),
        "level": f"{100 * float(data.attrs.get('level', 0.05)):g} %",
    }


_NONE = Cell("–", "")


def describe_comparison(result: StudyResult) -> Content | None:
    """Return the content of the section; None for a single method."""
    data = result.comparison
    if data is None:
        return None
    rows = [*_differences(result, data), *_differences(result, data, timeless=True)]
    return {"agreement": agreement(result), "reference": _references(data), "rows": rows}


def _references(data: xr.Dataset) -> str:
    """Return the label of the reference, or both labels if scalar outputs have another reference."""
    reference = str(data.attrs["reference"])
    other = str(data.attrs.get("scalar_reference", reference))
    return reference if other == reference else f"{reference}; for scalar outputs {other}"


COMPARISON = TemplateSection("Comparison of methods", "comparison", describe_comparison, "about_methods.html.j2")


def _differences(result: StudyResult, data: xr.Dataset, *, timeless: bool = False) -> list[dict[str, Any]]:
    """Return the rows of outputs over time, or of scalar outputs (`timeless`), which have a single difference."""
    prefix, dim, end, std = ("scalar_", "scalar", "", "std") if timeless else ("", "output", "_max", "std_max")
    if f"{prefix}mean_difference{end}" not in data:
        return []
    reference = str(data.attrs.get(f"{prefix}reference", data.attrs["reference"]))
    varies = {(one.method, one.output): one.varies for one in result.assessment.judgements}
    rows = []
    for o, name in enumerate(map(str, data[dim].values)):
        scale, units = float(data[f"{prefix}reference_{std}"][o]), str(data[f"{dim}_units"].values[o])
        for m, method in enumerate(map(str, data["method"].values)):
            if method == reference:
                continue
            row: dict[str, Any] = {"output": name, "method": method}
            for key in ("mean", "std"):
                found = {"max": f"{prefix}{key}_difference{end}", "l2": f"{key}_difference_l2"}
                for norm, variable in found.items():
                    whole = scale if varies.get((method, name), True) else 0.0
                    row[f"{key}_difference_{norm}"] = (
                        _NONE
                        if timeless and norm == "l2"
                        else _with_share(float(data[variable].values[m, o]), units, whole)
                    )
            rows.append(row)
    return rows


def _with_share(value: float, units: str, scale: float) -> Cell:
    """Return a difference, and its ratio to a non-zero standard deviation, as text."""
    (cell,) = format_cells([value], units)
    share = f" ({format_percent(value / scale)})" if scale > 0 and math.isfinite(value) else ""
    return Cell(cell.number, f"{cell.rest}{share}".strip())
