"""Sections on how it came about: what each method did, how far it is to be trusted, what it cost, what failed."""

from __future__ import annotations

from uqmbd.report.sections.about_methods.comparison import COMPARISON
from uqmbd.report.sections.about_methods.failures import FAILURES
from uqmbd.report.sections.about_methods.methods import COST, METHODS, PROVENANCE
from uqmbd.report.sections.about_methods.surrogate_accuracy import GROWTH, TRUST

__all__ = ["ABOUT_METHODS"]

ABOUT_METHODS = (METHODS, COMPARISON, TRUST, GROWTH, COST, FAILURES, PROVENANCE)
"""Sections after those of plugins, in the order of the page."""
