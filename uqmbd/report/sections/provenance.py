"""The report's section on how results came about."""

from __future__ import annotations

from uqmbd.report.sections.section import Content, TemplateSection
from uqmbd.report.view import Method, StudyResult

__all__ = ["PROVENANCE"]

_ATTRIBUTES = {"integrated_by": "integrated by", "not_unique": "not unique, as constraints are redundant"}


_SHOWN = {"study", "mechanism", "created", "command", "parts", "failed", "warnings", "budget"}
"""Attributes of a study that the report shows elsewhere."""

_KNOWN = {
    "propagator", "label", "seed", "created", "uqmbd_version", "options", "versions", "solver_counters", "wall_time",
    "realisations", "failures", "warnings", "budget_summary",
}  # fmt: skip
"""Attributes of a method that are shown by another name, or elsewhere."""


def provenance(result: StudyResult) -> Content:
    """Return the command, and options, seed, versions and date of each method."""
    attrs = result.tree.attrs
    return {
        "command": attrs.get("command"),
        "study_attributes": [(str(k), str(v)) for k, v in attrs.items() if k not in _SHOWN],
        "methods": [
            {"label": label, "facts": _facts(method), "versions": method.pairs("versions")}
            for label, method in result.methods.items()
        ],
    }


PROVENANCE = TemplateSection("Provenance", "provenance", provenance)


def _facts(method: Method) -> list[tuple[str, str]]:
    attrs = method.node.attrs
    return [
        *((k, str(attrs[k])) for k in ("propagator", "seed", "created", "uqmbd_version") if k in attrs),
        *((f"option {name}", value) for name, value in method.pairs("options")),
        *((_ATTRIBUTES.get(str(k), str(k)), str(v)) for k, v in attrs.items() if k not in _KNOWN),
    ]
