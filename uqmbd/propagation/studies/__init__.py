"""Studies: a mechanism, times and methods, their import from scripts, and their execution."""

from __future__ import annotations

from uqmbd.propagation.studies.checks import findings, warning_of
from uqmbd.propagation.studies.script import load_mechanism, load_study
from uqmbd.propagation.studies.study import Study

__all__ = [
    "Study",
    "findings",
    "load_mechanism",
    "load_study",
    "warning_of",
]
