"""The report's section on the comparison of methods: verdicts, and differences from the reference."""

from __future__ import annotations

import math
from typing import Any

import xarray as xr

from uqmbd.report.sections.about_methods.agreement import agreement
from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import StudyResult
from uqmbd.results.comparison import NO_SPREAD
from uqmbd.wording import Cell, format_cells, format_percent

__all__ = ["COMPARISON"]


_NONE = Cell("–", "")


def comparison(result: StudyResult) -> Content | None:
    """Return what the section says; None for a single method."""
    data = result.comparison
    if data is None:
        return None
    rows = [*_differences(data), *_scalar_differences(data)]
    return {"agreement": agreement(result), "reference": str(data.attrs["reference"]), "rows": rows}


COMPARISON = TemplateSection("Comparison of methods", "comparison", comparison)


def _differences(data: xr.Dataset) -> list[dict[str, Any]]:
    rows = []
    for o, name in enumerate(data["output"].values):
        scale, units = float(data["reference_std_max"][o]), str(data["output_units"].values[o])
        for m, method in enumerate(data["method"].values):
            if str(method) == str(data.attrs["reference"]):
                continue
            still = "verdict_kind" in data and str(data["verdict_kind"].values[m, o]) == NO_SPREAD
            row: dict[str, Any] = {"output": str(name), "method": str(method)}
            for key in ("mean_difference_max", "std_difference_max", "mean_difference_l2", "std_difference_l2"):
                row[key] = _with_share(float(data[key].values[m, o]), units, 0.0 if still else scale)
            rows.append(row)
    return rows


def _scalar_differences(data: xr.Dataset) -> list[dict[str, Any]]:
    if "scalar_mean_difference" not in data:
        return []
    reference = str(data.attrs.get("scalar_reference", data.attrs["reference"]))
    rows = []
    for o, name in enumerate(data["scalar"].values):
        scale, units = float(data["scalar_reference_std"][o]), str(data["scalar_units"].values[o])
        for m, method in enumerate(data["method"].values):
            if str(method) == reference:
                continue
            row: dict[str, Any] = {
                "output": str(name),
                "method": str(method),
                "mean_difference_l2": _NONE,
                "std_difference_l2": _NONE,
            }
            for key in ("mean", "std"):
                value = float(data[f"scalar_{key}_difference"].values[m, o])
                row[f"{key}_difference_max"] = _with_share(value, units, scale)
            rows.append(row)
    return rows


def _with_share(value: float, units: str, scale: float) -> Cell:
    """Write a difference, and which part of a standard deviation it is where there is one."""
    (cell,) = format_cells([value], units)
    share = f" ({format_percent(value / scale)})" if scale > 0 and math.isfinite(value) else ""
    return Cell(cell.number, f"{cell.rest}{share}".strip())
