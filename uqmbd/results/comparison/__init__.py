"""Comparison of methods: alignment, distances, errors, verdicts, recommendation."""

from __future__ import annotations

from uqmbd.results.comparison.accuracy import StatedAccuracy, stated_accuracy
from uqmbd.results.comparison.alignment import align
from uqmbd.results.comparison.differences import choose_reference, compare
from uqmbd.results.comparison.error_norms import relative_errors
from uqmbd.results.comparison.integration_share import IntegrationShare, integration_shares, worst_integration_share
from uqmbd.results.comparison.own_errors import own_error
from uqmbd.results.comparison.recommendation import largest_error_words, overall, recommend, recommended
from uqmbd.results.comparison.sentences import NO_SPREAD, STILL, own_statements, statements
from uqmbd.results.comparison.verdicts import AGREES, COARSE, DIFFERS, FEW, REFERENCE, UNDER_RESOLVED

__all__ = [
    "AGREES",
    "COARSE",
    "DIFFERS",
    "FEW",
    "NO_SPREAD",
    "REFERENCE",
    "STILL",
    "UNDER_RESOLVED",
    "IntegrationShare",
    "StatedAccuracy",
    "align",
    "choose_reference",
    "compare",
    "integration_shares",
    "largest_error_words",
    "overall",
    "own_error",
    "own_statements",
    "recommend",
    "recommended",
    "relative_errors",
    "stated_accuracy",
    "statements",
    "worst_integration_share",
]
