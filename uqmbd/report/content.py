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


def format_number(value: float, error: float | None = None) -> str:
    """Write a number for reading: four digits, or as many as its standard error allows.

    Parameters
    ----------
    value : float
    error : float, optional
        Standard error, shown with two digits.

    Returns
    -------
    str

    Examples
    --------
    >>> format_number(0.150123), format_number(-1.5e-7), format_number(0.0)
    ('0.1501', '−1.5 × 10⁻⁷', '0')
    >>> format_number(0.150123, 0.00134), format_number(151234.0, 120.0)
    ('0.1501 ± 0.0013', '(1.5123 ± 0.0012) × 10⁵')
    >>> format_number(33080.0, 3816.0)
    '(3.31 ± 0.38) × 10⁴'
    """
    if not math.isfinite(value):
        return "unknown" if math.isnan(value) else ("∞" if value > 0 else "−∞")
    if error is None or not math.isfinite(error) or error <= 0.0 or error < 1e-12 * abs(value):
        exponent = math.floor(math.log10(abs(value))) if value else 0
        if -3 <= exponent < 5:
            return _minus(f"{value:.4g}" if exponent < 4 else f"{value:.0f}")
        mantissa = f"{value / 10.0**exponent:.4g}" if exponent > -300 else f"{value:.3e}".split("e")[0]
        return f"{_minus(mantissa)} × 10{str(exponent).translate(_SUPERSCRIPTS)}"
    exponent = math.floor(math.log10(max(abs(value), error)))
    # Plain digits only where all of them mean something: 33080 ± 3816 claims too much.
    scale = 0 if -3 <= exponent < 5 and error < 99.5 else exponent
    decimals = max(0, scale - math.floor(math.log10(error)) + 1)
    text = f"{_minus(f'{value / 10.0**scale:.{decimals}f}')} ± {error / 10.0**scale:.{decimals}f}"
    return f"({text}) × 10{str(scale).translate(_SUPERSCRIPTS)}" if scale else text


def format_duration(seconds: float) -> str:
    """Write a duration for reading.

    Parameters
    ----------
    seconds : float

    Returns
    -------
    str

    Examples
    --------
    >>> [format_duration(s) for s in (0.0123, 4.56, 75.0, 7300.0, float("nan"))]
    ['12 ms', '4.6 s', '1 min 15 s', '2 h 1 min', 'unknown']
    """
    if not math.isfinite(seconds):
        return "unknown"
    if seconds < 1:
        return f"{1000 * seconds:.0f} ms"
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


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


def _count(number: int, one: str, many: str | None = None) -> str:
    return f"{number} {one if number == 1 else many or one + 's'}"


def _numbers(node: xr.DataTree) -> tuple[int, int]:
    return int(node.attrs.get("realisations", 0)), int(node.attrs.get("failures", 0))


def summary(tree: xr.DataTree, nodes: Mapping[str, xr.DataTree]) -> list[str]:
    """Describe the study in a few sentences."""
    rows, names = input_rows(nodes), output_names(nodes)
    what = "the uncertainty of " + _count(len(rows), "input") if rows else "uncertain inputs"
    methods = ", ".join(nodes)
    text = [
        f"This study carried {what} through the mechanism {tree.attrs.get('mechanism', '')!s} "
        f"to {_count(len(names), 'output')} with {_count(len(nodes), 'method')}: {methods}."
    ]
    for label, node in nodes.items():
        total, failed = _numbers(node)
        seconds = format_duration(float(node.attrs.get("wall_time", math.nan)))
        outcome = "all succeeded" if not failed else f"{failed} failed and did not enter the statistics"
        text.append(f"{label} computed {_count(total, 'realisation')} in {seconds}; {outcome}.")
    label, node = next(iter(nodes.items()))
    constant = [name for name in names if has_output(node, name) and not varies(node, name)]
    if constant:
        text.append(f"The inputs have no influence on {', '.join(constant)}.")
    return text


def failures(label: str, node: xr.DataTree) -> dict[str, Any]:
    """Return failures of a method: how many, grouped by their reason, and the inputs that caused them."""
    total, failed = _numbers(node)
    found: dict[str, Any] = {
        "label": label,
        "count": failed,
        "total": total,
        "share": f"{100 * failed / total:.3g} %" if total else "",
        "reasons": [],
        "names": [],
        "rows": [],
        "hidden": 0,
    }
    if "samples" not in node.children or not failed:
        return found
    samples = node.children["samples"].to_dataset()
    status = samples["status"]
    values = np.atleast_1d(status.attrs.get("flag_values", [])).tolist()
    meanings = dict(zip(values, str(status.attrs.get("flag_meanings", "")).split(), strict=False))
    groups: dict[tuple[str, str], int] = {}
    which = np.flatnonzero(status.values != 0)
    for k in which:
        kind = meanings.get(int(status.values[k]), f"status {int(status.values[k])}").replace("_", " ")
        reason = str(samples["message"].values[k]) or "no reason was given"
        groups[kind, reason] = groups.get((kind, reason), 0) + 1
    ordered = sorted(groups.items(), key=lambda item: -item[1])
    found["reasons"] = [{"kind": k, "reason": r, "count": n} for (k, r), n in ordered[:_SHOWN_FAILURES]]
    found["more_reasons"] = len(ordered) - len(found["reasons"])
    units = samples["input_units"].values if "input_units" in samples.coords else [""] * samples.sizes["input"]
    found["names"] = [f"{n} [{u}]" if u else str(n) for n, u in zip(samples["input"].values, units, strict=True)]
    drawn = samples["inputs"].values
    found["rows"] = [
        {"sample": int(k), "inputs": [f"{float(v):.6g}".replace("-", "−") for v in drawn[k]]}
        for k in which[:_SHOWN_FAILURES]
    ]
    found["hidden"] = len(which) - len(found["rows"])
    return found


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


def _minus(text: str) -> str:
    return text.replace("-", "−")
