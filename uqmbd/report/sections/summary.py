"""The words, numbers and tables of the report, as plain data for its template."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.report.figures import (
    automatic_times,
    design_of,
    failure_reasons,
    failure_words,
    runs_of,
    scalar_differences,
    scalar_names,
)
from uqmbd.results import integration_shares, own_statements, varies
from uqmbd.results.chaos import percent
from uqmbd.results.comparison import NO_SPREAD, own_error
from uqmbd.results.statistics import rtol_of
from uqmbd.status import Status
from uqmbd.wording import format_count, format_duration, format_integer, format_number, minus

__all__ = [
    "comparison",
    "failures",
    "has_histograms",
    "has_output",
    "heading",
    "in_words",
    "input_rows",
    "integration",
    "numbers",
    "output_names",
    "output_rows",
    "precision",
    "report_times",
    "statistics",
    "summary",
]

_SHOWN_FAILURES = 20
_SHOWN_REASONS = 6

FEW_ROWS = 18
"""Rows of a table that an eye takes in; longer ones are folded, or only their most important part is shown."""

# How well a standard deviation should be known: above the first it is a rough figure, above the second hardly one.
_WELL_KNOWN, _ROUGHLY_KNOWN = 0.05, 0.15


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
    return "samples" in node.children and bool(np.any(node.children["samples"].to_dataset()["status"] == Status.OK))


def _statistics(node: xr.DataTree) -> xr.Dataset:
    return node.children["statistics"].to_dataset()


def _at(node: xr.DataTree, name: str) -> xr.Dataset:
    statistics = _statistics(node)
    return statistics.isel(output=[str(n) for n in statistics["output"].values].index(name))


def _with_units(text: str, units: str) -> str:
    return f"{text} {units}" if units else text


def in_words(node: xr.DataTree, name: str) -> str:
    """Describe an output's end and its largest spread in a sentence or two."""
    row = _output_row("", node, name)
    return (
        f"At {row['end']} the mean is {row['mean']} and the standard deviation {row['std']}; "
        f"the largest standard deviation, {row['std_max']}, is reached at {row['std_max_time']}."
    )


def _stated(node: xr.DataTree) -> dict[str, tuple[float, float]]:
    """Return the largest stated error of each output that varies, as a share of the standard deviation, and its time.

    Of a method with samples that states standard errors; else nothing.
    """
    if "samples" not in node.children or "std_error_std" not in node.children["statistics"].data_vars:
        return {}
    statistics = node.children["statistics"].to_dataset()
    own = own_error(node, rtol_of(node), dependence=False)
    errors, at = own.largest(statistics["time"].values)
    names = [str(value) for value in statistics["output"].values]
    return {
        name: (float(errors[k]), float(at[k]))
        for k, name in enumerate(names)
        if own.varies[k] and 0 < errors[k] < math.inf
    }


def _advice(node: xr.DataTree, share: float) -> str:
    """Say whether so uncertain a standard deviation needs more samples, and how many would halve its uncertainty."""
    total, _ = _numbers(node)
    if share <= _WELL_KNOWN:
        verdict = "That is enough for most purposes"
    elif share <= _ROUGHLY_KNOWN:
        verdict = "That tells how large the spread is, but not its second digit"
    else:
        verdict = "That is a rough figure, and more samples are needed to rely on it"
    halving = f"{format_count(4 * total, 'sample')} instead of {format_integer(total)} would halve the uncertainty"
    if not design_of(node.attrs).independent:
        halving += " at the latest, since this sampling design often converges faster"
    return f"{verdict}; {halving}."


def precision(node: xr.DataTree, name: str) -> str:
    """Say in words how well the standard deviation of an output is known; empty if the method cannot tell.

    What is to be done about it is in the summary.
    """
    if name not in _stated(node):
        return ""
    data = _at(node, name)
    names = output_names({"": node})
    said = own_statements(node)[names.index(name)]
    text = f"{said[0].upper()}{said[1:]}, with 95 % confidence."
    largest = int(np.nan_to_num(data["std"].values, nan=-1.0).argmax())
    if float(data["kurtosis"][largest]) > 30:
        text += (
            " A few extreme samples make up most of the largest standard deviation, so that even this error is itself "
            "uncertain: look at the quantiles rather than at the standard deviation."
        )
    return text


def integration(node: xr.DataTree, name: str) -> str:
    """Say how large the error of the time integration of an output is; empty if the results do not state it."""
    found = {one.output: one for one in integration_shares(_statistics(node))}.get(name)
    if found is None:
        return ""
    if not math.isfinite(found.error):
        return f"The error of the time integration is not known: {found.reason}."
    size = f" ({found.words()})" if math.isfinite(found.share) and found.error else ""
    return f"The time integration is wrong by up to {_with_units(format_number(found.error), found.units)}{size}."


def _overall_precision(nodes: Mapping[str, xr.DataTree]) -> list[str]:
    sentences = []
    for label, node in nodes.items():
        errors = _stated(node)
        if not errors:
            continue
        worst = max(errors, key=lambda name: errors[name][0])
        share, at = errors[worst]
        whose = f"The stated error of {label}" if len(nodes) > 1 else "The stated error"
        of_which = f"of {worst}, " if len(errors) > 1 else ""
        sentences.append(
            f"{whose} is at most {percent(share)} of the standard deviation ({of_which}at {at:g} s, with 95 % "
            f"confidence). {_advice(node, share)}"
        )
    return sentences


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


def numbers(node: xr.DataTree, name: str) -> list[dict[str, str]]:
    """Return the numbers of an output at chosen times: mean, deviation, quantiles and shape."""
    data = _at(node, name)
    units = str(data["output_units"].item())
    rows = []
    for k in automatic_times(data["time"].values, data["std"].values):
        at = data.isel(time=k)
        row = {"time": f"{float(at['time']):.4g} s"}
        for value in ("mean", "std"):
            row[value] = format_number(float(at[value]))
        for p in (0.025, 0.5, 0.975):
            known = abs(float(at["probability"].sel(probability=p, method="nearest")) - p) < 1e-6
            quantile = float(at["quantile"].sel(probability=p, method="nearest")) if known else math.nan
            row[f"q{p}"] = format_number(quantile) if math.isfinite(quantile) else "–"
        skewness = float(at["skewness"])
        row["skewness"] = minus(f"{skewness:.2f}") if math.isfinite(skewness) else "–"
        rows.append(row | {"units": units})
    return rows


def output_rows(nodes: Mapping[str, xr.DataTree]) -> list[dict[str, str]]:
    """Return the table of outputs: at the end the mean, deviation and 95 % interval; the largest deviation."""
    return [
        _output_row(label, node, name)
        for name in output_names(nodes)
        for label, node in nodes.items()
        if has_output(node, name)
    ]


def statistics(tree: xr.DataTree, nodes: Mapping[str, xr.DataTree]) -> dict[str, Any]:
    """Return the table of outputs for the summary: of few rows all, of many those of one method, and all of them apart.

    Returns
    -------
    dict
        ``rows``, ``of``: the method whose rows these are, or empty; ``all``: every row, where ``rows`` are not all.
    """
    rows = output_rows(nodes)
    if len(nodes) < 2 or len(rows) <= FEW_ROWS:
        return {"rows": rows, "of": "", "all": []}
    data = tree.children["comparison"].attrs if "comparison" in tree.children else {}
    label = str(data.get("reference", next(iter(nodes))))
    chosen = [row for row in rows if row["method"] == label]
    return {"rows": chosen, "of": label, "all": rows} if chosen else {"rows": rows, "of": "", "all": []}


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


def report_times(tree: xr.DataTree) -> list[float] | None:
    """Return the times at which the study wants distributions to be shown; None: the figure chooses."""
    wanted = tree.attrs.get("report_times")
    return None if wanted is None else [float(t) for t in np.atleast_1d(wanted)]


def summary(tree: xr.DataTree, nodes: Mapping[str, xr.DataTree]) -> list[str]:
    """Describe the study in a few sentences."""
    rows, names = input_rows(nodes), output_names(nodes)
    count = len(names) + len(scalar_names(nodes))
    what = "the uncertainty of " + format_count(len(rows), "input") if rows else "uncertain inputs"
    methods = ", ".join(nodes)
    text = [
        f"This study carried {what} through the mechanism {tree.attrs.get('mechanism', '')!s} "
        f"to {format_count(count, 'output')} with {format_count(len(nodes), 'method')}: {methods}."
    ]
    compared = len(nodes) > 1 and "comparison" in tree.children and "verdict" in tree.children["comparison"].data_vars
    if compared and not any(_numbers(node)[1] for node in nodes.values()):
        text[0] += " All realisations succeeded."
    for label, node in nodes.items():
        if lacking := _lacking(node):
            text.append(
                f"With {label}, {lacking[0]} of {format_count(lacking[1], 'realisation')} have not all of the outputs "
                "without a time, and are left out of the statistics of these."
            )
    for label, node in nodes.items():
        total, failed = _numbers(node)
        seconds = format_duration(float(node.attrs.get("wall_time", math.nan)))
        outcome = "all succeeded" if not failed else f"{failed} failed and did not enter the statistics"
        if failed and node.attrs.get("fit"):
            outcome = f"{failed} failed, and the surrogate was found without them: {node.attrs['fit']}"
        if failed or not compared:  # else the table of methods has it
            text.append(f"{label} computed {format_count(total, 'realisation')} in {seconds}; {outcome}.")
        kept = node.children["samples"].sizes["sample"] if "samples" in node.children else total
        if kept < total:
            text.append(
                f"Means and standard deviations of {label} are those of all {format_integer(total)}; quantiles, "
                f"histograms and densities are those of the first {format_integer(kept)}, which the results hold."
            )
        if "ends_at" in node.attrs:
            text.append(
                f"Results of {label} end at t = {format_number(float(node.attrs['ends_at']))} s, before the end of the "
                "study: beyond, they could not be computed, or not be trusted."
            )
    text += _overall_precision(nodes)
    constant = [name for name in names if has_output(node, name) and not varies(node, name)]
    if constant:
        does = "does" if len(constant) == 1 else "do"
        text.append(f"{', '.join(constant)} {does} not vary beyond the integration error.")
    return text + [f"Note: {said}." for said in stored_warnings(tree, nodes)]


def stored_warnings(tree: xr.DataTree, nodes: Mapping[str, xr.DataTree]) -> list[str]:
    """Return what the study was warned of, each once: of the mechanism, then of each method, with its label."""
    found = _warnings_of(tree)
    known = set(found)
    for label, node in nodes.items():
        for part in node.subtree:
            found += [f"{label}: {said}" for said in _warnings_of(part) if said not in known]
            known.update(_warnings_of(part))
    return found


def _warnings_of(node: xr.DataTree) -> list[str]:
    try:
        found = json.loads(node.attrs.get("warnings", "[]"))
    except (TypeError, ValueError):
        return []
    return [str(said) for said in found] if isinstance(found, list) else []


def _lacking(node: xr.DataTree) -> tuple[int, int] | None:
    """Return the realisations without outputs without a time, and all; None if there are none of the first."""
    attrs = node.children["scalars"].attrs if "scalars" in node.children else {}
    failed, total = int(attrs.get("failures", 0)), int(attrs.get("realisations", 0))
    return (failed, total) if failed else None


def failures(label: str, node: xr.DataTree) -> dict[str, Any]:
    """Return failures of a method: how many, grouped by their reason, and the inputs that caused them."""
    total, failed = _numbers(node)
    found: dict[str, Any] = {
        "label": label,
        "count": failed,
        "total": total,
        "share": _share(failed, total),
        "reasons": [],
        "names": [],
        "rows": [],
        "hidden": 0,
        "kept": "",
        "fit": str(node.attrs.get("fit", "")),
        "lacking": _lacking(node),
    }
    samples = runs_of(node)
    if samples is None or not failed:
        return found
    reasons = failure_reasons(node)
    seen = sum(len(r.samples) for r in reasons)
    if samples.sizes["sample"] < total:
        found["kept"] = format_integer(samples.sizes["sample"])
    found["reasons"] = [
        {
            "kind": r.kind,
            "reason": r.text,
            "count": len(r.samples),
            "share": _share(len(r.samples), seen),
            "words": failure_words(node, r),
            "group": r,
        }
        for r in reasons[:_SHOWN_REASONS]
    ]
    found["more_reasons"] = len(reasons) - len(found["reasons"])
    which = np.flatnonzero(samples["status"].values != Status.OK)
    units = samples["input_units"].values if "input_units" in samples.coords else [""] * samples.sizes["input"]
    found["names"] = [f"{n} [{u}]" if u else str(n) for n, u in zip(samples["input"].values, units, strict=True)]
    drawn = samples["inputs"].values
    found["rows"] = [
        {"sample": int(k), "inputs": [f"{float(v):.6g}".replace("-", "−") for v in drawn[k]]}
        for k in which[:_SHOWN_FAILURES]
    ]
    found["hidden"] = len(which) - len(found["rows"])
    return found


def _share(part: int, whole: int) -> str:
    return f"{100 * part / whole:.3g} %" if whole else ""


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
            still = "verdict_kind" in data and str(data["verdict_kind"].values[m, o]) == NO_SPREAD
            for key in ("mean_difference_max", "std_difference_max", "mean_difference_l2", "std_difference_l2"):
                value = float(data[key].values[m, o])
                known = scale > 0 and math.isfinite(value) and not still
                share = f" ({100 * value / scale:.2g} %)" if known else ""
                row[key] = _with_units(format_number(value), units) + share
            rows.append(row)
    return {"reference": reference, "rows": rows + scalar_differences(data)}
