"""The words, numbers and tables of the report, as plain data for its template."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

__all__ = [
    "comparison",
    "cost",
    "failures",
    "format_duration",
    "format_number",
    "has_histograms",
    "has_output",
    "heading",
    "in_words",
    "input_rows",
    "output_names",
    "output_rows",
    "provenance",
    "study_attributes",
    "summary",
    "varies",
]

_SHOWN_FAILURES = 20
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def heading(tree: xr.DataTree) -> dict[str, str]:
    """Return the study's name, its mechanism and its date."""
    created = str(tree.attrs.get("created", ""))
    return {
        "study": str(tree.attrs.get("study", "study")),
        "mechanism": str(tree.attrs.get("mechanism", "")),
        "created": created,
        "date": created.replace("T", " ").replace("+00:00", " UTC"),
    }


def output_names(nodes: Mapping[str, xr.DataTree]) -> list[str]:
    """Return the names of all outputs over time, in the order of the study."""
    names: dict[str, None] = {}
    for node in nodes.values():
        if "time" in node.children["statistics"].sizes:
            names |= dict.fromkeys(map(str, node.children["statistics"].coords["output"].values))
    return list(names)


def has_output(node: xr.DataTree, name: str) -> bool:
    """Tell whether a method has this output over time."""
    return name in output_names({"": node})


def has_histograms(node: xr.DataTree) -> bool:
    """Tell whether a method kept samples that succeeded."""
    return "samples" in node.children and bool(np.any(node.children["samples"].to_dataset()["status"] == 0))


def _at(node: xr.DataTree, name: str) -> xr.Dataset:
    statistics = node.children["statistics"].to_dataset()
    return statistics.isel(output=[str(n) for n in statistics["output"].values].index(name))


def _with_units(text: str, units: str) -> str:
    return f"{text} {units}" if units else text


def varies(node: xr.DataTree, name: str) -> bool:
    """Tell whether an output has a spread beyond rounding."""
    data = _at(node, name)
    return float(data["std"].max()) > 1e-13 * float(abs(data["mean"]).max())


def in_words(node: xr.DataTree, name: str) -> str:
    """Describe an output's end and its largest spread in a sentence or two."""
    row = _output_row("", node, name)
    return (
        f"At {row['end']} the mean is {row['mean']} and the standard deviation {row['std']}; "
        f"the largest standard deviation, {row['std_max']}, is reached at {row['std_max_time']}."
    )


def _output_row(label: str, node: xr.DataTree, name: str) -> dict[str, str]:
    data = _at(node, name)
    units = str(data["output_units"].item())
    end = data.isel(time=-1)
    largest = int(data["std"].values.argmax())

    def shown(value: str, error: str) -> str:
        known = float(end[error]) if error in end else None
        text = format_number(float(end[value]), known)
        return _with_units(text, units)

    ends = [float(end["quantile"].sel(probability=p, method="nearest")) for p in (0.025, 0.975)]
    levels = end["probability"].values
    known = np.isfinite(ends).all() and np.any(np.abs(levels - 0.025) < 1e-6) and np.any(np.abs(levels - 0.975) < 1e-6)
    return {
        "output": name,
        "method": label,
        "end": f"t = {float(end['time']):.4g} s",
        "mean": shown("mean", "std_error_mean"),
        "std": shown("std", "std_error_std"),
        "interval": _with_units(f"{format_number(ends[0])} to {format_number(ends[1])}", units) if known else "unknown",
        "std_max": _with_units(format_number(float(data["std"][largest])), units),
        "std_max_time": f"{float(data['time'][largest]):.4g} s" if varies(node, name) else "no spread",
    }


def output_rows(nodes: Mapping[str, xr.DataTree]) -> list[dict[str, str]]:
    """Return the table of outputs: at the end the mean, deviation and 95 % interval; the largest deviation."""
    return [
        _output_row(label, node, name)
        for name in output_names(nodes)
        for label, node in nodes.items()
        if has_output(node, name)
    ]


def input_rows(nodes: Mapping[str, xr.DataTree]) -> list[dict[str, str]]:
    """Return the table of inputs: name, distribution and units, from the first method that tells."""
    for node in nodes.values():
        for child in ("samples", "statistics", "chaos"):
            if child not in node.children or "input" not in node.children[child].coords:
                continue
            data = node.children[child].to_dataset()
            columns = []
            for name in ("input", "input_units", "input_description"):
                blank = [""] * data.sizes["input"]
                columns.append([str(v) for v in data[name].values] if name in data.coords else blank)
            return [
                {"name": name, "units": units, "distribution": text or "not stated"}
                for name, units, text in zip(*columns, strict=True)
            ]
    return []


def _numbers(node: xr.DataTree) -> tuple[int, int]:
    return int(node.attrs.get("realisations", 0)), int(node.attrs.get("failures", 0))


def summary(tree: xr.DataTree, nodes: Mapping[str, xr.DataTree]) -> list[str]:
    """Describe the study in a few sentences."""
    rows, names = input_rows(nodes), output_names(nodes)
    what = "the uncertainty of " + format_count(len(rows), "input") if rows else "uncertain inputs"
    methods = ", ".join(nodes)
    text = [
        f"This study carried {what} through the mechanism {tree.attrs.get('mechanism', '')!s} "
        f"to {format_count(len(names), 'output')} with {format_count(len(nodes), 'method')}: {methods}."
    ]
    for label, node in nodes.items():
        total, failed = _numbers(node)
        seconds = format_duration(float(node.attrs.get("wall_time", math.nan)))
        outcome = "all succeeded" if not failed else f"{failed} failed and did not enter the statistics"
        text.append(f"{label} computed {format_count(total, 'realisation')} in {seconds}; {outcome}.")
    label, node = next(iter(nodes.items()))
    constant = [name for name in names if has_output(node, name) and not varies(node, name)]
    if constant:
        text.append(f"The inputs have no influence on {', '.join(constant)}.")
    return text


@@FAIL@@

def cost(label: str, node: xr.DataTree) -> dict[str, Any]:
    """Return what a method cost."""
    total, failed = _numbers(node)
    seconds = float(node.attrs.get("wall_time", math.nan))
    return {
        "label": label,
        "wall_time": format_duration(seconds),
        "realisations": total,
        "failures": failed,
        "each": format_duration(seconds / total) if total else "",
        "counters": _pairs(node.attrs.get("solver_counters")),
    }


def comparison(tree: xr.DataTree) -> dict[str, Any] | None:
    """Return the comparison of several methods, None for a single one."""
    data = tree.children["comparison"].to_dataset() if "comparison" in tree.children else xr.Dataset()
    if data.sizes.get("method", 0) < 2:
        return None
    reference = str(data.attrs["reference"])
    rows = []
    for o, name in enumerate(data["output"].values):
        scale = float(data["reference_std_max"][o])
        units = str(data["output_units"].values[o])
        for m, method in enumerate(data["method"].values):
            if str(method) == reference:
                continue
            row = {"output": str(name), "method": str(method)}
            for key in ("mean_difference_max", "std_difference_max", "mean_difference_l2", "std_difference_l2"):
                value = float(data[key].values[m, o])
                share = f" ({100 * value / scale:.2g} %)" if scale > 0 and math.isfinite(value) else ""
                row[key] = _with_units(format_number(value), units) + share
            rows.append(row)
    return {"reference": reference, "rows": rows}


def provenance(label: str, node: xr.DataTree) -> dict[str, Any]:
    """Return how a method's result came about: its options, seed, versions and date."""
    attrs = node.attrs
    facts: list[tuple[str, str]] = [
        (k, str(attrs[k])) for k in ("propagator", "seed", "created", "uqmbd_version") if k in attrs
    ]
    facts += [(f"option {name}", value) for name, value in _pairs(attrs.get("options"))]
    known = {"propagator", "label", "seed", "created", "uqmbd_version", "options", "versions", "solver_counters"}
    known |= {"wall_time", "realisations", "failures"}
    facts += [(str(k), str(v)) for k, v in attrs.items() if k not in known]
    return {"label": label, "facts": facts, "versions": _pairs(attrs.get("versions"))}


def study_attributes(tree: xr.DataTree) -> list[tuple[str, str]]:
    """Return what else is known about the study."""
    shown = {"study", "mechanism", "created", "command"}
    return [(str(k), str(v)) for k, v in tree.attrs.items() if k not in shown]


def _pairs(text: object) -> list[tuple[str, str]]:
    try:
        content = json.loads(text) if isinstance(text, str) else {}
    except ValueError:
        return [("", str(text))]
    if not isinstance(content, dict):
        return [("", str(text))]
    return [(str(k), v if isinstance(v, str) else json.dumps(v, ensure_ascii=False)) for k, v in content.items()]
