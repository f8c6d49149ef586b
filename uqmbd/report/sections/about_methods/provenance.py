"""The report's section on how results came about: script, mechanism with its constants, options and versions."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import Method, StudyResult

__all__ = ["PROVENANCE"]

_ATTRIBUTES = {
    "integrated_by": "integrated by",
    "not_unique": "not unique, as constraints are redundant",
    "rtol": "relative tolerance of the integration",
    "max_step": "longest step, s",
    "uqmbd_version": "version of uqmbd",
    "schema_version": "version of the schema",
    "report_times": "times of distributions, s",
    "script_sha256": "SHA-256 of the script",
    "allowed_probability": "probability of violations that is allowed",
}


_SHOWN = {
    "study", "mechanism", "created", "command", "parts", "model", "limits", "over", "failed", "warnings", "budget",
}  # fmt: skip
"""Attributes of a study that the report shows elsewhere."""

_KNOWN = {
    "propagator", "label", "seed", "created", "uqmbd_version", "options", "versions", "solver_counters", "wall_time",
    "realisations", "failures", "warnings", "budget_summary", "refused",
}  # fmt: skip
"""Attributes of a method that are shown by another name, or elsewhere."""


def provenance(result: StudyResult) -> Content:
    """Return the command and the script, bodies and components, and options, seed and date of each method."""
    attrs = result.tree.attrs
    about = {str(k): v for k, v in attrs.items() if k not in _SHOWN}
    first = ["script", "script_sha256"]
    order = sorted(about, key=lambda k: first.index(k) if k in first else len(first))
    return {
        "command": attrs.get("command"),
        "study_attributes": [(_ATTRIBUTES.get(k, k), str(about[k])) for k in order],
        **_mechanism(result),
        "methods": [{"label": label, "facts": _facts(method)} for label, method in result.methods.items()],
        "versions": _versions(result),
    }


PROVENANCE = TemplateSection("Provenance", "provenance", provenance)


def _facts(method: Method) -> list[tuple[str, str]]:
    attrs = method.node.attrs
    found = [
        *((k, str(attrs[k])) for k in ("propagator", "seed", "created") if k in attrs),
        *((f"option {name}", value) for name, value in method.pairs("options")),
        *((_ATTRIBUTES.get(str(k), str(k)), str(v)) for k, v in attrs.items() if k not in _KNOWN),
    ]
    # what is not set is not worth a row
    return [(name, value) for name, value in found if value not in ("null", "None", "")]


def _versions(result: StudyResult) -> list[Content]:
    """Return the versions of packages: once, where all methods have the same."""
    found = {label: method.pairs("versions") for label, method in result.methods.items()}
    found = {label: pairs for label, pairs in found.items() if pairs}
    if len({json.dumps(pairs) for pairs in found.values()}) == 1:
        return [{"of": "", "facts": next(iter(found.values()))}]
    return [{"of": label, "facts": pairs} for label, pairs in found.items()]


def _mechanism(result: StudyResult) -> Content:
    """Return rows of bodies and of components; of results of earlier versions their names."""
    parts, model = (_object(result.tree.attrs.get(name)) for name in ("parts", "model"))
    known, joined = (_object(model.get(name)) for name in ("bodies", "components"))
    bodies = parts.get("bodies") if isinstance(parts.get("bodies"), list) else []
    components = _object(parts.get("components"))
    return {
        "bodies": [{"name": str(name), "constants": _constants(known.get(str(name)))} for name in bodies or ()],
        "components": [
            {
                "name": str(name),
                "kind": str(kind),
                "between": ", ".join(map(str, _object(joined.get(name)).get("bodies", ()))),
                "constants": _constants(_object(joined.get(name)).get("parameters")),
            }
            for name, kind in components.items()
        ],
    }


def _constants(values: object) -> str:
    return "; ".join(f"{name}: {value}" for name, value in _object(values).items())


def _object(value: object) -> Mapping[str, Any]:
    """Return a JSON object, or its text, as a mapping; anything else is empty."""
    try:
        found = json.loads(value) if isinstance(value, str) else value
    except ValueError:
        return {}
    return found if isinstance(found, Mapping) else {}
