"""Findings that results store in their attributes."""

from __future__ import annotations

import json
import math

import xarray as xr

from uqmbd.errors import Finding, Severity, StudyError

__all__ = ["stored_findings"]


def stored_findings(node: xr.DataTree) -> list[Finding]:
    """Return the findings that a node stores, or its warnings, which earlier versions and some methods store."""
    for name in ("findings", "warnings"):
        try:
            stored = json.loads(node.attrs[name])
            if name == "findings":
                return [_finding(**one) for one in stored]
            return [Finding(Severity.WARNING, "", str(text)) for text in stored] if isinstance(stored, list) else []
        except (AttributeError, KeyError, StudyError, TypeError, ValueError):  # missing, or written by another program
            continue
    return []


def _finding(severity: str, place: str, message: str, remedy: str, hidden_errors: object = ()) -> Finding:
    """Return a finding from its stored values."""
    pairs = hidden_errors if isinstance(hidden_errors, (list, tuple)) else ()
    errors = tuple((str(name), math.nan if error is None else float(error)) for name, error in pairs)
    return Finding(Severity(severity), place, message, remedy, hidden_errors=errors)
