"""What a result cost and how it came about, as plain data for the template of the report."""

from __future__ import annotations

import json
import math
from typing import Any

import xarray as xr

from uqmbd.results import failed_methods, worst_integration_share
from uqmbd.wording import format_duration, format_integer, format_number

__all__ = ["cost", "problems", "provenance", "study_attributes"]

_COUNTERS = {
    "steps": "steps of the integrator",
    "residuals": "residual evaluations",
    "residual_evaluations": "residual evaluations",
    "jacobians": "Jacobian evaluations",
    "jacobian_evaluations": "Jacobian evaluations",
    "factorisations": "factorisations of the Jacobian",
    "integrations": "integrations (each of many realisations at once)",
    "accelerations": "evaluations of the equations of motion",
    "passages": "singular poses passed over",
    "repivots": "changes to other independent equations on the way",
    "stiff": "realisations too stiff for the explicit integrator, integrated by IDA",
    "alone": "realisations integrated alone",
    "by_dop853": "realisations whose motion is that of the explicit integrator (dop853)",
    "by_ida": "realisations whose motion is that of IDA",
    "seconds": "time in the integrator, summed over workers",
}

_ATTRIBUTES = {"integrated_by": "integrated by", "not_unique": "not unique, as constraints are redundant"}


def cost(label: str, node: xr.DataTree) -> dict[str, Any]:
    """Return what a method cost."""
    total, failed = int(node.attrs.get("realisations", 0)), int(node.attrs.get("failures", 0))
    seconds = float(node.attrs.get("wall_time", math.nan))
    return {
        "label": label,
        "wall_time": format_duration(seconds),
        "realisations": total,
        "failures": failed,
        "each": format_duration(seconds / total) if total else "",
        "counters": [
            *(_counter(name, value) for name, value in _pairs(node.attrs.get("solver_counters"))),
            *_integration(node),
        ],
    }


def _integration(node: xr.DataTree) -> list[tuple[str, str]]:
    """Return the largest error of the time integration, and how it was found."""
    statistics = node.children["statistics"].to_dataset()
    worst = worst_integration_share(statistics)
    if worst is None:
        return []
    about = statistics["integration_error"].attrs
    how = str(about.get("reason") or about.get("comment", ""))
    which = f", of {worst.output}" if statistics.sizes["output"] > 1 and math.isfinite(worst.share) else ""
    return [("error of the time integration", f"{worst.words()}{which}" + (f" ({how})" if how else ""))]


def _counter(name: str, value: str) -> tuple[str, str]:
    """Return a solver's counter with a name for reading."""
    shown = _COUNTERS.get(name, name.replace("_", " "))
    try:
        number = float(value)
    except ValueError:
        return shown, value
    if name == "seconds":
        return shown, format_duration(number)
    return shown, format_integer(number) if number == round(number) else format_number(number)


def provenance(label: str, node: xr.DataTree) -> dict[str, Any]:
    """Return how a method's result came about: its options, seed, versions and date."""
    attrs = node.attrs
    facts: list[tuple[str, str]] = [
        (k, str(attrs[k])) for k in ("propagator", "seed", "created", "uqmbd_version") if k in attrs
    ]
    facts += [(f"option {name}", value) for name, value in _pairs(attrs.get("options"))]
    known = {"propagator", "label", "seed", "created", "uqmbd_version", "options", "versions", "solver_counters"}
    known |= {"wall_time", "realisations", "failures", "warnings"}
    facts += [(_ATTRIBUTES.get(str(k), str(k)), str(v)) for k, v in attrs.items() if k not in known]
    return {"label": label, "facts": facts, "versions": _pairs(attrs.get("versions"))}


def problems(tree: xr.DataTree) -> list[str]:
    """Say which methods gave no results, and why, and what else could not be computed."""
    said = [f"There are no results of {label}: {reason}" for label, reason in failed_methods(tree).items()]
    if "comparison" in tree.children and tree.children["comparison"].attrs.get("problem"):
        said.append(f"The methods could not be compared: {tree.children['comparison'].attrs['problem']}")
    return said


def study_attributes(tree: xr.DataTree) -> list[tuple[str, str]]:
    """Return what else is known about the study."""
    shown = {"study", "mechanism", "created", "command", "parts", "failed", "warnings"}
    return [(str(k), str(v)) for k, v in tree.attrs.items() if k not in shown]


def _pairs(text: object) -> list[tuple[str, str]]:
    try:
        content = json.loads(text) if isinstance(text, str) else {}
    except ValueError:
        return [("", str(text))]
    if not isinstance(content, dict):
        return [("", str(text))]
    return [(str(k), v if isinstance(v, str) else json.dumps(v, ensure_ascii=False)) for k, v in content.items()]
