"""Sections on methods: their procedure, accuracy, cost and failures."""

from __future__ import annotations

from uqmbd.report.sections.about_methods.comparison import COMPARISON
from uqmbd.report.sections.about_methods.failures import FAILURES
from uqmbd.report.sections.about_methods.methods import COST, METHODS, PROVENANCE
from uqmbd.report.sections.about_methods.surrogate_accuracy import ACCURACY, GROWTH

__all__ = ["ABOUT_METHODS"]

ABOUT_METHODS = (METHODS, COMPARISON, ACCURACY, GROWTH, COST, FAILURES, PROVENANCE)
"""Sections after the sections of plugins, in the order of the page."""
